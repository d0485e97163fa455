import math
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
import pytest

from bridge.config import BridgeConfig, OdometryConfig
from bridge.core.attitude import BaseOrientation
from bridge.core.interface import Setpoint
from bridge.core.odometer import Odometer
from bridge.sim.robot.robot import SimulatedRobot, VelocityServos
from bridge.sim.robot.trace import TraceWriter, read
from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.world.config import PRESETS, only
from rolling_panda.config import load_section
from rolling_panda.model.base_attitude import attitude_of
from rolling_panda.model.robot import RobotModel
from rolling_panda.resources import resource
from tests.support.cameras import Blind

CONFIG = load_section(resource("assets/config/sim.toml"), "bridge", BridgeConfig)
DRIVE = RobotModel().drive


def robot(row: Row | None = None, trace: TraceWriter | None = None) -> SimulatedRobot:
    return SimulatedRobot(CONFIG, row or Row(()), Blind(), trace)


def setpoint(v: float = 0.0, omega: float = 0.0, arm: tuple[float, ...] = (0.0,) * 7) -> Setpoint:
    return Setpoint(np.array([*DRIVE.wheels(v, omega), *arm]), True, 1, 1, 0.0)


@pytest.mark.parametrize(("v", "omega"), [(0.3, 0.0), (-0.3, 0.0), (0.0, 0.6), (0.25, -0.4)])
def test_odometry_from_the_wheels_stays_with_the_true_base(v: float, omega: float) -> None:
    sim, pose, last = robot(), np.zeros(3), np.zeros(2)
    for tick in range(3000):
        ramp = min(1.0, tick / 200) if tick < 2500 else max(0.0, 1 - (tick - 2500) / 200)
        sim.write(setpoint(v * ramp, omega * ramp, (0.3 * ramp, 0.0, 0.0, 0.0, 0.2 * ramp, 0.0, 0.0)))
        wheels = sim.read().position[:2].copy()
        pose, last = DRIVE.integrate(pose, *(wheels - last)), wheels
    true = sim.true_base().pose
    metres, turn = 2.5 * abs(v), 2.5 * abs(omega)
    assert abs(true[2] - 2.5 * omega) < 0.02
    assert np.linalg.norm(true[:2] - pose[:2]) < 0.0005 + 0.002 * metres
    assert abs(true[2] - pose[2]) < np.radians(0.02 + 0.2 * turn / (np.pi / 2))


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
def test_inertial_sensors_keep_the_heading_where_wheels_slip_and_tell_how_the_base_stands(seed: int) -> None:
    config = msgspec.structs.replace(CONFIG, inertial=True)
    world = msgspec.structs.replace(PRESETS["field"], cane_modulus=0.0, slip=0.08)
    sim = SimulatedRobot(config, Row(()), Blind(), None, world, seed)
    wheels, both = Odometer(DRIVE, OdometryConfig(), 0.001), BaseOrientation(RobotModel())
    odometer = Odometer(DRIVE, OdometryConfig(), 0.001, 0, both)
    start, off, turned = np.linalg.inv(sim.true_base_rotation()), [], []
    for tick in range(9000):
        ramp = np.clip(min(tick - 1000, 8000 - tick) / 500, 0.0, 1.0)
        sway = 0.4 * math.sin(2.0 * math.pi * tick / 2000) * ramp
        sim.write(setpoint(0.25 * ramp, 0.0, (sway, 0.0, 0.0, sway, 0.0, 0.0, sway)))
        if tick % 10 == 0:
            measured = sim.read()
            odometer.follow(measured, tick * 0.001)
            wheels.follow(measured, tick * 0.001)
            true, _ = attitude_of(start @ sim.true_base_rotation(), 0.0)
            told = odometer.attitude
            assert told is not None
            off.append((told.roll - true.roll, told.pitch - true.pitch, true.roll, true.pitch))
            heading = sim.true_base().pose[2]
            turned.append((odometer.pose.phi - heading, wheels.pose.phi - heading))
    gyroscope, by_wheels = np.abs(turned).max(axis=0)
    assert gyroscope < 0.008 < by_wheels
    roll, pitch, true_roll, true_pitch = np.sqrt(np.mean(np.square(off), axis=0))
    assert max(roll, pitch) < 0.005 < 0.5 * max(true_roll, true_pitch)


def test_the_arm_holds_against_gravity_and_the_base_stays() -> None:
    sim = robot()
    before = sim.read().position.copy()
    for _ in range(5000):
        sim.write(setpoint())
    assert np.abs(sim.read().position - before).max() < 1e-4
    assert np.abs(sim.true_base().pose).max() < 1e-4


