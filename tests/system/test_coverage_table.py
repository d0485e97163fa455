"""The table of `make coverage`, from a report with known counts."""

from tests.support.coverage_table import table


def _counts(statements: int, lines: int, branches: int, taken: int) -> dict[str, int]:
    names = ("num_statements", "covered_lines", "num_branches", "covered_branches")
    return dict(zip(names, (statements, lines, branches, taken), strict=True))


def test_a_folder_has_one_row_with_the_sums_of_its_files() -> None:
    files = {
        "bridge/loop.py": _counts(10, 10, 0, 0),
        "bridge/sim/build.py": _counts(30, 15, 8, 2),
        "bridge/sim/robot/arm.py": _counts(10, 5, 2, 2),
    }
    totals = _counts(50, 30, 10, 4)
    rows = [line.split() for line in table({"files": {k: {"summary": v} for k, v in files.items()}, "totals": totals})]
    assert rows == [
        ["lines", "covered", "branches", "covered"],
        ["bridge", "10", "100.0", "%", "0", "–"],
        ["bridge/sim", "40", "50.0", "%", "10", "40.0", "%"],
        ["all", "50", "60.0", "%", "10", "40.0", "%"],
    ]
