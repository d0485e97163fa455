"""`rolling-panda bench mutation`: change the program in many small ways and see whether a test fails each time.

A check that no test misses shows as a mutant that survives. Kill it with a test, or justify it in one line in
`benchmarks/mutation/justified.toml`. Verdicts are kept in `build/mutants/`, so that the next run goes on where this one
ended; survivors are tried again each time.
"""

import json
import os
import subprocess
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from benchmarks.common.documents import bench_parser, write
from benchmarks.common.intervals import share
from benchmarks.mutation.targets import TARGETS, Target
from rolling_panda.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
JUSTIFIED = Path(__file__).with_name("justified.toml")
#: mutmut and what it needs, beside the project's own packages: `make mutation` makes it.
_PYTHON = ROOT / "build/mutation/bin/python"
_CODE = ("rolling_panda", "bridge", "controller", "perception", "server", "recorder", "labelling", "benchmarks")
_BESIDE = ("assets", "web", "docs", "deploy", "README.md")
_SETTINGS = """
[tool.mutmut]
source_paths = {code}
only_mutate = {files}
pytest_add_cli_args_test_selection = {tests}
pytest_add_cli_args = ["-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning"]
process_isolation = "forkserver"
use_git_change_detection = false
on_dependency_change = "ignore"
"""


class Justified(msgspec.Struct, forbid_unknown_fields=True):
    """Mutants that may survive.

    Attributes:
        file: The file, from the checkout's root.
        was: The line as it is.
        becomes: What mutants made of it.
        why: One line.
    """

    file: str
    was: str
    becomes: tuple[str, ...]
    why: str


class Change(msgspec.Struct):
    """A mutant: a line of a file, before and after."""

    file: str
    was: str
    becomes: str


class Found(msgspec.Struct):
    """What a target's worker tells.

    Attributes:
        mutants: All that there are.
        chosen: How many of them were to be tried.
        counts: How many of those that were tried ended how.
        alive: Those that no test failed for.
    """

    mutants: int
    chosen: int
    counts: dict[str, int]
    alive: list[Change]


@dataclass(frozen=True)
class Score:
    """Of one target's mutants."""

    target: str
    mutants: int
    tried: int
    killed: int
    justified: int
    unjustified: list[Change]

    def document(self, sample: int, seed: int) -> dict[str, Any]:
        """For a file of results."""
        figure = share(self.killed, self.tried)
        return {
            "target": self.target,
            "mutants": self.mutants,
            "tried": self.tried,
            "killed": self.killed,
            "justified": self.justified,
            "unjustified": len(self.unjustified),
            "killed_share": [figure.value, figure.low, figure.high],
            "sample": sample,
            "seed": seed,
        }


def justified(file: Path = JUSTIFIED) -> list[Justified]:
    """The list of mutants that may survive.

    Raises:
        InputError: A line is not in its file any more.
    """
    rows = msgspec.convert(tomllib.loads(file.read_text(encoding="utf-8")).get("justified", []), list[Justified])
    for row in rows:
        if row.was not in " ".join((ROOT / row.file).read_text(encoding="utf-8").split()):
            raise InputError(f"{file.name} is out of date: {row.was!r} is not in {row.file}")
    return rows


def lay_out(name: str, target: Target) -> Path:
    """The folder that mutmut works in: the program by links, its settings, and mutants in a folder below."""
    folder = ROOT / "build/mutants" / name
    (folder / "mutants").mkdir(parents=True, exist_ok=True)
    for word in (*_CODE, "tests"):
        _link(folder / word, ROOT / word)
    for word in _BESIDE:
        _link(folder / "mutants" / word, ROOT / word)
    words = {
        "code": json.dumps(_CODE),
        "files": json.dumps(target.paths(ROOT)),
        "tests": json.dumps([f"tests/{test}" for test in target.tests]),
    }
    settings = (ROOT / "pyproject.toml").read_text(encoding="utf-8") + _SETTINGS.format(**words)
    (folder / "pyproject.toml").write_text(settings, encoding="utf-8")
    return folder


def _link(place: Path, what: Path) -> None:
    if not place.is_symlink():
        place.symlink_to(what)


def tried(name: str, target: Target, sample: int, seed: int, workers: int) -> Found:
    """Try a target's mutants, or tell what is known of them where `workers` is 0.

    Raises:
        InputError: mutmut is not installed, or the tests fail without a mutant.
    """
    if not _PYTHON.exists():
        raise InputError(f"there is no {_PYTHON}: `make mutation` installs mutmut there")
    folder = lay_out(name, target)
    worker = [str(_PYTHON), str(ROOT / "benchmarks/mutation/worker.py"), str(sample), str(seed), str(workers)]
    log = folder / "log"
    with log.open("w") as file:
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "HYPOTHESIS_PROFILE": "mutation"}
        done = subprocess.run(worker, cwd=folder, env=environment, stdout=file, stderr=subprocess.STDOUT)
    if done.returncode != 0:
        raise InputError(f"{name}: mutmut ended with {done.returncode}; what it said is in {log}")
    return msgspec.json.decode((folder / "results.json").read_bytes(), type=Found)


def score(name: str, found: Found, known: list[Justified]) -> Score:
    """How many mutants were killed, and which of the others nobody has justified."""
    fine = {(row.file, row.was, becomes) for row in known for becomes in row.becomes}
    left = [each for each in found.alive if (each.file, each.was, each.becomes) not in fine]
    total = sum(found.counts.values())
    return Score(name, found.mutants, total, total - len(found.alive), len(found.alive) - len(left), left)


def main(argv: list[str]) -> int:
    """Run the command; returns the exit code: 1 where a survivor is not justified."""
    parser = bench_parser("mutation", __doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"of {', '.join(TARGETS)} (default: all)")
    parser.add_argument(
        "--sample", type=int, default=0, metavar="N", help="so many mutants of each target (default: all)"
    )
    parser.add_argument("--seed", type=int, default=0, help="which ones (default: %(default)s)")
    parser.add_argument("--workers", type=int, default=1, help="mutants at once; 0 tells what is known")
    arguments = parser.parse_args(argv)
    if unknown := set(arguments.targets) - set(TARGETS):
        raise InputError(f"there is no target {', '.join(sorted(unknown))}; there are {', '.join(TARGETS)}")
    known, scores = justified(), []
    for name in arguments.targets or TARGETS:
        print(f"{name}:", flush=True)
        found = tried(name, TARGETS[name], arguments.sample, arguments.seed, arguments.workers)
        scores.append(score(name, found, known))
        for each in scores[-1].unjustified:
            print(f"  {each.file}\n    - {each.was}\n    + {each.becomes}")
    for row in scores:
        print(
            f"{row.target}: {row.killed} of {row.tried} tried killed, {row.justified} justified, "
            f"{len(row.unjustified)} neither; there are {row.mutants}"
        )
    write(arguments.json, {"targets": [row.document(arguments.sample, arguments.seed) for row in scores]})
    return 1 if any(row.unjustified for row in scores) else 0
