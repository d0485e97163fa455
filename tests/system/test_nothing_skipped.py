"""No test is skipped for want of something that the Makefile can install."""

import re
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]


def test_no_test_is_skipped_for_a_missing_package() -> None:
    skipping = {
        str(path.relative_to(TESTS))
        for path in TESTS.rglob("*.py")
        if re.search(r"importorskip\(|mark\.skip|pytest\.skip\(", path.read_text()) and path != Path(__file__)
    }
    assert skipping == set()
