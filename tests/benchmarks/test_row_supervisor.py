"""The played person of the row's benchmark: lets the robot go on after a stop, a few times at most."""

import json

import pytest

from benchmarks.control.row_supervisor import Supervisor
from bridge.sim.robot.trace import TraceWriter
from rolling_panda.messages.types import ArmTorques
from tests.support.controller_at_work import working
from tests.support.points import point
from tests.support.worlds.kinematic_robot import KinematicLoop

STILL: ArmTorques = (0.0,) * 7
PUSHED: ArmTorques = (0.0, 0.0, 0.0, 30.0, 0.0, 0.0, 0.0)


class Beside(KinematicLoop):
    """What the supervisor needs of a loop, with a kinematic robot that is pushed on the way to `pushed`."""

    def __init__(self, pushed=(), **changes):
        points = (point("a", (0.45, 0.75, 1.0)), point("b", (0.9, 0.75, 1.05)))
        super().__init__(working(points, external_torque=STILL, **changes))
        self.pushed, self.active = pushed, ""

    def queue(self, *states):
        return (entry for entry in self.robot.state.queue if not states or entry.state in states)

    def run(self, seconds):
        for _ in range(round(seconds / self.robot.dt)):
            self.robot.step()
            if self.controller.mode == "AUTO" and self.robot.state is not None:
                self.active = self.robot.state.active_point_id
            advances = self.controller.mode == "AUTO" and self.robot.state.phase == "ADVANCE"
            self.robot.external_torque = PUSHED if advances and self.active in self.pushed else STILL

    def work(self, person):
        """Until the work ends, or the person gives up."""
        while self.run_until(lambda: self.controller.mode != "AUTO", 60.0):
            if not person.lets_go_on(self):
                break
        return {entry.point_id: entry.state for entry in self.robot.state.queue}


@pytest.fixture
def record(tmp_path, monkeypatch):
    """A simulator's record in which the cut of b has severed a cane; whoever put the robot to work supervises it."""
    monkeypatch.setattr("benchmarks.control.row_supervisor.USER", "ada")
    writer = TraceWriter(tmp_path / "trace")
    for name, severed in (("a", []), ("b", [{"cane": 0}])):
        writer.event(json.loads(json.dumps({"event": "cut", "point_id": name, "severed": severed})))
    writer.close()
    return tmp_path / "trace"


def test_work_without_a_stop_needs_nobody(record):
    loop, person = Beside(), Supervisor(record)
    assert loop.work(person) == {"a": "DONE", "b": "DONE"}
    assert person.cleared == 0 and person.waited_s == 0.0


@pytest.mark.long
def test_after_a_stop_a_person_looks_and_what_stops_the_robot_again_and_again_it_gives_up(record):
    loop, person = Beside(pushed=("a",)), Supervisor(record)
    assert loop.work(person) == {"a": "FAILED_NOT_CUT", "b": "DONE"}
    # After the third stop nothing is left to go on with.
    assert person.cleared == 2 and person.waited_s > 3 * 10.0


def test_a_row_that_stops_again_and_again_is_given_up(record, monkeypatch):
    monkeypatch.setattr("benchmarks.control.row_supervisor._MOST", 1)
    loop, person = Beside(pushed=("a",)), Supervisor(record)
    assert loop.work(person) == {"a": "ACCEPTED", "b": "DONE"}
    assert person.cleared == 1 and loop.controller.mode == "PROTECTIVE_STOP"


@pytest.mark.long
def test_a_person_says_by_the_truth_how_a_cut_of_unknown_outcome_ended(record):
    loop, person = Beside(outcome="UNKNOWN"), Supervisor(record)
    assert loop.work(person) == {"a": "FAILED_NOT_CUT", "b": "DONE"}
    assert person.cleared >= 1
