"""A recording is played into a process, which says the same again; a process that has changed does not."""

import json

import pytest

from benchmarks.replay import compare, controller, main, perception, replay
from recorder.recording import RecordingWriter
from rolling_panda import messages as m
from rolling_panda.resources import resource
from rolling_panda.topics import TOPIC_OF
from tests.support.worlds.closed_loop import ClosedLoop
from tests.support.worlds.faulty_world import FaultyWorld

SIM = resource("assets/config/sim.toml")


def recorded(kind):
    """A world of this kind that keeps what is said."""

    class Recorded(kind):
        def __init__(self, *arguments):
            self.said = []
            super().__init__(*arguments)

        def say(self, message):
            self.said.append((self.now, message))
            super().say(message)

    return Recorded


def stopped():
    """What is said while nobody asks for anything, and a stop is pressed."""
    world = recorded(FaultyWorld)(4)
    # A recording has the times of arrival.
    world.links = {}
    world.say(m.Heartbeat(process="server", sequence=1))
    # Between two control periods.
    world.run(1.003)
    world.stop()
    world.run(1.0)
    return world.said


def differing(messages, without=()):
    """Topics of the controller on which the replay of these messages, without some, says something else."""
    core, period_s = controller(SIM, messages)
    heard = [each for each in messages if type(each[1]) not in without]
    rows = compare(messages, replay(heard, "controller", core, period_s), "controller")
    return {row.topic for row in rows if row.differs_at is not None}


def test_a_controller_says_the_same_again_and_something_else_without_the_stop():
    messages = stopped()
    assert differing(messages) == set()
    changed = differing(messages, {m.StopRequest, m.BridgeState})
    assert {"state/controller", "state/stops"} <= changed


def test_the_fields_that_differ_are_named():
    said = [(1.0, m.Heartbeat(process="perception", sequence=number)) for number in (1, 2)]
    again = [said[0], (1.1, m.Heartbeat(process="perception", sequence=3))]
    (row,) = compare(said, again, "perception")
    assert (row.recorded, row.replayed, row.equal, row.differs_at, row.fields) == (2, 2, 1, 1.0, ("sequence",))
    assert compare(said, said, "controller") == []


def test_a_recording_file_is_replayed_and_the_comparison_is_written(tmp_path, capsys):
    file, figures = tmp_path / "a.mcap", tmp_path / "a.json"
    writer = RecordingWriter(file, "rp1")
    for at, message in stopped():
        writer.write(TOPIC_OF[type(message)], message, round(1e9 * (1_000.0 + at)))
    writer.close()
    assert main([str(file), "controller", "--json", str(figures)]) == 0
    topics = {row["topic"]: row for row in json.loads(figures.read_text())["topics"]}
    assert topics["state/controller"]["equal"] == topics["state/controller"]["recorded"] > 30
    assert "state/controller" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main([str(file), "server"])


@pytest.mark.long
def test_perception_finds_the_same_points_again():
    with recorded(ClosedLoop)(0) as world:
        world.run(4.0)
    core, period_s = perception(SIM)
    rows = compare(world.said, replay(world.said, "perception", core, period_s), "perception")
    (points,) = [row for row in rows if row.topic == "perception/points"]
    assert (points.equal, points.differs_at) == (points.recorded, None)
    assert points.recorded >= 3
