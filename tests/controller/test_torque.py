import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from controller.config import ControllerConfig
from controller.motion.torque import torque_report
from controller.whole_body.dynamics import Dynamics
from rolling_panda.errors import InputError
from rolling_panda.model.robot import ARM_XI, RobotModel

ROBOT = RobotModel()
HOME = np.array(ControllerConfig().work.home)
STRETCHED = np.array([0.0, 1.57, 0.0, -0.07, 0.0, 1.6, 0.0])


def motion(start, joint, reach, duration, base=0.0, samples=400):
    """A rest-to-rest quintic of one arm joint, an index of ξ, from a posture."""
    t = np.linspace(0.0, duration, samples)
    s = t / duration
    xi, q = np.zeros((samples, 9)), np.zeros((samples, 12))
    q[:, 5:] = start
    q[:, 3 + joint] += reach * (10 * s**3 - 15 * s**4 + 6 * s**5)
    xi[:, joint] = reach / duration * 30 * s**2 * (1 - s) ** 2
    xi[:, :2] = base
    q[:, 0] = 0.13375 * base * t
    return t, q, xi


def test_standing_still_costs_gravity_alone():
    t = np.linspace(0.0, 1.0, 5)
    q = np.tile([0.0] * 5 + list(STRETCHED), (5, 1))
    report = torque_report(ROBOT, t, q, np.zeros((5, 9)))
    gravity = np.abs(Dynamics(ROBOT).terms(q[0], np.zeros(9)).G)
    assert [joint.peak for joint in report.joints] == pytest.approx(gravity, abs=1e-9)
    assert [joint.limit for joint in report.joints[2:]] == [87.0] * 4 + [12.0] * 3
    assert report.feasible
    assert report.tightest.joint == "panda_joint2"


def test_a_calm_motion_is_feasible_and_the_same_one_in_a_fortieth_of_the_time_is_not():
    calm = torque_report(ROBOT, *motion(HOME, 5, 0.6, 2.0))
    rushed = torque_report(ROBOT, *motion(HOME, 5, 0.6, 0.05))
    assert calm.feasible
    assert not rushed.feasible
    joint = next(joint for joint in rushed.joints if joint.joint == "panda_joint4")
    assert joint.margin == pytest.approx(87.0 - joint.peak)
    assert joint.margin < 0.0
    # A quintic accelerates hardest at 21 % and at 79 % of its time.
    assert min(abs(joint.at / 0.05 - 0.21), abs(joint.at / 0.05 - 0.79)) < 0.03


def test_torques_of_a_motion_do_the_work_that_its_energy_shows():
    t, q, xi = motion(HOME, 3, 0.8, 1.0, base=2.0)
    dynamics = Dynamics(ROBOT)
    acceleration = np.gradient(xi, t, axis=0)
    power = [float(dynamics.inverse(q_s, xi_s, a_s) @ xi_s) for q_s, xi_s, a_s in zip(q, xi, acceleration, strict=True)]
    energy = [dynamics.energy(q_s, xi_s) for q_s, xi_s in zip(q, xi, strict=True)]
    np.testing.assert_allclose(cumulative_trapezoid(power, t, initial=0.0), np.array(energy) - energy[0], atol=2e-3)
    peaks = {joint.joint: joint for joint in torque_report(ROBOT, t, q, xi).joints}
    assert peaks["panda_joint2"].peak == pytest.approx(
        max(abs(dynamics.inverse(*s)[ARM_XI][1]) for s in zip(q, xi, acceleration, strict=True))
    )


@pytest.mark.parametrize("spoil", ["times", "shape", "nan", "single"])
def test_what_is_no_motion_is_refused(spoil):
    t, q, xi = motion(HOME, 5, 0.6, 2.0)
    if spoil == "times":
        t[3] = t[2]
    elif spoil == "shape":
        q = q[:, :9]
    elif spoil == "nan":
        xi[7, 3] = np.nan
    else:
        t, q, xi = t[:1], q[:1], xi[:1]
    with pytest.raises(InputError):
        torque_report(ROBOT, t, q, xi)
