"""A recording on a real wire: those who were recorded seem to be there, and nothing can be asked of them."""

import time
from collections.abc import Iterator

import pytest

from recorder.player import Player
from recorder.replay import Replay
from rolling_panda import commands as intents
from rolling_panda import topics
from rolling_panda.commands import SeekReplay
from rolling_panda.config import TransportConfig
from rolling_panda.errors import ServiceError
from rolling_panda.reasons import text_of
from rolling_panda.transport.zenoh import Transport
from tests.recorder.test_player import event, joints, recording
from tests.support.waiting import until

pytestmark = pytest.mark.processes


@pytest.fixture
def server(endpoint: str) -> Iterator[tuple[Replay, Transport]]:
    server = Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "server", "rp1")
    replay = Replay(
        TransportConfig(connect=(endpoint,), plain_wire=True),
        Player(recording(event(0.35, "it begins")), "a.mcap", time.monotonic()),
    )
    until(lambda: {"bridge", "controller", "perception"} <= server.present())
    # A process is present a moment before its services are known to the router.
    until(lambda: _answers(server))
    yield replay, server
    replay.close()
    server.close()


def _answers(wire: Transport) -> bool:
    try:
        wire.call(topics.INTENT, intents.Arm(user="ada"))
    except ServiceError:
        return False
    return True


def test_a_server_sees_the_robot_of_the_recording_and_moves_in_it(server: tuple[Replay, Transport]) -> None:
    replay, wire = server
    slot, state, events = wire.slot(topics.JOINTS), wire.slot(topics.REPLAY), wire.feed(topics.EVENT, 10)
    assert wire.call(topics.SEEK, SeekReplay(playing=True)).ok
    end = time.monotonic() + 1.0
    while time.monotonic() < end:
        replay.step(time.monotonic())
        time.sleep(0.01)
    assert {"bridge", "controller", "perception"} <= wire.present()
    newest = slot.peek()
    assert newest is not None and 5 <= newest.message.sequence <= 15
    assert [text_of(received.message.reason) for received in events.drain()] == ["it begins"]
    assert wire.call(topics.SEEK, SeekReplay(position_s=7.0, playing=False)).ok
    replay.step(time.monotonic())
    time.sleep(0.3)
    newest = slot.peek()
    assert newest is not None and newest.message == joints(70).message()
    replay.step(time.monotonic())
    time.sleep(0.2)
    told = state.peek()
    assert told is not None and (told.message.position_s, told.message.playing) == (7.0, False)


def test_nothing_can_be_asked_of_a_recorded_robot(server: tuple[Replay, Transport]) -> None:
    _, wire = server
    answer = wire.call(topics.INTENT, intents.Arm(user="ada"))
    assert not answer.ok and answer.reason.code == "recording_only"