def test_the_tool_is_where_kinematics_on_the_true_base_has_it() -> None:
    sim, model = robot(), RobotModel()
    for _ in range(800):
        sim.write(setpoint(0.2, 0.2, (0.2, -0.1, 0.1, 0.2, -0.2, 0.1, 0.3)))
    q = np.concatenate([sim.true_base().pose, sim.read().position])
    assert model.pose(q, model.tool_id).translation == pytest.approx(sim.true_tool()[:3, 3], abs=2e-3)


def test_driving_into_a_post_is_a_contact_and_stops_the_base() -> None:
    sim = robot(Row((Rod("post", np.array([0.4, 0.1, 0.0]), np.array([0.4, 0.1, 1.9]), 0.04, 0.04),)))
    touched = 0
    for _ in range(1500):
        sim.write(setpoint(0.3))
        touched += sim.contacts
        assert np.abs(sim.read().velocity[:2]).max() < 3.0
    assert touched > 0
    assert sim.true_base().pose[0] < 0.25


@pytest.mark.parametrize(
    "arm",
    [
        pytest.param((2.8, 1.0, 0.0, -2.16, 0.0, 2.5, 0.0), id="tool onto the base"),
        pytest.param((0.0, 0.0, 0.0, -3.0, 0.0, 0.1, 0.0), id="tool into the upper arm"),
    ],
)
def test_the_robot_meeting_itself_is_a_contact(arm: tuple[float, ...]) -> None:
    sim, touched = robot(), 0
    for _ in range(7000):
        away = np.array(arm) - sim.read().position[2:]
        sim.write(setpoint(arm=tuple(np.clip(2.0 * away, -0.8, 0.8).tolist())))
        touched += sim.self_contacts
    assert touched > 0
    assert sim.contacts == 0


def test_a_wire_is_met_by_the_arm() -> None:
    height = robot().true_tool()[2, 3] - 0.1
    ahead = robot().true_tool()[1, 3] - 0.1
    wire = Rod("wire", np.array([-1.0, ahead, height]), np.array([1.0, ahead, height]), 0.00125, 0.00125)
    sim, touched = robot(Row((wire,))), 0
    for _ in range(2000):
        sim.write(setpoint(arm=(0.0, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0)))
        touched += sim.contacts
    assert touched > 0


@pytest.mark.parametrize(("kind", "contacts"), [("wire", True), ("cane", False)])
def test_the_trace_has_the_force_of_a_touch_also_of_a_cane_that_bends(
    tmp_path: Path, kind: Literal["wire", "cane"], contacts: bool
) -> None:
    tool = robot().true_tool()[:3, 3]
    # The tool comes through the cane; it begins clear of it, as a cane gives way to what is in it from the beginning.
    middle = tool + [0.05, -0.015, -0.15] if kind == "cane" else np.array([0.0, tool[1] - 0.1, tool[2] - 0.1])
    ends = middle - [0.4, 0.0, 0.0], middle + [0.4, 0.0, 0.0]
    rod = Rod(kind, *ends, 0.004, 0.004, vine=1, spur=2, cane=0) if kind == "cane" else Rod(kind, *ends, 0.004, 0.004)
    trace, world = TraceWriter(tmp_path / "t"), only(("cane_modulus",), "field")
    sim = SimulatedRobot(CONFIG, Row((rod,)), Blind(), trace, world)
    for _ in range(1500):
        sim.write(setpoint(arm=(0.0, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0)))
    sim.close()
    rows = read(tmp_path / "t").rows
    assert rows["touch"][:50].max() == 0.0 and rows["touch"].max() > 1.0
    assert rows["contacts"].any() == contacts


def test_a_cut_severs_what_is_between_the_blades_and_the_trace_says_so(tmp_path: Path) -> None:
    tool = robot().true_tool()
    at, across = tool[:3, 3], tool[:3, 1]
    cane = Rod("cane", at - 0.1 * across, at + 0.4 * across, 0.004, 0.003, vine=1, spur=2, cane=0)
    sim = robot(Row((cane,)), TraceWriter(tmp_path / "t"))
    sim.cut("c1", "p1")
    for _ in range(700):
        sim.write(setpoint())
    measured = sim.read()
    assert (measured.cutter, measured.cut_id, measured.outcome) == ("open", "c1", "DONE")
    assert sim.scenery()[0] == 1
    sim.close()
    loaded = read(tmp_path / "t")
    assert len(loaded.rows) == 700
    (event,) = loaded.events
    assert (event["cut_id"], event["point_id"], event["outcome"]) == ("c1", "p1", "DONE")
    assert event["severed"][0]["point"] == pytest.approx(at.tolist(), abs=1e-3)
    assert (event["severed"][0]["vine"], event["severed"][0]["spur"]) == (1, 2)


