"""Trajectories and corrections."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.motion.tool_motion import Correction, PoseTrajectory, Progress, Rates, quintic

TRANSLATION, ROTATION = Rates(0.3, 0.6, 4.0), Rates(0.8, 1.8, 12.0)
seeds = st.integers(0, 2**32 - 1)


def poses(seed):
    rng = np.random.default_rng(seed)
    return [pin.SE3(pin.exp3(rng.uniform(-1, 1, 3)), rng.uniform(-1, 1, 3)) for _ in range(2)]


def derivative(f, t, step=1e-5):
    return (f(t + step) - f(t - step)) / (2 * step)


@given(st.floats(0.1, 20), st.floats(0.02, 0.98))
def test_quintic_derivatives_agree_with_its_position(duration, share):
    t = share * duration
    at = quintic(t, duration)
    step = 1e-5 * duration
    assert at.rate == pytest.approx(derivative(lambda u: quintic(u, duration).s, t, step), rel=1e-6)
    assert at.acceleration == pytest.approx(derivative(lambda u: quintic(u, duration).rate, t, step), abs=1e-5)


def test_quintic_starts_and_ends_at_rest_and_stays_there():
    for t, s in ((-1.0, 0.0), (0.0, 0.0), (2.0, 1.0), (5.0, 1.0)):
        at = quintic(t, 2.0)
        assert (at.s, at.rate, at.acceleration) == (s, 0.0, 0.0)


@given(st.floats(1e-4, 5.0))
def test_duration_keeps_all_three_bounds_and_uses_one_of_them(distance):
    T = TRANSLATION.duration(distance)
    t = np.linspace(0, T, 2001)
    rate = np.array([quintic(u, T).rate for u in t]) * distance
    acceleration = np.array([quintic(u, T).acceleration for u in t]) * distance
    jerk = np.abs(np.diff(acceleration)) / (t[1] - t[0])
    used = (
        rate.max() / TRANSLATION.velocity,
        np.abs(acceleration).max() / TRANSLATION.acceleration,
        jerk.max() / TRANSLATION.jerk,
    )
    assert max(used) <= 1.001
    assert max(used) > 0.98


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
    size, dt = float(np.linalg.norm(by)), made.duration / 1000
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
