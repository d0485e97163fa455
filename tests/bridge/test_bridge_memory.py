import json
from pathlib import Path

import pytest

from bridge.core.state_memory import Remembered, begin_anew, open_memory
from rolling_panda.errors import InputError
from rolling_panda.messages.supervision import StopRecord
from rolling_panda.messages.types import Reason
from rolling_panda.reasons import bridge_state_absent, said, stop_reset


def test_what_is_kept_is_known_after_a_restart(tmp_path):
    kept = Remembered(
        epoch=9,
        token="ab",
        stops=(StopRecord("s1", "server", "ada", said("dog"), 1.0),),
        released=("s0",),
        released_by=stop_reset("ada", "gone"),
    )
    memory = open_memory(tmp_path)
    assert memory.value == Remembered()
    memory.keep(kept)
    memory.close()
    again = open_memory(tmp_path)
    assert again.value == kept and again.failure is None
    again.close()


def test_a_memory_that_cannot_be_read_starts_nothing(tmp_path):
    (tmp_path / "bridge.json").write_text('{"epoch": "nine"}')
    with pytest.raises(InputError, match="check that the robot may move"):
        open_memory(tmp_path)


def test_a_bridge_without_a_memory_begins_anew_with_a_stop(tmp_path):
    begin_anew(tmp_path)
    memory = open_memory(tmp_path)
    (stop,) = memory.value.stops
    assert (stop.source, stop.user) == ("bridge", "") and stop.reason == bridge_state_absent()
    memory.close()


@pytest.mark.parametrize(("released_by", "read"), [("", None), ("eve: gone", said("eve: gone"))])
def test_the_stops_of_an_earlier_version_whose_reasons_are_text_are_read(
    tmp_path: Path, released_by: str, read: Reason | None
) -> None:
    stop = {"stop_id": "s1", "source": "server", "user": "ada", "reason": "dog", "wall_time": 1.0}
    (tmp_path / "bridge.json").write_text(json.dumps({"epoch": 9, "stops": [stop], "released_by": released_by}))
    memory = open_memory(tmp_path)
    stops = (StopRecord("s1", "server", "ada", said("dog"), 1.0),)
    assert memory.value == Remembered(epoch=9, stops=stops, released_by=read)
    memory.close()
