import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.config import ControllerConfig
from controller.motion.tool_motion import Leg, ToolMotion
from tests.support.controller_config import controller_config

CONFIG = ControllerConfig()
turns = st.tuples(*[st.floats(-1.2, 1.2)] * 3)
places = st.tuples(*[st.floats(-0.4, 0.4)] * 3)


def pose(place, turn):
    return pin.SE3(pin.exp3(np.array(turn)), np.array(place))


def motion(corners, frozen=False, **changes):
    """Through these poses; the posture's first arm joint counts the legs."""
    legs = []
    for number, corner in enumerate(corners[1:]):
        q = np.zeros(12)
        q[5] = number + 1.0
        legs.append(Leg(corner, q, CONFIG.work.tool_speed, math.inf if frozen and number == 0 else 0.0))
    return ToolMotion(CONFIG.motion, CONFIG.whole_body, corners[0], np.zeros(12), legs, **changes)


def at(path, time):
    path.time = time
    return path.desired()


@given(st.lists(st.tuples(places, turns), min_size=2, max_size=4))
def test_it_begins_and_ends_at_rest_where_it_should(corners):
    corners = [pose(*corner) for corner in corners]
    path = motion(corners)
    first, last = at(path, 0.0), at(path, path.duration)
    for state, corner in ((first, corners[0]), (last, corners[-1])):
        np.testing.assert_allclose(state.T_odom_tool.homogeneous, corner.homogeneous, atol=1e-9)
        np.testing.assert_allclose(state.twist, 0.0, atol=1e-12)
    assert path.done and path.posture().q[5] == pytest.approx(len(corners) - 1.0)


@given(st.lists(st.tuples(places, turns), min_size=3, max_size=4), st.floats(0.02, 0.98))
def test_the_twist_is_the_rate_of_the_pose_also_round_corners(corners, share):
    path, dt = motion([pose(*corner) for corner in corners]), 1e-5
    time = share * path.duration
    now, before, after = at(path, time), at(path, time - dt), at(path, time + dt)
    np.testing.assert_allclose(
        now.twist[:3], (after.T_odom_tool.translation - before.T_odom_tool.translation) / (2 * dt), atol=1e-4
    )
    turned = pin.log3(after.T_odom_tool.rotation @ before.T_odom_tool.rotation.T) / (2 * dt)
    np.testing.assert_allclose(now.twist[3:], turned, atol=1e-4)


@given(st.lists(st.tuples(places, turns), min_size=2, max_size=4), st.floats(0.0, 1.0), st.floats(0.0, 5.0))
def test_what_lies_ahead_is_what_will_be_wanted_then_and_the_goal_after_the_end(corners, share, seconds):
    path = motion([pose(*corner) for corner in corners])
    path.advance(1.0, share * path.duration)
    ahead, end = path.ahead(seconds), path.ahead(math.inf)
    path.advance(1.0, min(seconds, path.duration - path.time))
    assert ahead.isApprox(path.desired().T_odom_tool, 1e-9)
    assert end.isApprox(path.goal, 1e-9)


@given(st.lists(st.tuples(places, turns), min_size=3, max_size=4), st.floats(0.02, 0.98))
def test_the_acceleration_is_the_rate_of_the_twist_also_round_corners(corners, share):
    path, dt = motion([pose(*corner) for corner in corners]), 1e-5
    time = share * path.duration
    now, before, after = at(path, time), at(path, time - dt), at(path, time + dt)
    np.testing.assert_allclose(now.acceleration, (after.twist - before.twist) / (2 * dt), atol=2e-3)


def test_a_corner_is_rounded_without_stopping_and_not_cut_by_much():
    corners = [pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), pose((0.0, -0.22, 0.0), (0.0, 0.0, 0.0))]
    corners.append(pose((0.3, -0.22, 0.0), (0.0, 0.0, 0.0)))
    path = motion(corners)
    times = np.linspace(0.0, path.duration, 400)[1:-1]
    states = [at(path, time) for time in times]
    speeds = np.array([np.linalg.norm(state.twist[:3]) for state in states])
    middle = (times > 0.1 * path.duration) & (times < 0.9 * path.duration)
    assert speeds[middle].min() > 0.02
    # Out of the canes before it goes sideways: half of the clearance is left behind when 2 cm are done along the row.
    sideways = next(state for state in states if state.T_odom_tool.translation[0] > 0.02)
    assert sideways.T_odom_tool.translation[1] < -0.17
    slow = motion(corners[:1] + corners[1:2]).duration + motion(corners[1:]).duration
    assert path.duration < 0.85 * slow


