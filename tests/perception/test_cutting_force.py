import pytest

from perception.rules.cutting_force import cutting_force


def test_a_cane_of_the_paper_needs_the_force_that_was_measured():
    # 263.5 N at 9.34 MPa: a cane of 28.2 mm², 6 mm thick.
    assert cutting_force(0.003) == pytest.approx(263.5, rel=0.01)
    assert cutting_force(0.006) == pytest.approx(4 * cutting_force(0.003))
