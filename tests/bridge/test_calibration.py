"""Calibrated wheels and joints: what is told and commanded agrees with the world, and nothing else has to know."""

from concurrent.futures import Future

import numpy as np
import pytest
from msgspec.structs import replace

from bridge.config import BridgeConfig
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.calibration import Calibration
from bridge.core.interface import NO_CUT, Measurement
from bridge.core.odometer import Odometer
from bridge.core.robot_time import SteppedTime
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.vineyard.row import Row
from bridge.sim.world.config import CALM
from bridge.sim.world.errors import draw_errors
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.calibration.file import Calibrated
from rolling_panda.config import load_section
from rolling_panda.messages.robot import NO_OFFSETS, ArmCalibration, BaseCalibration, FrameTiming, UseCalibration
from rolling_panda.resources import resource
from tests.support.bridge_rig import MODEL, REST, NoCamera, Parts, Rig, SimulatedPlant

DRAWN, FASTEST = MODEL.drive.sizes, float(MODEL.limits.velocity[0])
WORN = BaseCalibration(left=DRAWN.left * 0.97, right=DRAWN.right * 0.98, track=DRAWN.track * 1.02, made_at=9.0)
ARM = ArmCalibration(offsets=(0.0, 0.01, -0.02, 0.03, 0.0, -0.005, 0.0), made_at=8.0)


def measurement(wheels, speeds=(0.0, 0.0)):
    arm = [0.1] * 7
    return Measurement(np.array([*wheels, *arm]), np.array([*speeds, *arm]), "open", "", "", NO_CUT)


def test_without_a_calibration_everything_is_as_it_was():
    wheels, xi, there = Calibration(DRAWN, FASTEST), np.arange(9.0), measurement((3.0, 4.0))
    assert wheels.measured(there) is there and wheels.commanded(xi) is xi and wheels.sizes is None


def test_measured_wheels_tell_the_way_on_the_ground_and_commanded_ones_make_it():
    wheels = Calibration(DRAWN, FASTEST, Calibrated(base=WORN))
    wheels.measured(measurement((1.0, 1.0)))
    shown = wheels.measured(measurement((3.0, 4.0), (0.5, 0.7)))
    way, turn = 0.5 * (2.0 * WORN.left + 3.0 * WORN.right), (3.0 * WORN.right - 2.0 * WORN.left) / WORN.track
    assert MODEL.drive.twist(*(shown.position[:2] - 1.0)) == pytest.approx((way, turn))
    speeds = 0.5 * (0.5 * WORN.left + 0.7 * WORN.right), (0.7 * WORN.right - 0.5 * WORN.left) / WORN.track
    assert MODEL.drive.twist(*shown.velocity[:2]) == pytest.approx(speeds)
    assert shown.position[2:].tolist() == [0.1] * 7
    asked = np.array([*MODEL.drive.wheels(0.2, 0.3), *[0.2] * 7])
    left, right = wheels.commanded(asked)[:2]
    assert 0.5 * (left * WORN.left + right * WORN.right) == pytest.approx(0.2)
    assert (right * WORN.right - left * WORN.left) / WORN.track == pytest.approx(0.3)
    assert asked[:2] == pytest.approx(MODEL.drive.wheels(0.2, 0.3)), "the command itself stays"


def test_no_wheel_is_made_faster_than_its_limit_and_the_curve_stays():
    wheels = Calibration(DRAWN, FASTEST, Calibrated(base=WORN))
    left, right = wheels.commanded(np.array([FASTEST, 0.5 * FASTEST, *[0.0] * 7]))[:2]
    free = Calibration(DRAWN, 100.0, Calibrated(base=WORN)).commanded(np.array([FASTEST, 0.5 * FASTEST, *[0.0] * 7]))[
        :2
    ]
    assert free.max() > FASTEST and max(left, right) == pytest.approx(FASTEST)
    assert left / right == pytest.approx(free[0] / free[1])


