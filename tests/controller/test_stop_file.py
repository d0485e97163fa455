import json

import pytest

from controller.loop import open_stop_file
from rolling_panda.errors import InputError
from rolling_panda.messages.supervision import StopRecord
from rolling_panda.reasons import said


def test_latched_stops_are_known_after_a_restart(tmp_path):
    stops = (StopRecord("b", "server", "eve", said("dog"), 2.0), StopRecord("a", "server", "ada", said(""), 1.0))
    file = open_stop_file(tmp_path)
    assert file.value == ()
    file.keep(stops)
    file.close()
    again = open_stop_file(tmp_path)
    assert again.value == stops
    again.close()


def test_the_file_of_an_earlier_version_whose_reasons_are_text_is_read(tmp_path):
    old = [{"stop_id": "a", "source": "server", "user": "ada", "reason": "dog", "wall_time": 1.0}]
    (tmp_path / "controller-stops.json").write_text(json.dumps(old))
    file = open_stop_file(tmp_path)
    assert file.value == (StopRecord("a", "server", "ada", said("dog"), 1.0),)
    file.close()


def test_a_file_that_cannot_be_read_starts_nothing(tmp_path):
    (tmp_path / "controller-stops.json").write_text("[1]")
    with pytest.raises(InputError, match="look whether the robot may move"):
        open_stop_file(tmp_path)
