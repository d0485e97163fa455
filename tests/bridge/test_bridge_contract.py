"""What every bridge keeps, judged by its plant: a factory a robot, the same tests for each."""

import math
import random
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from msgspec.structs import replace

from bridge.config import BridgeConfig
from bridge.core.attitude import BaseOrientation
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.odometer import Odometer
from bridge.core.robot_time import RealTime, SteppedTime
from bridge.core.validator import HELD, OLD_EPOCH, OLD_SEQUENCE, TOO_OLD, UNKNOWN_EPOCH
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.vineyard.row import Row
from bridge.sim.world.config import CALM
from rolling_panda import messages as m
from rolling_panda.config import load_section
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.reasons import said
from rolling_panda.resources import resource
from tests.support.bridge_rig import FORWARD, MODEL, REST, NoCamera, Parts, Rig, SimulatedPlant
from tests.support.extras import need

#: Pictures a second of a flawed robot that moves.
FLAWED_HZ = 8.0
#: By how much pictures are exposed later than their times tell (s), and the share of its turn that a base slides.
LATE_S, SLIDES = 0.15, 0.2
#: On an arc, with the arm turning too; and straight on, fast enough for a late picture to be elsewhere (60 mm).
ARC = (*MODEL.drive.wheels(0.1, 0.5), 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1)
FAST = (*MODEL.drive.wheels(0.4, 0.0), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def simulated(flawed: bool = False, offset: float = 0.0) -> Parts:
    """The simulated bridge; `flawed` as of `flawed_rig`, `offset` is the configured time offset of pictures (s)."""
    config = replace(load_section(resource("assets/config/sim.toml"), "bridge", BridgeConfig), inertial=True)
    world = CALM
    if flawed:
        # Of this seed the wheels are smaller than drawn, and farther apart.
        config = replace(config, camera_moving_hz=FLAWED_HZ, frame_time_offset=offset)
        world = replace(CALM, frame_delay=LATE_S, wheel_error=0.1)
    camera = NoCamera()
    plant = SimulatedPlant(SimulatedRobot(config, Row(()), camera, world=world, seed=1), camera)

    def start() -> BridgeCore:
        odometer = Odometer(MODEL.drive, config.odometry, TICK_S, 0, BaseOrientation(RobotModel()))
        return BridgeCore(plant, config, MODEL.limits, odometer, "sim")

    return Parts(start, plant, lambda: SteppedTime(0.0, TICK_S), real=False, close=plant.robot.close)


def real(flawed: bool = False, offset: float = 0.0) -> Parts:
    """The same with the real one."""
    need("real")
    from tests.support.real_rig import CONFIG, RealPlant

    if flawed:
        plant = RealPlant(replace(CONFIG, camera_moving_hz=FLAWED_HZ, frame_time_offset=offset), LATE_S, SLIDES)
    else:
        plant = RealPlant()
    return Parts(plant.start, plant, lambda: RealTime(time.monotonic(), TICK_S), real=True, close=plant.close)


EACH = [simulated, pytest.param(real, marks=pytest.mark.paced)]


@pytest.fixture(params=EACH)
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    factory: Callable[[], Parts] = request.param
    rig = Rig(factory())
    yield rig
    rig.close()


@pytest.fixture(params=EACH)
def flawed_rig(request: pytest.FixtureRequest) -> Iterator[Callable[[float], Rig]]:
    """A robot whose pictures are late by `LATE_S`, and whose base turns by less than its wheels tell.

    It takes the configured time offset of pictures (s).
    """
    factory: Callable[[bool, float], Parts] = request.param
    rigs: list[Rig] = []

    def start(offset: float) -> Rig:
        rigs.append(Rig(factory(True, offset)))
        rigs[-1].plant.stream()
        return rigs[-1]

    yield start
    for rig in rigs:
        rig.close()


def stop(stop_id: str = "s1") -> m.StopRequest:
    return m.StopRequest(stop_id=stop_id, source="page", user="ada", reason=said("button"))


def release(stop_id: str = "s1") -> m.ReleaseStop:
    return m.ReleaseStop(stop_id=stop_id, user="ada", reason="checked")


@pytest.mark.alone  # It counts what comes in real time.
def test_telemetry_comes_at_its_rates_with_growing_sequences(rig: Rig) -> None:
    rig.run(2.0, REST)
    # A real bridge that the machine holds up skips its steps, and the messages that were due in them.
    told_s = 2.0 - rig.skipped_s
    joints = [out.joints.sequence for out in rig.outputs if out.joints]
    odometry = [out.odometry.sequence for out in rig.outputs if out.odometry]
    frames = [out.frame.sequence for out in rig.outputs if out.frame]
    assert len(joints) == pytest.approx(100 * told_s, abs=6)
    assert len(odometry) == pytest.approx(50 * told_s, abs=4)
    assert len([out for out in rig.outputs if out.state]) == pytest.approx(20 * told_s + 1, abs=5)
    assert len(frames) >= 2
    for sequences in (joints, odometry, frames):
        assert sequences == sorted(set(sequences))


def test_base_and_arm_follow_and_the_telemetry_says_what_they_do(rig: Rig) -> None:
    def told() -> bool:
        joints = next(out.joints for out in reversed(rig.outputs) if out.joints)
        odometry = next(out.odometry for out in reversed(rig.outputs) if out.odometry)
        told = joints.velocity == pytest.approx(FORWARD, abs=0.1)
        return told and odometry.linear == pytest.approx(0.2, abs=0.02)

    rig.drive_on()
    assert rig.until(told, FORWARD)
    odometry = next(out.odometry for out in reversed(rig.outputs) if out.odometry)
    assert odometry.pose.x > 0.1
    assert not rig.state.watchdog
    assert rig.plant.breaches() == []


def test_how_the_base_stands_is_told_with_the_odometry_and_each_picture(rig: Rig) -> None:
    rig.run(1.0, REST)
    told = [out.odometry.attitude for out in rig.outputs if out.odometry]
    told += [out.frame.attitude for out in rig.outputs if out.frame]
    assert len(told) > 10
    for attitude in told:
        assert attitude is not None
        assert (attitude.height, attitude.roll, attitude.pitch) == pytest.approx((0.0, 0.0, 0.0), abs=2e-3)


@pytest.mark.alone  # What is beside it delays samples and pictures.
@pytest.mark.long
def test_the_heading_is_that_of_the_gyroscope_where_the_base_turns_otherwise_than_its_wheels(
    flawed_rig: Callable[[float], Rig],
) -> None:
    rig = flawed_rig(0.0)
    # At rest the gyroscope's bias becomes known.
    rig.run(1.0, REST)
    assert rig.until(lambda: measured(rig), REST, 15.0)

    def driven() -> bool:
        return rig.plant.heading() > 1.2

    assert rig.until(driven, ARC, 15.0)
    rig.run(0.3, REST)
    assert rig.until(rig.at_rest, REST)
    rig.run(1.0, REST)
    turned = rig.plant.heading()
    joints = [out.joints.position[:2] for out in rig.outputs if out.joints]
    by_wheels = MODEL.drive.twist(*(np.array(joints[-1]) - joints[0]).tolist())[1]
    other = by_wheels - turned
    assert other > 0.07
    # While a machine that is held up reads no sample, the base turns as its wheels say.
    odometry = next(out.odometry for out in reversed(rig.outputs) if out.odometry)
    assert abs(odometry.pose.phi - turned) < 0.25 * other and measured(rig)
    told = len(pictures(rig))
    assert rig.until(lambda: len(pictures(rig)) > told + 1, REST)
    assert abs(pictures(rig)[-1].base.phi - turned) < 0.25 * other


def measured(rig: Rig) -> bool:
    """Whether the newest odometry tells that the gyroscope turns it."""
    odometry = next(out.odometry for out in reversed(rig.outputs) if out.odometry)
    return odometry.attitude is not None and odometry.attitude.measured


def pictures(rig: Rig) -> list[CameraFrame]:
    return [out.frame for out in rig.outputs if out.frame]


def place(rig: Rig, at: float) -> Array:
    """Where the odometry has the base (x, y in m) at a time (s)."""
    told = [out.odometry for out in rig.outputs if out.odometry]
    stamps = [each.header.stamp for each in told]
    assert stamps[0] <= at <= stamps[-1]
    return np.array([np.interp(at, stamps, [getattr(each.pose, axis) for each in told]) for axis in ("x", "y")])


def late_pictures(rig: Rig) -> tuple[float, float]:
    """Drive, and see what the next pictures tell: medians over them.

    Each tells the place that the odometry has for its own time. A machine that is held up takes steps that it has
    missed later or not at all, and a picture between them tells a time beside its own.

    Returns:
        By how much later they were exposed than they tell (s), and how far from where they tell (m).
    """
    begun = len(pictures(rig))
    assert rig.until(lambda: not rig.at_rest(), FAST)
    assert rig.until(lambda: len(pictures(rig)) >= begun + 9, FAST, 15.0)
    # Odometry is told later than it is true.
    rig.run(0.3, REST)
    assert rig.until(rig.at_rest, REST)
    late, off = [], []
    for frame in pictures(rig)[begun + 2 :]:
        told, true = frame.header.stamp, rig.plant.exposed_at(frame)
        base = np.array([frame.base.x, frame.base.y])
        assert base == pytest.approx(place(rig, told), abs=0.01)
        late.append(true - told)
        off.append(float(np.linalg.norm(place(rig, true) - base)))
    return float(np.median(late)), float(np.median(off))


def near(rig: Rig) -> tuple[float, float]:
    """How near to their exposure pictures tell their time (s) and place (m); a real bridge is late where it is busy."""
    return (0.04, 0.02) if rig.parts.real else (0.006, 0.004)


@pytest.mark.alone  # What is beside it delays samples and pictures.
@pytest.mark.long
def test_a_picture_tells_when_it_was_exposed_and_where_the_base_was_then(rig: Rig) -> None:
    rig.plant.stream()
    rig.run(0.3, REST)
    late, off = late_pictures(rig)
    time_s, way = near(rig)
    assert abs(late) < time_s and off < way


@pytest.mark.alone  # What is beside it delays samples and pictures.
@pytest.mark.long
def test_a_late_picture_tells_when_it_was_exposed_once_the_delay_is_calibrated(
    flawed_rig: Callable[[float], Rig],
) -> None:
    rig = flawed_rig(0.0)
    rig.run(0.3, REST)
    late, off = late_pictures(rig)
    time_s, way = near(rig)
    assert late == pytest.approx(LATE_S, abs=time_s), "as the camera's clock has it"
    assert off > 2.0 * way
    new = m.FrameTiming(delay=LATE_S, made_at=5.0)
    assert rig.core.on_calibration(m.UseCalibration(user="ada", timing=new)).ok
    assert rig.until(lambda: rig.state.timing == new, REST)
    late, off = late_pictures(rig)
    assert abs(late) < time_s and off < way


@pytest.mark.alone  # What is beside it delays samples and pictures.
@pytest.mark.long
def test_a_late_picture_tells_when_it_was_exposed_where_the_offset_is_configured(
    flawed_rig: Callable[[float], Rig],
) -> None:
    rig = flawed_rig(LATE_S)
    rig.run(0.3, REST)
    late, off = late_pictures(rig)
    assert {frame.delay for frame in pictures(rig)} == {LATE_S}
    time_s, way = near(rig)
    assert abs(late) < time_s and off < way


def test_calibrated_wheels_turn_as_the_ground_needs_and_the_odometry_tells_the_way(rig: Rig) -> None:
    drawn = MODEL.drive.sizes
    larger = m.BaseCalibration(left=drawn.left * 1.04, right=drawn.right * 1.04, track=drawn.track, made_at=5.0)
    rig.drive_on()
    assert not rig.core.on_calibration(m.UseCalibration(user="ada", base=larger)).ok, "in motion"
    rig.run(0.8, REST)
    assert rig.until(rig.at_rest, REST)
    assert rig.core.on_calibration(m.UseCalibration(user="ada", base=larger)).ok
    assert rig.until(lambda: rig.state.base == larger, REST)

    def followed() -> bool:
        odometry = next(out.odometry for out in reversed(rig.outputs) if out.odometry)
        wheels = np.array(FORWARD[:2]) / 1.04
        return odometry.linear == pytest.approx(0.2, abs=0.01) and rig.plant.velocity()[:2] == pytest.approx(
            wheels, abs=0.02
        )

    assert rig.until(followed, FORWARD)
    assert rig.plant.breaches() == []


@pytest.mark.long
def test_calibrated_joints_are_told_as_drawn_and_end_at_their_own_limits(rig: Rig) -> None:
    rig.run(0.3, REST)
    off = 0.03
    new = m.ArmCalibration(offsets=(0.0, 0.0, 0.0, off, 0.0, -off, 0.0), made_at=5.0)
    rig.drive_on()
    assert not rig.core.on_calibration(m.UseCalibration(user="ada", arm=new)).ok, "in motion"
    rig.run(0.8, REST)
    assert rig.until(rig.at_rest, REST)
    own = arm(rig)
    assert rig.core.on_calibration(m.UseCalibration(user="ada", arm=new)).ok
    assert rig.until(lambda: rig.state.arm == new, REST)
    rig.run(0.3, REST)
    assert arm(rig) == pytest.approx(own - np.array(new.offsets), abs=2e-3) and rig.at_rest()
    assert next(out.frame for out in rig.outputs if out.frame).joint_offsets == m.NO_OFFSETS

    def frame() -> CameraFrame:
        return next(out.frame for out in reversed(rig.outputs) if out.frame)

    assert rig.until(lambda: frame().joint_offsets == new.offsets, REST)
    assert frame().position[2:] == pytest.approx(arm(rig), abs=2e-3)
    # Joints 4 and 6 to their upper limits: 4 is told below its own angle, 6 above it.
    up, highest = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0), MODEL.limits.upper[ARM_Q]

    def room() -> Array:
        return np.asarray(highest - arm(rig) - new.offsets)[[3, 5]]

    assert room().min() > 1.0
    assert rig.until(lambda: bool(room().max() < 0.03), up, 15.0)
    rig.run(0.5, up)
    assert 0.0 < room().min() and room().max() < 0.03
    assert rig.plant.breaches() == []


