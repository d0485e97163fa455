"""The robot in the 3-D view is sent when it has moved, and not for what odometry wanders while it stands still."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from rolling_panda import messages as m
from rolling_panda.model.robot import RobotModel, configuration
from server.scene.robot import SceneRobot

MODEL = RobotModel().model
ARM = (0.1, -0.4, 0.2, -1.9, 0.0, 1.6, 0.8)


@pytest.fixture
def frames():
    return {}


@pytest.fixture
def robot(frames):
    def add_frame(name, **_):
        return frames.setdefault(name, SimpleNamespace(position=None, wxyz=None))

    scene = SimpleNamespace(add_frame=add_frame, add_mesh_simple=lambda *_, **__: SimpleNamespace())
    return SceneRobot(SimpleNamespace(scene=scene, atomic=nullcontext), MODEL, [])


def posture(x=0.0, y=0.0, theta=0.0, arm=ARM):
    return configuration(m.PlanarPose(x, y, theta), (0.0, 0.0, *arm))


def test_a_robot_that_stands_still_is_sent_once_whatever_odometry_wanders(robot):
    chance = np.random.default_rng(4)
    assert robot.move(posture())
    for x, y, theta in chance.normal(0.0, 3e-4, (200, 3)).clip(-9e-4, 9e-4):
        assert not robot.move(posture(x, y, theta))


def test_what_it_creeps_adds_up(robot, frames):
    robot.move(posture())
    for step in range(1, 101):
        robot.move(posture(x=1e-4 * step))
    assert frames["/robot"].position[0] == pytest.approx(0.01, abs=1e-3)


def test_a_joint_that_turns_a_little_is_sent_and_no_other(robot, frames):
    robot.move(posture())
    before = {name: frame.wxyz for name, frame in frames.items()}
    assert robot.move(posture(arm=(ARM[0] + 1e-3, *ARM[1:])))
    assert [name for name, frame in frames.items() if frame.wxyz is not before[name]] == [
        name for name in frames if name.endswith("panda_joint1")
    ]
