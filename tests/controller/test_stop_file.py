import pytest

from controller.stop_file import open_stop_file
from rolling_panda.errors import InputError
from rolling_panda.messages.supervision import StopRecord


def test_latched_stops_are_known_after_a_restart(tmp_path):
    stops = (StopRecord("b", "server", "eve", "dog", 2.0), StopRecord("a", "server", "ada", "", 1.0))
    file = open_stop_file(tmp_path)
    assert file.value == ()
    file.keep(stops)
    file.close()
    again = open_stop_file(tmp_path)
    assert again.value == stops
    again.close()


def test_a_file_that_cannot_be_read_starts_nothing(tmp_path):
    (tmp_path / "controller-stops.json").write_text("[1]")
    with pytest.raises(InputError, match="look whether the robot may move"):
        open_stop_file(tmp_path)