def test_pictures_get_the_delay_of_the_camera_clocks_calibration(rig: Rig) -> None:
    rig.run(0.3, REST)
    new = m.FrameTiming(delay=-0.04, made_at=5.0)
    assert rig.core.on_calibration(m.UseCalibration(user="ada", timing=new)).ok
    assert rig.until(lambda: rig.state.timing == new, REST)
    frames = [out.frame for out in rig.outputs if out.frame]
    assert frames[0].delay == 0.0
    assert rig.until(lambda: next(out.frame for out in reversed(rig.outputs) if out.frame).delay == -0.04, REST)


def arm(rig: Rig) -> Array:
    joints = next(out.joints for out in reversed(rig.outputs) if out.joints)
    return np.array(joints.position[2:])


def felt(rig: Rig) -> tuple[float, ...] | None:
    return next(out.joints for out in reversed(rig.outputs) if out.joints).external_torque


def test_what_pushes_the_arm_is_in_its_joint_states(rig: Rig) -> None:
    rig.run(0.3, REST)
    before = felt(rig)
    assert before is not None and np.abs(before).max() < 5.0
    rig.plant.push((0.0, 0.0, 0.0, 9.0, 0.0, 0.0, -3.0))

    def pushed() -> bool:
        return felt(rig) == pytest.approx(np.add(before, (0.0, 0.0, 0.0, 9.0, 0.0, 0.0, -3.0)), abs=1.0)

    assert rig.until(pushed, REST)
    rig.plant.push((0.0,) * 7)
    assert rig.until(lambda: felt(rig) == pytest.approx(before, abs=1.0), REST)


