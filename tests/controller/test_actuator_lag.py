import numpy as np
import pytest

from controller.planning.rollout import ActuatorLag
from rolling_panda.config import RobotConfig
from rolling_panda.model.differential_drive import NXI
from rolling_panda.model.robot import RobotModel

DRIVE = RobotModel(RobotConfig()).drive


def test_a_joint_ends_behind_its_command_by_the_lag_times_its_speed():
    servos = ActuatorLag(DRIVE, np.zeros(12), 0.05, 0.02, 0.01)
    command = np.zeros(NXI)
    command[4] = 0.5
    for _ in range(100):
        servos.step(command)
    assert servos.xi[4] == pytest.approx(0.5)
    assert servos.q[3 + 4] == pytest.approx(0.5 * (1.0 - 0.02), abs=1e-6)


def test_equal_wheels_drive_straight_on_and_without_lag_at_once():
    servos = ActuatorLag(DRIVE, np.zeros(12), 0.0, 0.0, 0.01)
    command = np.zeros(NXI)
    command[:2] = 1.0
    for _ in range(100):
        servos.step(command)
    np.testing.assert_allclose(servos.q[:3], (DRIVE.wheel_radius, 0.0, 0.0), atol=1e-9)
