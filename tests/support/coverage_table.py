"""Prints the coverage by folder, from the JSON report of coverage.py: `python tests/support/coverage_table.py FILE`."""

import json
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

COUNTS = ("num_statements", "covered_lines", "num_branches", "covered_branches")


def table(report: Mapping[str, Any]) -> Iterator[str]:
    """One line for each folder of code, at most two levels deep, and one for all of them."""
    folders: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for name, file in report["files"].items():
        folder = "/".join(PurePosixPath(name).parent.parts[:2])
        folders[folder].update({count: file["summary"][count] for count in COUNTS})
    yield f"{'':28}{'lines':>7}{'covered':>9}{'branches':>10}{'covered':>9}"
    for folder in sorted(folders):
        yield _row(folder, folders[folder])
    yield _row("all", report["totals"])


def _row(name: str, counts: Mapping[str, int]) -> str:
    lines, covered_lines, branches, covered_branches = (counts[count] for count in COUNTS)
    return f"{name:28}{lines:7}{_share(covered_lines, lines):>9}{branches:10}{_share(covered_branches, branches):>9}"


def _share(covered: int, of: int) -> str:
    return f"{100 * covered / of:.1f} %" if of else "–"


if __name__ == "__main__":
    print(*table(json.loads(Path(sys.argv[1]).read_text())), sep="\n")
