# ruff: noqa: E501
"""The list of checks is up to date, and each of them has a test that fails without it."""

import pytest

from benchmarks.check_list import CHECKS, Check
from benchmarks.checks import ROOT, main, unproved, without
from rolling_panda.errors import InputError


def test_every_check_of_the_list_is_there_and_so_is_its_test() -> None:
    assert len({check.name for check in CHECKS}) == len(CHECKS) > 80
    for check in CHECKS:
        source = (ROOT / check.file).read_text(encoding="utf-8")
        assert without(check, source) != source
        file, _, name = check.test.partition("::")
        assert f"def {name}" in (ROOT / "tests" / file).read_text(encoding="utf-8")


def test_a_check_that_has_gone_is_an_error_and_not_passed_over() -> None:
    with pytest.raises(InputError, match="0 times in x.py"):
        without(Check("c", "x.py", "if wrong:", "if False:", "test_validator.py"), "pass\n")


@pytest.mark.slow
def test_a_check_that_nothing_tests_is_found() -> None:
    unseen = Check(
        "a comment", "bridge/core/validator.py", "#: Speed below which", "#: The speed below which", "test_validator.py"
    )
    proved = next(check for check in CHECKS if check.name == "sequence of a motion command")
    assert list(unproved([unseen, proved])) == ["a comment"]


@pytest.mark.slow
def test_without_any_of_the_checks_its_test_fails() -> None:
    assert main([]) == 0
