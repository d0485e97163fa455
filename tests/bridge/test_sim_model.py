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


@pytest.mark.parametrize("hangs", [None, np.array([0.02, 0.0, -0.03])])
def test_of_last_years_cane_only_what_is_left_of_it_is_met(hangs: np.ndarray | None) -> None:
    """Its two pieces are where the robot stands: each is met as long as it is there, and a permanent cordon always."""
    low, top = np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, 0.2])
    pieces = [Rod("cordon", low, top, 0.007, 0.007, -1, 0, spur) for spur in (0, -1)]
    beyond = Rod("cordon", top, low + [0.05, 0.0, 0.0], 0.007, 0.007, 0, 0, 0)
    uncut = Row((pieces[0], beyond, pieces[1], POST))
    plant = build_plant(uncut)
    data = mujoco.MjData(plant.model)

    def met(row: Row) -> set[str]:
        plant.remove_severed(row)
        mujoco.mj_forward(plant.model, data)
        names = {plant.model.geom(int(geom)).name for pair in data.contact.geom for geom in pair}
        return {name for name in names if name.startswith("row_")}

    assert met(uncut) == {"row_cordon_0", "row_cordon_1", "row_cordon_2"}
    # What grows beyond the cut is gone at once, and a piece ends at the cut.
    assert met(uncut.sever(0, 0.4, hangs)) == {"row_cordon_0", "row_cordon_2"}
    geom = plant.model.geom("row_cordon_0")
    assert geom.pos[2] == pytest.approx(0.12) and geom.size[1] == pytest.approx(0.02)
