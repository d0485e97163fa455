import mujoco
import numpy as np
import pinocchio as pin
import pytest

from bridge.sim.robot.model import build_plant
from bridge.sim.vineyard.row import Rod, Row
from rolling_panda.model.robot import ARM_Q, RobotModel

POST = Rod("post", np.array([2.0, 0, 0]), np.array([2.0, 0, 1.9]), 0.04, 0.04)
CANE = Rod("cane", np.array([1.0, 0, 0.9]), np.array([1.0, 0, 1.9]), 0.004, 0.004)


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return RobotModel()


def posture(robot: RobotModel, seed: int) -> np.ndarray:
    q = np.zeros(12)
    q[ARM_Q] = np.random.default_rng(seed).uniform(robot.limits.lower[ARM_Q], robot.limits.upper[ARM_Q])
    return q


@pytest.mark.parametrize("seed", range(5))
def test_mass_matrix_of_the_arm_is_pinocchios(robot: RobotModel, seed: int) -> None:
    q, plant = posture(robot, seed), build_plant(Row(()))
    data = mujoco.MjData(plant.model)
    data.qpos[plant.xi_q] = q[3:]
    mujoco.mj_forward(plant.model, data)
    M = np.zeros((plant.model.nv, plant.model.nv))
    mujoco.mj_fullM(plant.model, data, M)
    expected = pin.crba(robot.model, robot.data, q)
    expected = np.triu(expected) + np.triu(expected, 1).T
    assert M[np.ix_(plant.arm_v, plant.arm_v)] == pytest.approx(expected[ARM_Q, ARM_Q], abs=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_gravity_of_the_arm_and_the_frames_are_pinocchios(robot: RobotModel, seed: int) -> None:
    q, plant = posture(robot, seed), build_plant(Row(()))
    data = mujoco.MjData(plant.model)
    data.qpos[plant.xi_q] = q[3:]
    mujoco.mj_forward(plant.model, data)
    gravity = pin.computeGeneralizedGravity(robot.model, robot.data, q)[ARM_Q]
    assert data.qfrc_bias[plant.arm_v] == pytest.approx(gravity, abs=1e-6)
    for site, frame in ((plant.tool, robot.tool_id), (plant.camera, robot.camera_id)):
        T = robot.pose(q, frame)
        assert data.site_xpos[site] == pytest.approx(T.translation, abs=1e-9)
        assert data.site_xmat[site].reshape(3, 3) == pytest.approx(T.rotation, abs=1e-9)


def test_posts_are_solid_and_canes_are_not() -> None:
    plant = build_plant(Row((POST, CANE)))
    assert int(plant.solid.sum()) == 1
