import numpy as np
import pytest

from controller.whole_body.task import ActuatorTask, IkProblem, Posture
from rolling_panda.model.robot import ARM_XI
from tests.support.driven_base import ROBOT, DrivenBase


@pytest.fixture(scope="module")
def fast():
    return DrivenBase(1000.0, 50.0, knows="truth").run()


def test_the_base_is_told_something_new_only_in_its_own_periods(fast):
    changed = np.any(np.diff([xi[:2] for xi in fast.record], axis=0) != 0.0, axis=1)
    at = np.flatnonzero(changed) + 1
    assert len(at) > 50
    assert not np.any(at % fast.every)


def test_the_arm_does_not_notice_which_periods_are_the_base_s(fast):
    """Its acceleration changes in a period of the base by no more than what the others change by, as good as."""
    arm = np.array(fast.record)[:, ARM_XI]
    change = np.abs(np.diff(arm, 2, axis=0)).max(axis=1)
    due = (np.arange(len(change)) + 2) % fast.every == 0
    assert np.quantile(change[due], 0.95) < 3.0 * np.quantile(change[~due], 0.95) + 1e-6
    jerk = np.diff(arm, 2, axis=0) / fast.dt**2
    assert (np.abs(jerk) <= ROBOT.limits.jerk[ARM_XI] * 0.5 * (1 + 1e-6)).all()


def jogged(xi, seconds):
    """The actuators' own velocities at 1 kHz and 50 Hz, for a while."""
    drive = DrivenBase(1000.0, 50.0)
    for _ in range(round(seconds * 1000)):
        robot = drive.observed()
        problem = IkProblem(robot.q, robot.kinematics, robot.sent, ActuatorTask(xi), Posture(robot.q), "free")
        out = drive.method.solve(problem)
        assert out.feasible
        drive.take(out.xi)
    return drive


def test_the_base_speeds_up_as_fast_as_it_may_over_periods_of_its_own():
    drive = jogged(np.array([2.0, 2.0, *[0.0] * 7]), 0.2)
    speed = [ROBOT.drive.twist(*xi[:2])[0] for xi in drive.record]
    np.testing.assert_allclose(np.diff(speed[::20]), drive.config.whole_body.base_acceleration * 0.02, rtol=0.01)


def test_the_tool_keeps_to_its_path(fast):
    assert max(fast.errors) < 0.001


def test_the_arm_makes_good_what_the_base_owes():
    """At one rate as well: told how fast the wheels turn, the tool keeps to its path."""
    trusting, told = (max(DrivenBase(100.0, 100.0, knows=knows).run().errors) for knows in ("told", "truth"))
    assert told < 0.6 * trusting
    assert told < 0.005


def test_a_joint_is_moved_between_the_base_s_periods_too():
    drive = jogged(np.array([0.0, 0.0, 0.2, *[0.0] * 6]), 0.1)
    assert drive.sent[2] == pytest.approx(0.2, abs=1e-6)
    assert not drive.q[:3].any()


def test_a_speed_that_is_no_number_brakes_the_robot():
    drive = DrivenBase(1000.0, 50.0)
    drive.sent = drive.before = np.full(9, 0.01)
    robot = drive.observed()
    drive.method.start_period(drive.sent, drive.before, np.array([np.nan, 0.0]))
    problem = IkProblem(robot.q, robot.kinematics, robot.sent, ActuatorTask(np.full(9, 0.01)), Posture(robot.q), "free")
    out = drive.method.solve(problem)
    assert not out.feasible
    assert (np.abs(out.xi) < 0.01).all()
