import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.control.base_path import BasePlanner
from benchmarks.control.plan_limits import plan_limits
from rolling_panda.config import RobotConfig
from rolling_panda.model.robot import RobotModel

ROBOT = RobotModel()
LIMITS = plan_limits(ROBOT, base_speed=0.8, base_yaw_rate=0.6)
PLANNER = BasePlanner(ROBOT.drive, LIMITS)
place = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.2, 3.2)).map(np.array)


def check(motion, start, goal, drive=ROBOT.drive):
    """The wheels bring the base there, exactly and within every limit."""
    pose, dt = start.copy(), LIMITS.dt
    for (left, right), expected in zip(motion.wheels, motion.poses[1:], strict=True):
        pose = drive.integrate(pose, left, right)
        assert pose == pytest.approx(expected, abs=1e-9)
    assert pose[:2] == pytest.approx(goal[:2], abs=1e-9)
    assert np.cos(pose[2] - goal[2]) == pytest.approx(1.0, abs=1e-12)
    wheels = np.vstack([[0.0, 0.0], motion.wheels / dt, [0.0, 0.0]])
    assert np.abs(wheels).max() <= ROBOT.limits.velocity[0]
    assert (np.abs(np.diff(wheels, axis=0)).max() / dt) <= ROBOT.limits.acceleration[0]
    v, w = drive.twist(wheels[:, 0], wheels[:, 1])
    assert np.abs(v).max() <= 0.8 and np.abs(w).max() <= 0.6
    assert np.abs(np.diff(v)).max() / dt <= 0.8 + 1e-9


@pytest.mark.long
@settings(max_examples=20, deadline=None)
@given(place, place)
def test_every_motion_ends_at_the_goal_within_the_limits(start, goal):
    motions = PLANNER.motions(start, goal)
    assert motions
    for motion in motions:
        check(motion, start, goal)
    times = [len(motion.wheels) for motion in motions]
    assert times == sorted(times)
    # Not slower than turning, driving and turning, up to a period for each.
    assert times[0] * LIMITS.dt <= PLANNER.duration(start, goal[None])[0] + 4 * LIMITS.dt


def test_turning_while_driving_saves_time():
    start, goal = np.zeros(3), np.array([2.0, 1.0, 0.5])
    best = PLANNER.motions(start, goal)[0]
    assert len(best.wheels) * LIMITS.dt < PLANNER.duration(start, goal[None])[0] - 0.5
    both = (np.abs(best.wheels.sum(axis=1)) > 1e-4) & (np.abs(best.wheels[:, 1] - best.wheels[:, 0]) > 1e-4)
    assert both.sum() > 20


def test_backs_up_where_that_is_quicker():
    start, goal = np.zeros(3), np.array([-1.0, 0.1, 0.0])
    best = PLANNER.motions(start, goal)[0]
    assert best.wheels.sum() < 0.0 and np.ptp(best.poses[:, 2]) < 1.0


def test_turns_on_the_spot_and_stays():
    motion = PLANNER.motions(np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, -3.0]))[0]
    check(motion, np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, -3.0]))
    assert np.ptp(motion.poses[:, 2]) == pytest.approx(2 * np.pi - 6.0)
    assert motion.travel == 0.0
    still = PLANNER.motions(np.zeros(3), np.zeros(3))[0]
    assert not still.wheels.any()


def test_via_points_are_passed_in_order():
    points = [np.zeros(3), np.array([1.0, 1.0, 1.57]), np.array([1.0, -2.0, 3.0])]
    motion = PLANNER.via(points)
    check(motion, points[0], points[-1])
    assert np.hypot(*(motion.poses[:, :2] - points[1][:2]).T).min() < 1e-9
    assert motion.travel > 4.0


def test_a_reference_point_ahead_of_the_axle():
    drive = RobotModel(RobotConfig(rho=0.2)).drive
    start, goal = np.array([0.0, 0.0, 0.3]), np.array([2.0, -1.0, -2.0])
    check(BasePlanner(drive, LIMITS).motions(start, goal)[0], start, goal, drive)
