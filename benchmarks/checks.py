"""`rolling-panda bench checks`: take each check away on a copy of the program and see that its test fails.

A list of checks and tests that nobody tries says nothing: a test may pass for another reason.
"""

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.check_list import CHECKS, Check
from rolling_panda.errors import InputError

ROOT = Path(__file__).resolve().parents[1]
_CODE = ("rolling_panda", "bridge", "controller", "perception", "server", "benchmarks", "tests")
_LINKED = ("web", "assets", "docs", "README.md")
#: pytest's own: some tests failed.
_FAILED = 1


def without(check: Check, source: str) -> str:
    """The source of a check's file as it is without the check.

    Raises:
        InputError: The check is not there, or more than once: the list is out of date.
    """
    count = source.count(check.there)
    if count != 1:
        raise InputError(f"{check.name}: {check.there!r} is {count} times in {check.file}, it has to be there once")
    return source.replace(check.there, check.gone)


def copy_program(folder: Path) -> None:
    """Lay the program out in a new folder so that its own files are what tests run."""
    for name in _CODE:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("results"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    for name in _LINKED:
        (folder / name).symlink_to(ROOT / name)


def fails(check: Check, folder: Path) -> str:
    """Take the check away in a copy, run its test, and put it back; empty when the test failed as it should."""
    file = folder / check.file
    source = file.read_text(encoding="utf-8")
    file.write_text(without(check, source), encoding="utf-8")
    words = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", f"tests/{check.test}"]
    try:
        done = subprocess.run(
            words,
            cwd=folder,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
    finally:
        file.write_text(source, encoding="utf-8")
    if done.returncode == _FAILED:
        return ""
    return "its test passes without it" if done.returncode == 0 else f"its test did not run: {done.stdout[-500:]}"


def unproved(checks: Iterable[Check]) -> dict[str, str]:
    """Checks without which no test fails, and why."""
    out = {}
    with TemporaryDirectory() as name:
        folder = Path(name) / "program"
        folder.mkdir()
        copy_program(folder)
        for check in checks:
            why = fails(check, folder)
            print(f"{'   ' if not why else 'NOT'} {check.file}: {check.name}: tests/{check.test} {why}", flush=True)
            if why:
                out[check.name] = why
    return out


def main(argv: list[str]) -> int:
    """Run the command; returns the exit code: 1 where a check is not proved."""
    parser = argparse.ArgumentParser(prog="rolling-panda bench checks", description=__doc__)
    parser.add_argument("--only", default="", metavar="TEXT", help="checks whose name or file holds this text")
    arguments = parser.parse_args(argv)
    chosen = [check for check in CHECKS if arguments.only in check.name or arguments.only in check.file]
    missing = unproved(chosen)
    print(f"{len(chosen)} checks, {len(missing)} of them without a test that fails")
    return 1 if missing else 0