def test_a_new_calibration_is_used_once_it_is_kept_and_at_rest_and_the_wheels_go_on_where_they_were():
    disk: Future[None] = Future()
    kept = []
    wheels = Calibration(DRAWN, FASTEST, keep=lambda base: kept.append(base) or disk)
    before = wheels.measured(measurement((50.0, 70.0))).position
    assert wheels.request(WORN) is None and kept == [WORN]
    assert wheels.request(WORN).code == "calibration_under_way"
    assert wheels.kept(at_rest=True) is None and wheels.base is None
    disk.set_result(None)
    assert wheels.kept(at_rest=False) is None and wheels.base is None
    assert wheels.kept(at_rest=True).code == "base_calibration_used" and wheels.base == WORN
    assert wheels.measured(measurement((50.0, 70.0))).position[:2] == pytest.approx(before[:2]), "no jump"
    assert wheels.kept(at_rest=True) is None


def test_what_is_implausible_or_cannot_be_kept_leaves_the_old_one():
    failed: Future[None] = Future()
    failed.set_exception(OSError(28, "No space left on device"))
    old = replace(WORN, left=DRAWN.left * 0.99, right=DRAWN.right * 0.99)
    wheels = Calibration(DRAWN, FASTEST, Calibrated(old, ARM), keep=lambda each: failed)
    assert wheels.request(replace(WORN, left=DRAWN.left * 0.94)).code == "calibration_of_other_wheels"
    assert wheels.request(replace(WORN, right=DRAWN.right * 1.02)).code == "calibration_of_other_wheels"
    assert wheels.request(WORN) is None
    told = wheels.kept(at_rest=True)
    assert told.code == "calibration_not_kept" and dict(told.values)["cause"] == "No space left on device"
    assert wheels.base == old
    assert wheels.request(ARM) is None and wheels.kept(at_rest=True).code == "calibration_not_kept"
    assert wheels.arm == ARM


def test_offsets_are_taken_from_the_joints_angles_and_from_nothing_else():
    calibration = Calibration(DRAWN, FASTEST, Calibrated(arm=ARM))
    shown = calibration.measured(measurement((3.0, 4.0), (0.5, 0.7)))
    assert shown.position.tolist() == pytest.approx([3.0, 4.0, *(0.1 - np.array(ARM.offsets))])
    assert shown.velocity.tolist() == pytest.approx([0.5, 0.7, *[0.1] * 7])
    assert calibration.own_angles(shown.position[2:]) == pytest.approx(np.full(7, 0.1))
    xi = np.arange(9.0)
    assert calibration.commanded(xi) is xi and calibration.sizes is None


def test_base_and_arm_are_calibrated_one_after_the_other_and_each_stays():
    disks: list[Future[None]] = [Future(), Future()]
    left = list(disks)
    calibration = Calibration(DRAWN, FASTEST, keep=lambda each: left.pop(0))
    assert calibration.joint_offsets == NO_OFFSETS and calibration.request(ARM) is None
    assert calibration.request(WORN).code == "calibration_under_way"
    disks[0].set_result(None)
    assert calibration.kept(at_rest=False) is None and calibration.arm is None
    told = calibration.kept(at_rest=True)
    assert told.code == "arm_calibration_used" and dict(told.values)["change"] == pytest.approx(np.degrees(0.03))
    assert calibration.request(WORN) is None
    disks[1].set_result(None)
    assert calibration.kept(at_rest=True).code == "base_calibration_used"
    assert (calibration.base, calibration.arm, calibration.joint_offsets) == (WORN, ARM, ARM.offsets)
    shown = calibration.measured(measurement((50.0, 70.0)))
    assert shown.position[2:] == pytest.approx(0.1 - np.array(ARM.offsets))


def test_the_cameras_delay_is_used_once_it_is_kept_and_leaves_wheels_and_joints_as_they_were():
    disk: Future[None] = Future()
    calibration = Calibration(DRAWN, FASTEST, Calibrated(WORN, ARM), keep=lambda each: disk)
    timing = FrameTiming(delay=0.038, made_at=5.0)
    assert calibration.request(timing) is None and calibration.timing is None
    disk.set_result(None)
    told = calibration.kept(at_rest=True)
    assert told.code == "timing_calibration_used" and dict(told.values)["delay"] == pytest.approx(38.0)
    assert (calibration.base, calibration.arm, calibration.timing) == (WORN, ARM, timing)
    assert Calibration(DRAWN, FASTEST, Calibrated(timing=timing)).timing == timing, "of an earlier start"