def test_the_base_is_frozen_for_the_frozen_leg_only():
    corners = [pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), pose((0.0, -0.2, 0.0), (0.0, 0.0, 0.0))]
    corners.append(pose((0.4, -0.2, 0.0), (0.0, 0.0, 0.0)))
    path = motion(corners, frozen=True)
    path.time = 0.2
    assert (path.leg, path.base) == (0, "frozen")
    path.time = 0.9 * path.duration
    assert (path.leg, path.base) == (1, "row")


def out_over_and_in(along, base, arm_only=0.05, config=CONFIG):
    """Out of one cut and into the next, `along` (m) the row, the base by `base` (m) farther."""
    q_out, q_goal = np.zeros(12), np.zeros(12)
    q_goal[0] = base
    out = pose((0.0, -0.22, 0.0), (0.0, 0.0, 0.0))
    over, cut = pose((along, -0.22, 0.0), (0.0, 0.0, 0.0)), pose((along, 0.0, 0.0), (0.0, 0.0, 0.0))
    legs = [
        Leg(out, q_out, CONFIG.work.tool_speed, frozen_until=arm_only),
        Leg(over, q_goal, CONFIG.work.tool_speed),
        Leg(cut, q_goal, CONFIG.work.tool_speed, frozen_within=arm_only),
    ]
    return ToolMotion(config.motion, config.whole_body, pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), np.zeros(12), legs)


@given(st.floats(-1.5, 1.5))
def test_between_cuts_the_base_is_on_its_way_whenever_the_tool_is_not_at_a_cut(along):
    path = out_over_and_in(along, along)
    places, base_speed, dt = [], [], path.duration / 500
    for path.time in np.arange(501) * dt:
        near = min(abs(path.desired().T_odom_tool.translation[1]), 1.0) < 0.05 - 1e-6
        assert path.base == ("frozen" if near else path.base)
        posture = path.posture()
        if near:
            assert posture.rate[0] == pytest.approx(0.0, abs=1e-9)
        places.append(posture.q[0])
        base_speed.append(abs(posture.rate[0]))
    assert places[0] == 0.0 and places[-1] == pytest.approx(along)
    assert max(base_speed) <= CONFIG.whole_body.base_speed
    assert np.abs(np.diff(base_speed)).max() / dt <= 1.1 * CONFIG.whole_body.base_acceleration


def test_a_short_way_of_the_base_costs_no_time():
    standing = out_over_and_in(0.12, 0.0).duration
    assert out_over_and_in(0.12, 0.1).duration < 1.15 * standing
    # The whole way with the arm still in front of each cut takes longer, all the more beside a quick tool.
    assert out_over_and_in(0.12, 0.1, arm_only=0.2).duration > 1.1 * standing
    quick = controller_config(CONFIG, motion__tool_acceleration=3.0, motion__tool_jerk=50.0)
    standing = out_over_and_in(0.12, 0.0, config=quick).duration
    assert out_over_and_in(0.12, 0.1, config=quick).duration < 1.15 * standing
    assert out_over_and_in(0.12, 0.1, arm_only=0.2, config=quick).duration > 1.3 * standing


def test_the_last_stretch_to_a_cut_is_slow():
    goal = pose((0.0, 0.15, 0.0), (0.0, 0.0, 0.0))
    path = motion([pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), goal], slow_end=True)
    inside = pose((0.0, 0.15 - 0.9 * CONFIG.motion.slow_zone, 0.0), (0.0, 0.0, 0.0))
    assert path.cap(inside) == pytest.approx(CONFIG.motion.cut_speed)
    assert path.cap(pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))) > 0.2


@given(st.floats(0.05, 0.95), st.floats(0.0, 0.5), places)
def test_a_goal_that_moves_under_way_makes_no_jump_and_is_reached(share, later, by):
    """Also when it moves again before the first correction has been made."""
    path, dt = motion([pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), pose((0.3, 0.1, 0.0), (0.0, 0.3, 0.0))]), 1e-4
    by, goal = np.array(by) / 80.0, path.goal.translation
    whole = path.duration
    for time, part in ((share * whole, by), (min(share + later, 1.0) * whole, -0.5 * by)):
        around = []
        for step in range(-4, 5):
            if step == 1:
                path.time = time
                path.shift(part)
            around.append(at(path, time + step * dt))
        twist = np.array([state.twist[:3] for state in around])
        assert np.abs(np.diff(twist, axis=0)).max() < 1.2 * CONFIG.motion.tool_acceleration * dt
        assert np.abs(np.diff(twist, 2, axis=0)).max() < 3.0 * CONFIG.motion.tool_jerk * dt**2
        position = np.array([state.T_odom_tool.translation for state in around])
        np.testing.assert_allclose(np.diff(position, axis=0), dt * (twist[1:] + twist[:-1]) / 2, atol=1e-9)
    end = at(path, path.duration)
    np.testing.assert_allclose(end.T_odom_tool.translation, goal + 0.5 * by, atol=1e-12)
    np.testing.assert_allclose(path.goal.translation, goal + 0.5 * by, atol=1e-12)
    np.testing.assert_allclose(end.twist, 0.0, atol=1e-12)


