import pytest

from controller.ledger.start import count_start
from rolling_panda.errors import InputError


def test_each_start_has_a_number_of_its_own(tmp_path):
    assert [count_start(tmp_path) for _ in range(3)] == [1, 2, 3]


def test_a_count_that_cannot_be_read_starts_nothing(tmp_path):
    (tmp_path / "controller-starts").write_text("many")
    with pytest.raises(InputError, match="holds 'many'"):
        count_start(tmp_path)
