"""Elastic canes: forces as of a beam, canes that spring back, and what the arm's estimate makes of them."""

import math

import numpy as np
import pytest

from bridge.config import BridgeConfig
from bridge.core.interface import Setpoint
from bridge.sim.robot.model import STEP_S
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.world.canes import Canes
from bridge.sim.world.config import CALM, WorldConfig
from rolling_panda.config import load_section
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.resources import resource
from tests.support.cameras import Blind

CONFIG = load_section(resource("assets/config/sim.toml"), "bridge", BridgeConfig)
MODULUS, RADIUS = 6.5e9, 0.004


def cane(*, at: tuple[float, float] = (0.0, 0.0), length: float = 1.0, foot: float = 0.0) -> list[Rod]:
    """An upright cane of ten rods."""
    ends = [np.array([*at, foot + length * k / 10]) for k in range(11)]
    return [Rod("cane", ends[k], ends[k + 1], RADIUS, RADIUS, k - 1, 0, 0, 0) for k in range(10)]


def forces(canes: Canes, row: Row, radius: float, offsets: list[float], height: float) -> list[float]:
    """Force along x on a sphere that is led to these places along x."""
    out = []
    for x in offsets:
        pushes = canes.push(row, np.array([[x, 0.0, height]]))
        out.append(sum(float(push.force[0]) for push in pushes))
    return out


@pytest.mark.parametrize("height", [0.15, 0.3, 0.6])
def test_a_cane_pushes_back_like_a_beam_held_at_its_foot(height: float) -> None:
    canes, row = Canes(MODULUS, np.array([0.02]), STEP_S), Row(tuple(cane()))
    # From beside it by 10 mm into it, slowly.
    way = [-0.03 + 0.016 * k / 400 for k in range(400)] + [-0.014] * 200
    stiffness = 3 * MODULUS * math.pi * RADIUS**4 / 4 / height**3
    pushed = forces(canes, Row(tuple(cane())), 0.02, way, height)
    assert pushed[0] == 0.0
    assert pushed[-1] == pytest.approx(-stiffness * 0.010, rel=0.05)
    assert row.revision == 0


def test_it_bends_farther_than_the_part_is_thick_and_springs_back() -> None:
    canes, row = Canes(MODULUS, np.array([0.02]), STEP_S), Row(tuple(cane()))
    pushed = forces(canes, row, 0.02, [-0.03 + 0.13 * k / 1000 for k in range(1000)], 0.6)
    assert pushed[-1] < -0.5, "it is still before the part, 100 mm from where it stood"
    assert min(pushed) > -20.0
    away = forces(canes, row, 0.02, [-0.2] * 500, 0.6)
    assert away[-1] == 0.0
    again = forces(canes, row, 0.02, [-0.03, -0.022], 0.6)
    assert again[-1] > -1.0, "it stands where it stood"


def test_wood_yields_at_its_strength() -> None:
    canes, row = Canes(MODULUS, np.array([0.02]), STEP_S), Row(tuple(cane()))
    pushed = forces(canes, row, 0.02, [-0.03 + 0.1 * k / 1000 for k in range(1000)], 0.15)
    second = math.pi * RADIUS**4 / 4
    assert min(pushed) == pytest.approx(-80e6 * second / (RADIUS * 0.15), rel=0.05)


def robot(rods: list[Rod], world: WorldConfig = CALM) -> SimulatedRobot:
    return SimulatedRobot(CONFIG, Row(tuple(rods)), Blind(), None, world)


def turn(sim: SimulatedRobot, steps: int, speed: float = 0.2) -> list[float]:
    """Turn joint 1; the forces that the row put on the robot (N)."""
    felt = []
    for _ in range(steps):
        arm = np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        sim.write(Setpoint(arm, True, 1, 1, 0.0))
        felt.append(sim.true_touch()[0])
    return felt


def before_the_cutter(away: float) -> tuple[np.ndarray, np.ndarray]:
    """A place so far (m) from the middle of the cutter's handle, where joint 1 turns it to, and that direction."""
    sim = robot([])
    tool = sim.true_tool()
    turn(sim, 200)
    ahead = sim.true_tool()[:3, 3] - tool[:3, 3]
    ahead /= np.linalg.norm(ahead)
    return tool[:3, 3] - 0.08 * tool[:3, 2] + away * ahead, ahead


@pytest.mark.parametrize(("modulus", "pushes"), [(0.0, False), (6.5, True)])
def test_the_arm_meets_canes_only_where_they_are_elastic(modulus: float, pushes: bool) -> None:
    place, _ = before_the_cutter(0.06)
    rods = cane(at=(float(place[0]), float(place[1])), foot=float(place[2]) - 0.25, length=0.6)
    sim = robot(rods, WorldConfig(cane_modulus=modulus))
    felt = turn(sim, 1500)
    assert (max(felt) > 1.0) == pushes
    assert max(felt) < 100.0


def test_the_estimate_of_external_torques_is_that_of_the_force_with_an_offset() -> None:
    (x, y, _), ahead = before_the_cutter(0.1)
    post = Rod("post", np.array([x, y, 0.0]), np.array([x, y, 2.0]), 0.04, 0.04)
    sim, model = robot([post]), RobotModel()
    turn(sim, 100, 0.0)
    offset = sim.read().external_torque
    assert offset is not None and 0.0 < np.abs(offset).max() < 3.0
    assert any(turn(sim, 1, 0.3)[0] > 10.0 for _ in range(2000))
    turn(sim, 40, 0.3)
    felt = sim.true_touch()[0]
    assert felt > 10.0, "it presses on the post"
    torque = sim.read().external_torque
    assert torque is not None
    q = np.concatenate([sim.true_base().pose, sim.read().position])
    J = model.kinematics(q).J[:3, ARM_Q]
    force = np.linalg.lstsq(J.T, torque - offset, rcond=None)[0]
    assert force @ ahead < -0.4 * felt, "back from the post"
    assert np.linalg.norm(force) < 2.0 * felt