@given(st.lists(st.tuples(places, turns), min_size=3, max_size=3), st.floats(0.3, 1.3))
def test_a_motion_that_is_extended_on_its_way_or_at_its_end_goes_on_without_a_jump(corners, share):
    corners = [pose(*corner) for corner in corners]
    path = motion(corners[:2], waits=True)
    time = share * path.duration
    before = at(path, time)
    q = np.zeros(12)
    q[5] = 2.0
    path.extend(Leg(corners[2], q, CONFIG.work.tool_speed, 0.05))
    after = at(path, time)
    np.testing.assert_allclose(after.T_odom_tool.homogeneous, before.T_odom_tool.homogeneous, atol=1e-12)
    np.testing.assert_allclose(after.twist, before.twist, atol=1e-12)
    end = at(path, path.duration)
    np.testing.assert_allclose(end.T_odom_tool.homogeneous, corners[2].homogeneous, atol=1e-9)
    np.testing.assert_allclose(end.twist, 0.0, atol=1e-12)
    assert path.done and path.posture().q[5] == pytest.approx(2.0)


def test_the_base_may_move_while_a_motion_waits_and_not_once_it_is_in_the_canes():
    there, cut = pose((0.3, 0.2, 0.1), (0, 0, 0)), pose((0.3, 0.4, 0.1), (0, 0, 0))
    path = motion([pose((0, 0, 0), (0, 0, 0)), there], waits=True)
    path.time = path.duration + 3.0
    assert path.base == "row"
    path.extend(Leg(cut, np.zeros(12), CONFIG.work.tool_speed, CONFIG.work.arm_only))
    assert path.base == "row"
    path.time = path.duration - 0.01
    assert path.base == "frozen"


def test_an_arm_that_settles_stays_as_it_is_and_the_tool_where_it_should_be():
    path = motion([pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), pose((0.3, 0.0, 0.0), (0.0, 0.2, 0.0))])
    path.time = path.duration
    before, q = path.desired(), np.arange(12.0)
    path.settle(q)
    q[5] = 99.0
    # A second time changes nothing: what is measured meanwhile would lead it on.
    path.settle(q)
    np.testing.assert_array_equal(path.posture().q, np.arange(12.0))
    assert not path.posture().rate.any() and path.posture().goal is None
    np.testing.assert_array_equal(path.desired().T_odom_tool.homogeneous, before.T_odom_tool.homogeneous)


@given(st.lists(st.tuples(places, places), min_size=2, max_size=6), st.booleans())
def test_corrections_that_are_made_stay_made_whatever_follows(shifts, frozen):
    """Uneven ground asks for many: those that have ended are kept as one."""
    level = (0.0, 0.0, 0.0)
    corners = [
        pose(*each) for each in (((0, 0, 0.8), level), ((0.3, 0.1, 0.9), (0.2, 0.0, 0.1)), ((0.6, 0, 1.0), level))
    ]
    path, plain = motion(corners, frozen), motion(corners, frozen)
    moved, driven = np.zeros(3), np.zeros(2)
    for by, base in shifts:
        path.advance(1.0, 0.0)
        before = path.desired().T_odom_tool.translation
        path.shift(0.01 * np.array(by), 0.01 * np.array(base[:2]))
        np.testing.assert_allclose(path.desired().T_odom_tool.translation, before, atol=1e-12)
        moved, driven = moved + 0.01 * np.array(by), driven + 0.01 * np.array(base[:2])
        path.time += 1.0
        np.testing.assert_allclose(
            path.desired().T_odom_tool.translation - at(plain, path.time).T_odom_tool.translation, moved, atol=1e-9
        )
        if path.posture().q[:2].any():
            np.testing.assert_allclose(path.posture().q[:2] - plain.posture().q[:2], driven, atol=1e-9)
