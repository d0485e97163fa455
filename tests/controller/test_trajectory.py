"""Trajectories and corrections."""

import numpy as np
import pinocchio as pin
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.motion.rest_to_rest import Progress, Rates
from controller.motion.tool_motion import Correction, PoseTrajectory

TRANSLATION, ROTATION = Rates(0.3, 0.6, 4.0), Rates(0.8, 1.8, 12.0)
seeds = st.integers(0, 2**32 - 1)


def poses(seed):
    rng = np.random.default_rng(seed)
    return [pin.SE3(pin.exp3(rng.uniform(-1, 1, 3)), rng.uniform(-1, 1, 3)) for _ in range(2)]


@settings(max_examples=25, deadline=None)
@given(seeds, st.booleans(), st.floats(0.05, 0.95))
def test_twist_is_the_rate_of_the_pose(seed, straight, share):
    start, goal = poses(seed)
    path = PoseTrajectory(start, goal, TRANSLATION, ROTATION, straight=straight)
    t, step = share * path.duration, 1e-5
    a, b = path.at(t - step).T_odom_tool, path.at(t + step).T_odom_tool
    rate = np.concatenate([b.translation - a.translation, pin.log3(b.rotation @ a.rotation.T)]) / (2 * step)
    np.testing.assert_allclose(path.at(t).twist, rate, atol=1e-5)


@settings(max_examples=25, deadline=None)
@given(seeds, st.booleans())
def test_path_leads_from_start_to_goal_within_the_speeds(seed, straight):
    start, goal = poses(seed)
    path = PoseTrajectory(start, goal, TRANSLATION, ROTATION, straight=straight)
    np.testing.assert_allclose(path.at(0.0).T_odom_tool.homogeneous, start.homogeneous, atol=1e-9)
    np.testing.assert_allclose(path.at(path.duration).T_odom_tool.homogeneous, goal.homogeneous, atol=1e-9)
    twists = np.array([path.at(t).twist for t in np.linspace(0, path.duration, 50)])
    assert np.linalg.norm(twists[:, :3], axis=1).max() <= 0.3 + 1e-9
    assert np.linalg.norm(twists[:, 3:], axis=1).max() <= 0.8 + 1e-9


def test_a_straight_path_does_not_bulge():
    start, goal = poses(4)
    path = PoseTrajectory(start, goal, TRANSLATION, ROTATION, straight=True)
    way = goal.translation - start.translation
    for t in np.linspace(0, path.duration, 20):
        off = path.at(t).T_odom_tool.translation - start.translation
        assert np.linalg.norm(np.cross(off, way)) < 1e-9


def test_at_least_stretches_the_motion():
    start, goal = poses(4)
    assert PoseTrajectory(start, goal, TRANSLATION, ROTATION, at_least=30.0).duration == 30.0


RATES = Rates(0.03, 1.0, 10.0)
places = st.tuples(*[st.floats(-0.01, 0.01)] * 3)


@given(places, st.floats(0.0, 5.0))
def test_it_keeps_its_bounds_and_is_all_there_at_its_end(by, begin):
    made = Correction.within(begin, np.array(by), np.zeros(2), RATES)
    size, dt = float(np.linalg.norm(by)), made.law.duration / 1000
    times = begin + np.arange(-10, 1011) * dt
    way = size * np.array([made.progress(time).s for time in times])
    speed = size * np.array([made.progress(time).rate for time in times])
    assert made.progress(begin) == Progress(0.0, 0.0, 0.0)
    assert made.progress(made.end + 1.0) == Progress(1.0, 0.0, 0.0)
    np.testing.assert_allclose(made.progress(made.end).s, 1.0)
    assert speed.max() <= RATES.velocity * (1 + 1e-6)
    assert np.abs(np.diff(speed) / dt).max() <= RATES.acceleration * (1 + 1e-6)
    assert np.abs(np.diff(speed, 2) / dt**2).max() <= RATES.jerk * (1 + 1e-3) + 1e-6
    np.testing.assert_allclose(np.gradient(way, dt)[20:-20], speed[20:-20], atol=1e-4)
