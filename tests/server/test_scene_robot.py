"""The robot, the ghost of a preview and the trail of the tool in the 3-D view."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from rolling_panda import messages as m
from rolling_panda.messages.supervision import PreviewRow
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import RobotModel, configuration
from server.scene.robot import SceneRobot, ToolTrail, configuration_at

MODEL, HERE = RobotModel().model, MapFrame()
ARM = (0.1, -0.4, 0.2, -1.9, 0.0, 1.6, 0.8)


@pytest.fixture
def frames():
    return {}


@pytest.fixture
def robot(frames):
    def add_frame(name, **_):
        return frames.setdefault(name, SimpleNamespace(position=None, wxyz=None))

    def draw(*_, **__):
        return SimpleNamespace()

    scene = SimpleNamespace(add_frame=add_frame, add_mesh_simple=draw, add_image=draw)
    return SceneRobot(SimpleNamespace(scene=scene, atomic=nullcontext), MODEL, [])


def posture(x=0.0, y=0.0, theta=0.0, arm=ARM):
    return configuration(m.PlanarPose(x, y, theta), (0.0, 0.0, *arm))


def test_a_robot_that_stands_still_is_sent_once_whatever_odometry_wanders(robot):
    chance = np.random.default_rng(4)
    assert robot.move(posture(), HERE)
    for x, y, theta in chance.normal(0.0, 3e-4, (200, 3)).clip(-9e-4, 9e-4):
        assert not robot.move(posture(x, y, theta), HERE)


def test_what_it_creeps_adds_up(robot, frames):
    robot.move(posture(), HERE)
    for step in range(1, 101):
        robot.move(posture(x=1e-4 * step), HERE)
    assert frames["/robot"].position[0] == pytest.approx(0.01, abs=1e-3)


def test_a_robot_whose_odometry_has_drifted_stands_where_it_is_in_the_row(robot, frames):
    robot.move(posture(x=1.0), HERE)
    tool, ahead = robot.tool
    drift = pin.SE3(pin.exp3(np.array([0.0, 0.02, 0.1])), np.array([-0.2, 0.05, 0.01]))
    robot.move(posture(x=1.0), MapFrame(drift))
    assert frames["/robot"].position == pytest.approx(drift.act(np.array([1.0, 0.0, 0.0])), abs=1e-9)
    assert robot.tool[0] == pytest.approx(drift.act(tool)) and robot.tool[1] == pytest.approx(drift.rotation @ ahead)
    assert robot.rods()[-1].end == pytest.approx(robot.tool[0])


def test_a_joint_that_turns_a_little_is_sent_and_no_other(robot, frames):
    robot.move(posture(), HERE)
    before = {name: frame.wxyz for name, frame in frames.items()}
    assert robot.move(posture(arm=(ARM[0] + 1e-3, *ARM[1:])), HERE)
    assert [name for name, frame in frames.items() if frame.wxyz is not before[name]] == [
        name for name in frames if name.endswith("panda_joint1")
    ]


ROWS = tuple(
    PreviewRow(0.1 * i, m.PlanarPose(0.01 * i, 0.0, 0.0), (0.0, 0.0, 0.2 * i, *[0.0] * 6), (0.0, 0.0, 1.0))
    for i in range(5)
)


def test_a_moment_between_two_rows_is_between_them():
    q = configuration_at(ROWS, 0.15)
    np.testing.assert_allclose((q[0], q[5]), (0.015, 0.3))


def test_before_the_first_and_after_the_last_row_the_robot_stands():
    np.testing.assert_allclose(configuration_at(ROWS, 0.0)[5], 0.0)
    np.testing.assert_allclose(configuration_at(ROWS, 99.0)[5], 0.8)
    np.testing.assert_allclose(configuration_at(ROWS[:1], 5.0)[5], 0.0)


def drawn_by():
    drawn = []
    scene = SimpleNamespace(add_point_cloud=lambda name, points, colors, **looks: drawn.append((points, colors)))
    return ToolTrail(SimpleNamespace(scene=scene)), drawn


def test_the_trail_grows_as_the_tool_goes_and_noise_adds_nothing():
    trail, drawn = drawn_by()
    assert trail.extend((0.0, 0.0, 1.0))
    assert not trail.extend((0.001, 0.0, 1.0)) and drawn == [], "one dot is no trail"
    assert trail.extend((0.03, 0.0, 1.0))
    points, colors = drawn[-1]
    assert np.allclose(points, [[0.0, 0.0, 1.0], [0.03, 0.0, 1.0]])
    assert colors.shape == (2, 3) and (colors[0] != colors[1]).any(), "it fades into the past"


def test_what_is_long_ago_goes():
    trail, drawn = drawn_by()
    for step in range(500):
        trail.extend((0.03 * step, 0.0, 1.0))
    points, _ = drawn[-1]
    assert len(points) < 100 and points[-1, 0] > 14.9 and points[0, 0] > 12.0