def test_a_bite_into_a_severed_cane_that_hangs_severs_nothing_by_the_trace(tmp_path: Path) -> None:
    tool = robot().true_tool()
    at, across = tool[:3, 3], tool[:3, 1]
    aside = 0.03 * tool[:3, 0]
    cane = Rod("cane", at - aside - 0.1 * across, at - aside + 0.4 * across, 0.004, 0.003, vine=1, spur=2, cane=0)
    sim = robot(Row((cane,)).sever(0, 0.1, aside), TraceWriter(tmp_path / "t"))
    sim.cut("c1", "p1")
    for _ in range(700):
        sim.write(setpoint())
    assert sim.read().outcome == "DONE" and sim.scenery()[0] == 2
    sim.close()
    (event,) = read(tmp_path / "t").events
    assert event["severed"] == []


@pytest.mark.parametrize("seed", range(4))
def test_servos_stay_calm_in_any_posture(seed: int) -> None:
    low, high = [-2.0, -1.0, -2.0, -2.6, -2.5, 0.8, -2.5], [2.0, 0.6, 2.0, -0.8, 2.5, 3.0, 2.5]
    start = tuple(float(v) for v in np.random.default_rng(seed).uniform(low, high))
    sim = SimulatedRobot(msgspec.structs.replace(CONFIG, start_arm=start), Row(()), Blind())
    arm = (0.3, -0.2, 0.3, 0.2, -0.3, 0.3, 0.3)
    for _ in range(300):
        sim.write(setpoint(arm=arm))
    assert sim.read().velocity[2:] == pytest.approx(arm, abs=0.03)
    for _ in range(300):
        sim.write(setpoint())
    assert np.abs(sim.read().velocity).max() < 0.01


def test_speed_follows_a_step_with_the_configured_lag() -> None:
    lag, inertia, dt = 0.05, np.diag([0.8]), 0.001
    servos = VelocityServos(np.array([lag]), np.array([60.0]), dt)
    speed, trail = np.zeros(1), []
    for _ in range(500):
        speed = speed + np.linalg.solve(inertia, servos.step(np.ones(1), speed, inertia)) * dt
        trail.append(float(speed[0]))
    # The area above the curve is the lag of any chain of first-order lags.
    assert abs(sum(1.0 - value for value in trail) * dt - lag) < 0.003
    assert abs(trail[-1] - 1.0) < 1e-3


def test_torque_stays_in_its_bound() -> None:
    servos = VelocityServos(np.array([0.02, 0.02]), np.array([12.0, 5.0]), 0.001)
    for _ in range(100):
        assert np.all(np.abs(servos.step(np.array([1e3, -1e3]), np.zeros(2), np.eye(2))) <= [12.0, 5.0])


@pytest.mark.parametrize(("hold_s", "gives_way"), [(math.inf, 0.05), (0.2, 0.0)])
def test_a_joint_that_holds_takes_up_a_lasting_load_and_one_that_does_not_gives_way(
    hold_s: float, gives_way: float
) -> None:
    servos, inertia, load, dt = (
        VelocityServos(np.array([0.02]), np.array([12.0]), 0.001, np.array([hold_s])),
        0.1,
        0.5,
        0.001,
    )
    speed = np.zeros(1)
    for _ in range(2000):
        speed = speed + (servos.step(np.zeros(1), speed, np.array([[inertia]])) - load) / inertia * dt
    assert float(speed[0]) == pytest.approx(-gives_way, abs=0.002)


def test_a_joint_that_holds_follows_a_step_nearly_as_one_that_does_not() -> None:
    servos = VelocityServos(np.array([0.02]), np.array([87.0]), 0.001, np.array([0.2]))
    speed, trail = np.zeros(1), []
    for _ in range(1000):
        speed = speed + servos.step(np.ones(1), speed, np.eye(1)) * 0.001
        trail.append(float(speed[0]))
    assert max(trail) < 1.06 and abs(trail[-1] - 1.0) < 0.005


@pytest.mark.parametrize(("spur", "outcome"), [(0, "DONE"), (-1, "FAILED_NOT_CUT")])
def test_what_last_years_cane_carries_is_met_no_more_once_it_is_severed(spur: int, outcome: str) -> None:
    tool = robot().true_tool()
    at, across = tool[:3, 3], tool[:3, 1]
    bow = Rod("cordon", at - 0.03 * across, at + 0.03 * across, 0.007, 0.007, -1, 0, spur)
    beyond = Rod("cordon", np.array([0.4, 0.1, 0.0]), np.array([0.4, 0.1, 0.5]), 0.007, 0.007, 0, 0, spur)
    sim = robot(Row((bow, beyond)))
    sim.cut("c1", "p1")
    for _ in range(700):
        sim.write(setpoint())
    assert sim.read().outcome == outcome
    touched = 0
    for _ in range(1500):
        sim.write(setpoint(0.3))
        touched += sim.contacts
    assert (touched > 0) == (spur < 0)
    assert (sim.true_base().pose[0] < 0.25) == (spur < 0)
