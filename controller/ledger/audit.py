"""`rolling-panda audit`: check the ledger of a robot, or write it out."""

import argparse
import contextlib
import csv
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from controller.ledger.check import reading, verify
from controller.ledger.store import FILE, check_version, read
from rolling_panda.errors import RollingPandaError
from rolling_panda.runtime.process import ROBOT_ID
from rolling_panda.runtime.state_folder import usual_state_folder

_FIELDS = ("number", "at", "kind", "name", "body", "hash")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    arguments = _parser().parse_args(argv)
    try:
        return int(arguments.run(arguments))
    except RollingPandaError as error:
        print(f"rolling-panda audit: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        # The reader of the export has closed the pipe.
        sys.stderr.close()
        return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="rolling-panda audit",
        description="The record of what was decided, refused and done. Each row is bound to all before it by its hash.",
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    check = commands.add_parser("verify", help="check every row; exit code 1 when anything was changed")
    check.add_argument(
        "--expect", type=_hash, metavar="HASH", help="newest hash of an earlier check, still to be there"
    )
    check.set_defaults(run=_verify)
    export = commands.add_parser("export", help="write every row to standard output")
    form = export.add_mutually_exclusive_group()
    form.add_argument("--json", dest="write", action="store_const", const=_write_json, help="a list (the default)")
    form.add_argument("--csv", dest="write", action="store_const", const=_write_csv, help="a table, body as JSON")
    export.set_defaults(run=_export, write=_write_json)
    for command in (check, export):
        command.add_argument("--robot-id", default=ROBOT_ID, help="robot on the wire (default: %(default)s)")
        state = usual_state_folder("ROBOT_ID")
        command.add_argument("--state", type=Path, metavar="DIR", help=f"folder of its state (default: {state})")
    return parser


def _hash(text: str) -> bytes:
    try:
        value = bytes.fromhex(text)
    except ValueError:
        value = b""
    if len(value) != 32:
        raise argparse.ArgumentTypeError(f"{text!r} is no hash; give 64 hexadecimal digits, as `verify` prints them")
    return value


def _folder(arguments: argparse.Namespace) -> Path:
    folder: Path = arguments.state or usual_state_folder(arguments.robot_id)
    return folder


def _verify(arguments: argparse.Namespace) -> int:
    verdict = verify(_folder(arguments), arguments.expect)
    rows = "1 row is" if verdict.rows == 1 else f"{verdict.rows} rows are"
    if verdict.problem:
        print(f"rolling-panda audit: NOT as it was written: {verdict.problem}. {rows} whole before.", file=sys.stderr)
        return 1
    print(f"{rows} as written; newest hash {verdict.head.hex()}")
    print("Note it elsewhere: `audit verify --expect HASH` then finds an end that was cut off with its traces.")
    return 0


def _export(arguments: argparse.Namespace) -> int:
    folder = _folder(arguments)
    with reading(folder) as database:
        check_version(database, folder / FILE)
        rows = (
            (row.number, row.entry.at, row.entry.kind, row.entry.name, row.entry.body, row.hash.hex())
            for row in read(database)
        )
        arguments.write(rows, sys.stdout)
    return 0


def _write_json(rows: Any, out: TextIO) -> None:
    before = "["
    for row in rows:
        told = dict(zip(_FIELDS, row, strict=True))
        with contextlib.suppress(ValueError):
            told["body"] = json.loads(told["body"])
        out.write(f"{before}\n{json.dumps(told, ensure_ascii=False)}")
        before = ","
    out.write("[]\n" if before == "[" else "\n]\n")


def _write_csv(rows: Any, out: TextIO) -> None:
    table = csv.writer(out)
    table.writerow(_FIELDS)
    table.writerows(rows)


if __name__ == "__main__":
    sys.exit(main())
