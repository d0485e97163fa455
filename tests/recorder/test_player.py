"""What of a recording is told when."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recorder.player import Player
from recorder.recording import RecordedMessage, Recording
from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.commands import SeekReplay
from rolling_panda.reasons import said, text_of
from rolling_panda.topics import Topic
from rolling_panda.transport.codec import StrictDecoder, UndecodableError, encode

BEGAN = 1.8e9


def recorded(topic: Topic[Any], at: float, message: m.Message) -> RecordedMessage:
    return RecordedMessage(topic, BEGAN + at, msgspec.json.encode(message))


def joints(k: int) -> RecordedMessage:
    rest = (0.0,) * 9
    message = m.JointState(header=m.Header(0.1 * k), sequence=k, position=rest, velocity=rest)
    return recorded(topics.JOINTS, 0.1 * k, message)


def heartbeat(at: float, process: m.Process) -> RecordedMessage:
    return recorded(topics.HEARTBEAT, at, m.Heartbeat(process=process, sequence=1))


def event(at: float, text: str) -> RecordedMessage:
    return recorded(topics.EVENT, at, m.LogEvent(header=m.Header(), process="bridge", reason=said(text)))


def stop(at: float) -> RecordedMessage:
    return recorded(topics.STOP, at, m.StopRequest(stop_id="s1", source="page", user="ada", reason=said("a branch")))


def recording(*more: RecordedMessage) -> Recording:
    messages = [*(joints(k) for k in range(101)), *more]
    return Recording(tuple(sorted(messages, key=lambda each: each.at)), True)


def playing(*more: RecordedMessage, now: float = 0.0) -> Player:
    player = Player(recording(*more), "a.mcap", now)
    player.seek(SeekReplay(playing=True))
    return player


def sequences(messages: Sequence[RecordedMessage]) -> list[int]:
    messages = [each.message() for each in messages if each.topic is topics.JOINTS]
    return [message.sequence for message in messages if isinstance(message, m.JointState)]


#: Within the recording: at its end the newest message is told again and again.
@given(st.lists(st.floats(0.001, 0.3), max_size=30))
def test_each_message_is_told_once_in_order_as_its_time_comes(steps: list[float]) -> None:
    player, now, told = playing(now=50.0), 50.0, []
    for step in steps:
        now += step
        told += sequences(player.step(now))
        assert told == list(range(len(told)))
        assert abs(len(told) - 1 - min(10.0 * player.state.position_s, 100.0)) <= 1.0 + 1e-9


def test_it_stands_at_its_beginning_until_it_is_played() -> None:
    player = Player(recording(), "a.mcap", 0.0)
    assert player.step(5.0) == []
    assert (player.state.position_s, player.state.playing) == (0.0, False)
    player.seek(SeekReplay(playing=True))
    assert sequences(player.step(5.5)) == [0, 1, 2, 3, 4, 5]


def test_a_jump_tells_the_newest_of_each_kind_and_each_process_and_no_old_events() -> None:
    beats = heartbeat(2.0, "bridge"), heartbeat(2.5, "controller"), heartbeat(6.0, "controller")
    player = Player(recording(*beats, event(1.0, "long ago"), event(8.0, "later")), "a.mcap", 0.0)
    player.seek(SeekReplay(position_s=5.04, playing=False))
    due = player.step(0.1)
    assert sequences(due) == [50]
    assert [each.at - BEGAN for each in due if each.topic is topics.HEARTBEAT] == [2.0, 2.5]
    assert topics.EVENT not in [each.topic for each in due]
    player.seek(SeekReplay(playing=True))
    due = player.step(3.1)
    assert sequences(due) == list(range(51, 81))
    assert [text_of(each.message().reason) for each in due if each.topic is topics.EVENT] == ["later"]  # type: ignore[attr-defined]


def test_standing_still_it_keeps_fresh_what_is_told_often_and_stays_where_it_is() -> None:
    player = Player(recording(), "a.mcap", 0.0)
    player.seek(SeekReplay(position_s=3.0, playing=False))
    told = [sequences(player.step(0.05 * k)) for k in range(1, 41)]
    assert {k for messages in told for k in messages} == {30}
    assert sum(map(len, told)) >= 15
    assert (player.state.position_s, player.state.playing) == (3.0, False)


def test_at_another_speed_it_covers_more_or_less_of_the_recording_and_leaves_nothing_out() -> None:
    player = Player(recording(), "a.mcap", 0.0)
    player.seek(SeekReplay(speed=4.0))
    told = sequences([message for k in range(1, 21) for message in player.step(0.1 * k)])
    assert told == list(range(81)) and player.state.speed == 4.0
    # A jump or a pause keeps the speed.
    player.seek(SeekReplay(position_s=1.0, playing=False))
    player.step(2.1)
    player.seek(SeekReplay(playing=True))
    player.step(3.1)
    assert round(player.state.position_s, 6) == 5.0
    player.seek(SeekReplay(speed=0.5))
    player.step(4.1)
    assert round(player.state.position_s, 6) == 5.5


@pytest.mark.parametrize("speed", [0.0, 0.49, 8.1, -1.0])
def test_a_speed_out_of_range_is_refused(speed: float) -> None:
    with pytest.raises(UndecodableError):
        StrictDecoder(SeekReplay).decode(encode(SeekReplay(speed=speed)))


def controller_line(at: float, reason: m.Reason) -> RecordedMessage:
    return recorded(topics.EVENT, at, m.LogEvent(header=m.Header(), process="controller", reason=reason))


def test_the_timeline_is_of_the_whole_recording_wherever_it_stands() -> None:
    lines = (
        controller_line(1.0, reasons.mode_changed("READY", "AUTO", said("started by Ada"))),
        controller_line(4.0, reasons.cut_done("p1", reasons.cut_and_gone())),
        controller_line(5.0, reasons.robot_halted("AUTO", "PAUSED", said("a branch"))),
        controller_line(6.0, reasons.command_refused("Bob", "start", reasons.control_held("Ada"))),
    )
    player = Player(recording(event(2.0, "nothing of the controller's"), *lines), "a.mcap", 0.0)
    timeline = player.timeline
    assert (timeline.began_at, timeline.ended_at) == (BEGAN, BEGAN + 10.0)
    assert [(round(each.at - BEGAN, 6), each.kind, each.before, each.mode) for each in timeline.events] == [
        (1.0, "mode", "READY", "AUTO"),
        (4.0, "cut", "", ""),
        (5.0, "mode", "AUTO", "PAUSED"),
        (6.0, "refusal", "", ""),
    ]


def test_a_recording_without_events_has_an_empty_timeline_and_one_that_was_cut_short_says_so() -> None:
    assert Player(recording(), "a.mcap", 0.0).timeline.events == ()
    whole = recording()
    assert Player(whole, "a.mcap", 0.0).state.complete
    assert not Player(replace(whole, complete=False), "a.mcap", 0.0).state.complete


def test_it_ends_standing_at_the_end() -> None:
    player = playing()
    player.step(25.0)
    assert (player.state.position_s, player.state.playing) == (10.0, False)
    player.seek(SeekReplay(position_s=0.0))
    assert sequences(player.step(25.05)) == [0]


def test_no_command_and_nothing_of_the_server_is_told_again() -> None:
    player = playing(stop(1.0), heartbeat(1.0, "server"))
    assert {each.topic.name for each in player.step(20.0)} == {topics.JOINTS.name}