DAY_S = 86400.0
TIMING = FrameTiming(delay=0.038, made_at=7.0)


def test_calibrations_are_old_after_ninety_days_each_for_itself_and_a_new_one_is_not():
    disk: Future[None] = Future()
    disk.set_result(None)
    calibration = Calibration(DRAWN, FASTEST, Calibrated(WORN, ARM, TIMING), keep=lambda each: disk)
    assert calibration.warnings(7.0 + 90 * DAY_S) == ()
    assert calibration.warnings(7.5 + 90 * DAY_S) == (reasons.timing_calibration_old(90.0),)
    assert calibration.warnings(8.5 + 90 * DAY_S) == (
        reasons.arm_calibration_old(90.0),
        reasons.timing_calibration_old(90.0),
    )
    late = 9.0 + 100.9 * DAY_S
    assert calibration.warnings(late) == (
        reasons.base_calibration_old(100.0),
        reasons.arm_calibration_old(100.0),
        reasons.timing_calibration_old(100.0),
    )
    assert calibration.request(replace(ARM, made_at=late)) is None
    assert calibration.kept(at_rest=True).code == "arm_calibration_used"
    assert [each.code for each in calibration.warnings(late)] == ["base_calibration_old", "timing_calibration_old"]
    assert Calibration(DRAWN, FASTEST).warnings(late) == (), "the drawing has no age"


def true_wheels(errors):
    return BaseCalibration(
        left=DRAWN.left * errors.wheels[0], right=DRAWN.right * errors.wheels[1], track=DRAWN.track * errors.track
    )


@pytest.mark.long
def test_a_robot_with_other_wheels_goes_where_its_odometry_says_once_it_is_calibrated():
    world, seed = replace(CALM, wheel_error=0.03), 6
    config = load_section(resource("assets/config/sim.toml"), "bridge", BridgeConfig)
    exact = replace(config, odometry=replace(config.odometry, position_noise=0.0, heading_noise=0.0))
    plant = SimulatedPlant(SimulatedRobot(exact, Row(()), NoCamera(), world=world, seed=seed))

    def start() -> BridgeCore:
        return BridgeCore(plant, exact, MODEL.limits, Odometer(MODEL.drive, exact.odometry, TICK_S), "sim")

    rig = Rig(Parts(start, plant, lambda: SteppedTime(0.0, TICK_S), real=False, close=plant.robot.close))
    curve = (*MODEL.drive.wheels(0.2, 0.3), *[0.0] * 7)

    def drive() -> tuple[float, float]:
        """Error of odometry and of the commanded way, as shares of the turn and of the way."""
        rig.run(0.3, REST)
        before, told = plant.robot.true_base().pose, odometry(rig)
        rig.run(3.0, curve)
        rig.run(0.8, REST)
        turned = plant.robot.true_base().pose[2] - before[2]
        return abs((odometry(rig).phi - told.phi) / turned - 1.0), abs(turned / (0.3 * 3.0) - 1.0)

    raw = drive()
    assert raw[0] > 0.008, "the drawing is wrong by as much"
    rig.run(0.3, curve)
    used = UseCalibration(user="ada", base=true_wheels(draw_errors(world, seed)))
    assert rig.core.on_calibration(used).reason.code == "calibration_in_motion" and rig.state.base is None
    rig.run(0.8, REST)
    assert rig.core.on_calibration(used).ok
    rig.run(0.1, REST)
    assert rig.state.base == used.base and "base_calibration_used" in [
        event.reason.code for out in rig.outputs for event in out.events
    ]
    calibrated = drive()
    assert calibrated[0] < 0.002 and calibrated[1] < raw[1]
    assert not plant.breaches()
    rig.close()


def odometry(rig) -> m.PlanarPose:
    return next(out.odometry for out in reversed(rig.outputs) if out.odometry).pose
