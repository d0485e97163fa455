"""Bringing the arm home keeps clear of what stands around, and says when it cannot get there."""

import numpy as np

from controller.config import ControllerConfig
from controller.core import Controller
from controller.motion.surroundings import Surroundings
from controller.whole_body.collision import CollisionModel
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Capsule, Obstacles
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.reasons import text_of
from rolling_panda.transport.inbox import Received
from tests.support.worlds.kinematic_robot import KinematicRobot

CONFIG = ControllerConfig()
#: Turned away from the row, with the tool to the right of the base.
ASIDE = (-2.2, -0.1128, -0.0354, -2.0055, 1.6759, 1.2124, -0.269)


#: Clear of the canes but for the room to turn, with the wrist near the axis of joint 1.
SINGULAR = (-0.93, -0.46, 1.09, -0.8, 1.89, 1.22, 0.12)


def homing(*obstacles: Capsule, posture: tuple[float, ...] = ASIDE) -> KinematicRobot:
    robot = KinematicRobot(Controller(CONFIG, RobotConfig()), posture)
    robot.obstacles = obstacles
    robot.run(0.1)
    assert robot.ask(intents.Arm(user="ada")).ok
    assert robot.ask(intents.Home(user="ada")).ok
    return robot


def test_it_gets_home_when_nothing_is_in_the_way() -> None:
    robot = homing()
    robot.run(12.0)
    np.testing.assert_allclose(robot.q[ARM_Q], CONFIG.work.home, atol=0.012)
    assert text_of(reasons.arm_home()) in robot.events


def test_a_post_in_the_way_stops_it_before_it_is_met_and_is_named() -> None:
    """Halfway round, where the tool would pass."""
    at = KinematicRobot(Controller(CONFIG, RobotConfig()), (-1.2, *ASIDE[1:]))
    x, y, _ = at.model.kinematics(at.q).T_odom_tool.translation
    post = Capsule("post", (float(x), float(y), 0.0), (float(x), float(y), 1.9), 0.04, 0.04)
    judge = Surroundings(CollisionModel(RobotModel()))
    judge.update(Received(Obstacles(header=m.Header(0.0, "odom"), capsules=(post,)), 0.0))
    robot, least = homing(post), 1.0
    for _ in range(1200):
        robot.step()
        least = min(least, judge.model.least(robot.q).distance)
    assert least > 0.0
    assert any("Homing was stopped" in event and "post" in event for event in robot.events), robot.events
    assert np.abs(robot.xi).max() < 1e-3
    assert robot.controller.mode == "READY"
    # The page does not go on to say that the arm is on its way.
    assert robot.state is not None and robot.state.reason.code == "homing_blocked"


def test_near_a_singularity_it_turns_home_by_its_joints_once_clear_of_the_canes() -> None:
    """The straight way back would need ever quicker turns of joint 1."""
    robot = homing(posture=SINGULAR)
    robot.run(12.0)
    np.testing.assert_allclose(robot.q[ARM_Q], CONFIG.work.home, atol=0.012)
    assert text_of(reasons.arm_home()) in robot.events
