import pytest

from benchmarks.control.row_walk import walk
from controller.config import ControllerConfig
from controller.core import Controller
from rolling_panda import commands as intents
from rolling_panda.config import RobotConfig
from tests.support.points import point
from tests.support.worlds.kinematic_robot import KinematicLoop, KinematicRobot

CONFIG = ControllerConfig()


class Beside(KinematicLoop):
    """What `walk` needs of a loop, with a kinematic robot and a camera that sees 0.5 m to either side."""

    def __init__(self, row):
        super().__init__(KinematicRobot(Controller(CONFIG, RobotConfig()), CONFIG.work.home))
        self._row, self._seen = row, {}
        self.run(0.1)
        assert self.command(intents.Arm(user="bench")).ok

    state = property(lambda self: self.robot.state)

    inbox = property(lambda self: self.robot.inbox)

    def say(self, message):
        self.robot.hear(message)

    def run(self, seconds):
        for step in range(round(seconds / self.robot.dt)):
            self.robot.step()
            if step % 10 == 0:
                self._seen |= {name: x for name, x in self._row.items() if abs(x - self.robot.q[0] - 0.3) < 0.5}
                self.robot.show(tuple(point(name, (x, 0.76, 1.05)) for name, x in self._seen.items()))


@pytest.mark.long
def test_what_comes_into_view_on_the_way_is_cut_and_gaps_are_driven_over():
    # The third comes into view while the second is cut, the last only after a gap that is driven over by hand.
    row = {"a": 0.4, "b": 0.7, "c": 1.0, "d": 2.1}
    loop = Beside(row)
    assert loop.command(intents.AcceptAll(user="bench")).ok and len(loop.state.queue) < 3
    working, other = walk(loop, end=2.0, limit_s=120.0)
    assert {e.point_id for e in loop.state.queue if e.state == "DONE"} == set(row)
    assert loop.robot.q[0] == pytest.approx(2.0, abs=0.2)
    assert 4 * 2.5 < working < 4 * 6.0
    assert other > 3.0


def test_an_empty_row_is_driven_along_to_its_end():
    loop = Beside({})
    working, other = walk(loop, end=1.0, limit_s=60.0)
    assert working == 0.0 and other > 4.0
    assert loop.robot.q[0] == pytest.approx(1.0, abs=0.1)
