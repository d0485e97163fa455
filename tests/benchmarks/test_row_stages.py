import numpy as np
import pytest

from benchmarks.control.row_stages import LIMITS, STAGES, StageClock
from controller.config import ControllerConfig
from controller.core import Controller
from rolling_panda import commands as intents
from rolling_panda.config import RobotConfig
from tests.support.controller_config import controller_config
from tests.support.points import point
from tests.support.worlds.kinematic_robot import KinematicRobot


def work(config, count=3):
    """Cut a few points; the clock that looked on, and how long it took (s)."""
    robot = KinematicRobot(Controller(config, RobotConfig()), config.work.home)
    robot.show(tuple(point(f"p{number}", (0.3 + 0.12 * number, 0.76, 1.05)) for number in range(count)))
    robot.step()
    for intent in (intents.Arm(user="t"), intents.AcceptAll(user="t"), intents.Start(user="t")):
        assert robot.ask(intent).ok
    clock, begin = StageClock(config), robot.now
    clock.begin(begin)
    while robot.now < 60.0:
        robot.step()
        tracking = robot.controller.tracking
        if robot.controller.mode == "AUTO" and tracking is not None and tracking.desired is not None:
            clock.note(robot, tracking)
        if robot.now > begin + 1.0 and robot.controller.mode != "AUTO":
            break
    assert sum(entry.state == "DONE" for entry in robot.state.queue) == count
    clock.end(robot.now)
    return clock, robot.now - begin


def test_every_second_has_one_stage_and_the_blades_take_theirs():
    config = ControllerConfig()
    clock, spent = work(config)
    assert tuple(clock.stages) == STAGES and tuple(clock.limits) == LIMITS
    assert sum(clock.stages.values()) == pytest.approx(spent, abs=1e-6)
    assert 3 * 0.3 < clock.stages["blades"] < 3 * 0.7
    assert 0.0 <= clock.stages["standing"] < 0.1 * spent
    # The slow zone at its speed, and little more.
    assert clock.stages["slow"] == pytest.approx(3 * config.motion.slow_zone / config.motion.cut_speed, rel=0.25)
    under_way = sum(clock.stages[stage] for stage in ("transfer", "advance", "slow", "retreat"))
    assert sum(clock.limits.values()) == pytest.approx(under_way, abs=1e-6)


@pytest.mark.long
def test_the_limit_that_binds_is_named():
    free, _ = work(ControllerConfig())
    slow_joints, _ = work(controller_config(whole_body__arm_velocity_scale=0.3))
    assert slow_joints.limits["joint velocity"] > 1.0 > free.limits["joint velocity"]
    assert np.argmax(list(slow_joints.limits.values())) == LIMITS.index("joint velocity")