def test_an_estimate_that_is_no_number_is_told_as_none_and_the_joints_all_the_same(rig: Rig) -> None:
    rig.run(0.3, REST)
    rig.plant.push((0.0, math.nan, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert rig.until(lambda: felt(rig) is None, REST)
    sequence = rig.echo
    rig.plant.push((0.0, 1e9, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert rig.until(lambda: (felt(rig) or (0.0, 0.0))[1] == 1000.0, REST)
    assert rig.echo > sequence


def test_silence_of_the_controller_brings_everything_to_rest_in_time(rig: Rig) -> None:
    rig.drive_on()
    rig.run(0.6, None)
    assert rig.comes_to_rest(None)
    assert rig.state.watchdog
    rig.run(0.3, FORWARD)
    assert rig.at_rest(), "it woke moving"
    rig.run(0.1, REST)
    assert rig.until(lambda: not rig.at_rest(), FORWARD)
    assert rig.plant.breaches() == []


def test_a_command_computed_from_an_old_state_is_not_actuated(rig: Rig) -> None:
    rig.drive_on()
    stale = rig.echo
    for _ in range(60):
        rig.run(0.01, None)
        rig.echo = stale
        rig.command(FORWARD)
    assert rig.comes_to_rest(None)
    assert TOO_OLD.code in rig.refusals


def test_duplicates_reorders_and_replays_are_not_actuated(rig: Rig) -> None:
    rig.run(0.2, REST)
    rng = random.Random(5)
    old = [rig.message(tuple(-v for v in FORWARD)) for _ in range(50)]
    for _ in range(60):
        rig.run(0.01, REST)
        for message in rng.sample(old, 5):
            rig.core.on_motion(message, rig.now)
        assert rig.at_rest()
    assert OLD_SEQUENCE.code in rig.refusals


def test_an_epoch_that_is_not_the_given_one_actuates_nothing(rig: Rig) -> None:
    for epoch, reason in ((0, OLD_EPOCH), (2, UNKNOWN_EPOCH)):
        rig.epoch = 1
        rig.run(0.2, REST)
        assert rig.state.epoch == rig.epoch == 1
        rig.epoch = epoch
        rig.run(0.5, FORWARD)
        assert rig.at_rest(), epoch
        assert reason.code in rig.refusals
        rig.cut(f"c{epoch}")
        rig.run(0.1, REST)
        assert rig.plant.bites() == 0, epoch


def test_another_controller_is_given_the_token_once_the_holder_is_silent_or_gives_way(rig: Rig) -> None:
    rig.drive_on()
    rig.ask("b2")
    rig.run(0.1, FORWARD)
    assert f"command/token: {HELD.code}" in rig.refusals
    assert rig.state.holder == m.fingerprint(rig.token) and not rig.at_rest()
    rig.run(1.5, None)
    rig.ask("b2")
    rig.run(0.1, None)
    assert (rig.state.epoch, rig.state.holder) == (2, m.fingerprint("b2"))
    rig.run(0.3, FORWARD)
    assert rig.comes_to_rest(FORWARD) and OLD_EPOCH.code in rig.refusals
    rig.core.on_token(m.TokenRequest(token="b2", releases=True), rig.now)
    rig.epoch = 3
    rig.run(0.2, REST)
    assert rig.until(lambda: not rig.at_rest(), FORWARD)
    assert rig.plant.breaches() == []


def test_a_number_that_no_limit_allows_refuses_the_whole_command(rig: Rig) -> None:
    for bad in (math.nan, math.inf, 1e308, 100.0):
        rig.run(0.2, REST)
        before = refused_motion(rig)
        rig.run(0.3, (*FORWARD[:8], bad))
        assert rig.at_rest(), bad
        assert refused_motion(rig) > before, bad
        assert rig.plant.breaches() == [], bad


def refused_motion(rig: Rig) -> int:
    return sum(row.count for row in rig.state.rejections if row.topic == "command/motion")


def test_random_commands_break_no_limit(rig: Rig) -> None:
    rng = random.Random(3)
    rig.run(0.2, REST)
    for _ in range(30):
        rig.run(0.1, tuple(rng.uniform(-2.0, 2.0) for _ in range(9)))
    rig.run(0.6, None)
    assert rig.comes_to_rest(None)
    assert rig.plant.breaches() == []


def test_a_stop_latches_and_its_release_moves_nothing(rig: Rig) -> None:
    rig.drive_on()
    rig.core.on_stop(stop(), rig.now)
    rig.run(0.5, FORWARD)
    assert rig.comes_to_rest(FORWARD)
    assert rig.state.stop_id == "s1"
    assert not rig.core.on_release(release("other"), rig.now).ok
    assert rig.core.on_release(release(), rig.now).ok
    rig.run(0.4, FORWARD)
    assert rig.at_rest(), "the release moved it"
    rig.run(0.2, REST)
    assert rig.until(lambda: not rig.at_rest(), FORWARD)
    assert rig.plant.breaches() == []


def test_a_cut_is_made_once_however_often_it_is_asked_for_and_its_end_is_told(rig: Rig) -> None:
    rig.run(0.3, REST)
    for _ in range(20):
        rig.cut("c1")
        rig.run(0.01, REST)
    assert rig.until(lambda: rig.state.cut_id == "c1" and rig.state.outcome != "", REST)
    assert rig.until(lambda: rig.state.cutter == "open", REST)
    rig.cut("c1")
    rig.run(0.3, REST)
    assert rig.plant.bites() == 1
    rig.cut("c2")
    assert rig.until(lambda: rig.state.cut_id == "c2" and rig.state.outcome != "", REST)
    assert rig.plant.bites() == 2


def test_a_cut_during_a_stop_is_not_made_and_is_spent(rig: Rig) -> None:
    rig.run(0.3, REST)
    rig.core.on_stop(stop(), rig.now)
    rig.cut("c1")
    rig.run(0.1, REST)
    assert (rig.state.cut_id, rig.state.outcome) == ("c1", "FAILED_NOT_CUT")
    rig.core.on_release(release(), rig.now)
    rig.run(0.2, REST)
    rig.cut("c1")
    rig.run(0.3, REST)
    assert rig.plant.bites() == 0


def test_a_bridge_that_starts_again_does_not_wake_moving(rig: Rig) -> None:
    rig.drive_on()
    rig.start()
    rig.run(0.6, FORWARD)
    assert rig.comes_to_rest(FORWARD)
    assert rig.state.watchdog
    rig.run(0.2, REST)
    assert rig.until(lambda: not rig.at_rest(), FORWARD)
