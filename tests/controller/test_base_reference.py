import numpy as np
import pytest

from controller.whole_body.task import IkProblem, Posture, ToolTask
from controller.whole_body.tasks.base_reference import BaseReference
from rolling_panda.model.robot import RobotModel

ROBOT = RobotModel()
SPEED = np.array([0.3, 0.2, *[1.0] * 7])
TASK = BaseReference(1.0, 1.0, 1.0, 0.8, SPEED)


def wanted(q, reference, rate, base="row"):
    """[v, φ̇] that the task asks for; NaN where it asks for nothing."""
    J, t = np.zeros((2, 9)), np.zeros(2)
    problem = IkProblem(q, ROBOT.kinematics(q), np.zeros(9), ToolTask(np.zeros(6)), Posture(reference, rate), base)
    TASK.write(problem, J, t)
    return np.array([t[i] / J[i, i] if J[i, i] else np.nan for i in (0, 1)])


@pytest.mark.parametrize("offset", [(0.0, 0.2, 0.0), (-0.1, -0.15, 0.4), (0.05, 0.1, -0.5)])
def test_a_base_beside_its_moving_reference_comes_back_to_it(offset):
    q, dt, rate = np.zeros(12), 0.02, np.zeros(12)
    q[:3] = offset
    reference = np.zeros(12)
    rate[0] = 0.15
    for _ in range(2000):
        v, omega = wanted(q, reference, rate)
        assert abs(v) <= 0.3 and abs(omega) <= 0.2
        left, right = ROBOT.drive.wheels(v, omega)
        q[:3] = ROBOT.drive.integrate(q[:3], left * dt, right * dt)
        reference = reference + rate * dt
    np.testing.assert_allclose(q[:3], reference[:3], atol=0.01)


def test_what_is_asked_for_depends_on_the_mode():
    q, reference, rate = np.zeros(12), np.zeros(12), np.zeros(12)
    reference[:3] = 0.1, 0.0, 0.1
    v, omega = wanted(q, reference, rate, "row")
    assert v == pytest.approx(0.1) and omega > 0.05
    assert np.isnan(wanted(q, reference, rate, "transit")).all()
    free = wanted(q, reference, rate, "free")
    assert np.isnan(free[0]) and free[1] == pytest.approx(omega)
