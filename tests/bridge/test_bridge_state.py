"""What the bridge tells of itself and of its robot, and that it tells at once what a person waits for."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bridge.config import BridgeConfig, OdometryConfig
from bridge.core.attitude import GRAVITY, BaseOrientation, Inertial
from bridge.core.bridge import MOVING_CUT, TICK_S, BridgeCore, BridgeOutputs
from bridge.core.calibration import Calibration
from bridge.core.cut_orders import BUSY
from bridge.core.interface import Measurement
from bridge.core.odometer import Odometer
from bridge.core.picture import Picture
from bridge.core.state_memory import Remembered
from bridge.core.validator import HELD, MOVING, OLD_SEQUENCE
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.calibration.file import Calibrated
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel
from rolling_panda.reasons import button_pressed, said, severity_of, text_of
from rolling_panda.runtime.latest_file import KeptValue
from rolling_panda.topics import CUT, MOTION, ODOMETRY, TOKEN, Topic
from tests.bridge.test_bridge_core import FORWARD, Bench, IdealRobot, cut, odometer, release, stop
from tests.support.bridge_rig import MODEL, PICTURE, REST
from tests.support.fake_wire import as_received

RELAXED = reasons.limit_raised("[bridge] fade_s", 0.1, 0.05, 0.1)
SILENT, REFLEX = reasons.base_silent("drives/joint_states"), reasons.arm_reflex("joint_reflex")


@pytest.fixture
def bench() -> Bench:
    return Bench()


def tick(bench: Bench) -> BridgeOutputs:
    """The next tick of 1 ms."""
    bench.now += TICK_S
    bench.hear(out := bench.core.step(bench.now), None)
    return out


def lines(out: BridgeOutputs) -> list[tuple[str, str]]:
    return [(severity_of(event.reason), text_of(event.reason)) for event in out.events]


def refused(bench: Bench, topic: Topic[Any]) -> dict[str, int]:
    return {row.reason: row.count for row in bench.core.refusals.counts() if row.topic == topic.name}


def refused_cuts(bench: Bench) -> dict[str, int]:
    return refused(bench, CUT)


def test_limits_that_are_less_strict_are_reported_at_the_start_and_in_every_state() -> None:
    bench = Bench()
    bench.core = BridgeCore(bench.robot, BridgeConfig(), MODEL.limits, odometer(), "fakes", relaxed_limits=(RELAXED,))
    out = tick(bench)
    assert lines(out)[0] == ("warning", text_of(reasons.limits_relaxed(RELAXED)))
    assert out.state is not None
    assert (out.state.relaxed_limits, out.state.kind) == ((RELAXED,), "fakes")


def test_old_calibrations_are_reported_in_every_state_and_logged_once() -> None:
    bench, made_at, day = Bench(), 1.7e9, 86400.0
    base = m.BaseCalibration(left=0.133, right=0.133, track=0.51, made_at=made_at)
    arm = m.ArmCalibration(offsets=m.NO_OFFSETS, made_at=made_at + day)
    calibration = Calibration(MODEL.drive.sizes, float(MODEL.limits.velocity[0]), Calibrated(base, arm))
    bench.core = BridgeCore(bench.robot, BridgeConfig(), MODEL.limits, odometer(), "sim", calibration=calibration)

    def told(wall_time: float) -> tuple[set[tuple[m.Reason, ...]], list[m.Reason]]:
        out = []
        for _ in range(120):
            bench.now += TICK_S
            out.append(bench.core.step(bench.now, wall_time=wall_time))
        states = {each.state.calibration_warnings for each in out if each.state is not None}
        return states, [event.reason for each in out for event in each.events]

    assert told(made_at + 90.0 * day) == ({()}, [])
    old = reasons.base_calibration_old(90.0)
    assert told(made_at + 90.5 * day) == ({(old,)}, [old])
    older, arms = reasons.base_calibration_old(91.0), reasons.arm_calibration_old(90.0)
    assert told(made_at + 91.5 * day) == ({(older, arms)}, [arms])


def test_before_any_command_the_robot_is_held_and_told_to_rest(bench: Bench) -> None:
    out = tick(bench)
    state = out.state
    assert state is not None and out.stops is not None and lines(out) == []
    assert (state.watchdog, state.moving, state.holder, state.sequence, state.epoch) == (True, False, "", 0, 0)
    assert (state.cut_id, state.outcome, state.stop_id, state.header.stamp) == ("", "", "", bench.now)
    sent = bench.robot.sent[-1]
    assert not sent.xi.any() and not sent.blades


def test_who_released_the_last_stops_is_told_after_a_restart() -> None:
    bench = Bench()
    memory = KeptValue(Remembered(released=("s1",), released_by=reasons.stop_reset("ada", "checked")))
    bench.core = BridgeCore(bench.robot, BridgeConfig(), MODEL.limits, odometer(), "sim", memory=memory)
    out = tick(bench)
    assert out.stops is not None and (out.stops.stops, out.stops.released_by) == (
        (),
        reasons.stop_reset("ada", "checked"),
    )


def test_what_is_measured_is_in_the_state_and_the_joint_states(bench: Bench) -> None:
    bench.drive_on()
    bench.robot.now = replace(bench.robot.now, battery=0.5, arm_success=0.97)
    bench.run(0.05, FORWARD)
    assert (bench.state.battery, bench.state.arm_success) == (0.5, 0.97)
    assert (bench.state.cutter, bench.state.kind) == ("open", "sim")
    assert bench.state.moving and bench.state.sequence == bench.sequence - 1
    joints = next(out.joints for out in reversed(bench.outputs) if out.joints is not None)
    assert joints.position == pytest.approx(bench.robot.now.position, abs=0.01)
    assert joints.velocity == pytest.approx(FORWARD)
    assert joints.header.stamp == pytest.approx(bench.now, abs=0.011)
    sent = bench.robot.sent[-1]
    assert sent.blades and (sent.epoch, sent.sequence, sent.at) == (1, bench.sequence - 1, bench.now)


def test_odometry_counts_from_the_start_of_the_bridge(bench: Bench) -> None:
    bench.robot.now = replace(bench.robot.now, position=bench.robot.now.position + [1.0, 1.0, *(0.0,) * 7])
    bench.run(0.03, None)
    odometry = next(out.odometry for out in bench.outputs if out.odometry is not None)
    assert odometry.pose.x == pytest.approx(MODEL.drive.wheel_radius)


def test_how_fast_time_runs_and_how_long_an_answer_takes_are_counted_on_the_machines_clock(bench: Bench) -> None:
    for number in range(1, 3001):
        bench.now, clock = number * TICK_S, number * TICK_S * 2 + 50.0
        bench.hear(out := bench.core.step(bench.now, clock), None)
        if out.joints is not None:
            bench.ask()
            bench.core.on_motion(bench.message(REST), bench.now, clock + (0.03 if number == 2500 else 0.01))
    assert bench.state.real_time_factor == pytest.approx(0.5)
    assert bench.state.round_trip_s == pytest.approx(0.01)
    assert bench.state.round_trip_worst_s == pytest.approx(0.03)


def test_an_answer_without_a_time_of_its_own_came_at_the_last_tick(bench: Bench) -> None:
    bench.run(0.2, REST)
    assert bench.state.round_trip_worst_s == 0.0


def test_a_stop_its_release_and_who_did_both_are_told_in_the_next_tick(bench: Bench) -> None:
    bench.run(0.1, REST)
    bench.core.on_stop(stop(), bench.now, 5.0)
    out = tick(bench)
    assert lines(out) == [("warning", "Software stop by ada: button")]
    assert out.state is not None and out.state.stop_id == "s1"
    assert out.stops is not None and out.stops.process == "bridge" and not out.stops.hardware
    assert [(each.stop_id, each.wall_time) for each in out.stops.stops] == [("s1", 5.0)]
    assert not bench.robot.sent[-1].blades
    bench.core.on_stop(stop(), bench.now)
    assert lines(tick(bench)) == []
    assert bench.core.on_release(release(), bench.now) == m.Answer(ok=True)
    out = tick(bench)
    assert lines(out) == [("info", text_of(reasons.stop_reset("ada", "checked")))]
    assert out.state is not None and out.state.stop_id == ""
    assert out.stops is not None and (out.stops.stops, out.stops.released_by) == (
        (),
        reasons.stop_reset("ada", "checked"),
    )
    assert bench.robot.sent[-1].releases == 1
    refused = bench.core.on_release(release(), bench.now)
    assert refused.ok is False and refused.reason


def test_the_emergency_stop_button_is_told_by_its_name_with_its_time(bench: Bench) -> None:
    bench.run(0.1, REST)
    bench.robot.now = replace(bench.robot.now, emergency=True)
    bench.core.step(bench.now + TICK_S, wall_time=9.0)
    bench.now += 2 * TICK_S
    bench.hear(out := bench.core.step(bench.now, wall_time=9.0), None)
    ((severity, text),) = lines(out)
    assert severity == "warning" and text.startswith("Emergency stop: ")
    assert out.stops is not None and out.stops.hardware
    (pressed,) = as_received(out.stops).stops
    assert (pressed.source, pressed.user, pressed.wall_time) == ("hardware", "", 9.0)
    assert pressed.reason == button_pressed() and bench.state.stop_id == pressed.stop_id


def test_who_gets_the_token_and_gives_it_back_is_told_at_once_and_the_robot_comes_to_rest(bench: Bench) -> None:
    bench.run(0.1, None)
    bench.ask()
    out = tick(bench)
    assert ("info", text_of(reasons.token_issued(1))) in lines(out)
    assert out.state is not None and (out.state.epoch, out.state.holder) == (1, m.fingerprint(bench.token))
    bench.drive_on()
    bench.core.on_token(m.TokenRequest(token="other", releases=True), bench.now)
    assert lines(tick(bench)) == [] and bench.robot.sent[-1].xi.any()
    bench.core.on_token(m.TokenRequest(token=bench.token, releases=True), bench.now)
    out = tick(bench)
    ((severity, text),) = lines(out)
    assert severity == "info" and "epoch 1" in text
    assert out.state is not None and out.state.holder == ""
    bench.run(0.01, None)
    assert abs(bench.robot.sent[-1].xi[0]) < 0.99 * abs(FORWARD[0]), "before the watchdog's time"
    bench.ask("b2")
    assert bench.state.epoch == 1 and refused(bench, TOKEN) == {MOVING: 1}
    bench.run(0.5, None)
    bench.ask("b2")
    tick(bench)
    assert (bench.state.epoch, bench.state.holder) == (2, m.fingerprint("b2"))
    bench.ask("c3")
    assert refused(bench, TOKEN) == {MOVING: 1, HELD: 1}


def test_a_token_is_told_at_once_and_its_holder_when_the_disk_has_it() -> None:
    class SlowDisk(KeptValue[Remembered]):
        kept = False

    bench, disk = Bench(), SlowDisk(Remembered())
    bench.core = BridgeCore(bench.robot, BridgeConfig(), MODEL.limits, odometer(), "sim", memory=disk)
    bench.run(0.105, None)
    bench.ask()
    state = tick(bench).state
    assert state is not None and (state.epoch, state.holder) == (1, "")
    assert (disk.value.epoch, disk.value.token) == (1, bench.token)
    disk.kept = True
    state = tick(bench).state
    assert state is not None and state.holder == m.fingerprint(bench.token)


def test_why_the_cutter_is_inhibited_is_counted_and_the_order_is_used_up(bench: Bench) -> None:
    bench.run(0.1, REST)
    bench.core.on_stop(stop(), bench.now)
    bench.core.on_cut(cut(bench, "c1"), bench.now)
    assert refused_cuts(bench) == {reasons.stop_latched(): 1}
    assert bench.core.on_release(release(), bench.now).ok
    # Nothing at rest has come since.
    bench.core.on_cut(cut(bench, "c2"), bench.now)
    assert refused_cuts(bench) == {
        reasons.stop_latched(): 1,
        reasons.cutter_inhibited(): 1,
    }
    tick(bench)
    assert (bench.state.cut_id, bench.state.outcome, bench.robot.cuts) == ("c2", "FAILED_NOT_CUT", [])
    bench.run(0.1, REST)
    bench.core.on_cut(cut(bench, "c3"), bench.now)
    assert (bench.robot.cuts, bench.robot.points) == (["c3"], ["p1"])


def test_an_end_of_a_cut_is_told_at_once_and_a_bad_one_is_a_warning(bench: Bench) -> None:
    bench.run(0.105, REST)
    bench.core.on_cut(cut(bench, "c1"), bench.now)
    out = tick(bench)
    assert out.state is not None and (out.state.cut_id, out.state.outcome, out.state.cutter) == ("c1", "", "closing")
    bench.robot.end_cut("FAILED_NOT_CUT")
    tick(bench)
    told = [line for out in bench.outputs for line in lines(out) if "c1" in line[1]]
    assert told == [("warning", text_of(reasons.cut_not_done("c1", "FAILED_NOT_CUT", said("by the robot"))))]
    assert (bench.state.cut_id, bench.state.outcome) == ("c1", "FAILED_NOT_CUT")


def test_of_two_orders_in_one_tick_one_is_cut(bench: Bench) -> None:
    bench.run(0.1, REST)
    bench.core.on_cut(cut(bench, "c1"), bench.now)
    bench.core.on_cut(cut(bench, "c2"), bench.now)
    bench.core.on_cut(cut(bench, "c1"), bench.now)
    assert bench.robot.cuts == ["c1"] and refused_cuts(bench) == {BUSY: 1}
    tick(bench)
    assert (bench.state.cut_id, bench.state.outcome) == ("c1", "")


def test_braking_that_takes_longer_than_the_deadline_leaves_begins_at_once(bench: Bench) -> None:
    bench.drive_on()
    bench.run(0.05, None)
    assert abs(bench.robot.sent[-1].xi[0]) < 0.98 * abs(FORWARD[0])
    assert bench.robot.sent[-1].xi[2] < FORWARD[2]


def test_what_is_refused_is_counted_under_its_topic(bench: Bench) -> None:
    bench.run(0.1, REST)
    bench.sequence -= 1
    bench.core.on_motion(bench.message(REST), bench.now)
    assert refused(bench, MOTION) == {OLD_SEQUENCE: 1}
    bench.run(0.1, REST)
    told = [line for out in bench.outputs for line in lines(out) if text_of(OLD_SEQUENCE) in line[1]]
    assert [severity for severity, _ in told] == ["warning"]


def test_stops_are_told_when_they_change_and_no_more_often(bench: Bench) -> None:
    bench.run(2.0, REST)
    told = [out for out in bench.outputs if out.stops is not None]
    assert len(told) == 1


def test_scenery_has_the_time_at_which_it_was_told() -> None:
    core = BridgeCore(IdealRobot(), BridgeConfig(), MODEL.limits, odometer(), "sim", scenery=lambda: (1, ()))
    scenery = core.step(7.5).scenery
    assert scenery is not None and scenery.header.stamp == 7.5


def test_a_robot_that_cannot_move_cuts_nothing_and_the_order_is_used_up(bench: Bench) -> None:
    bench.run(0.1, REST)
    bench.robot.now = replace(bench.robot.now, fault=REFLEX)
    bench.run(0.02, REST)
    bench.core.on_cut(cut(bench, "c1"), bench.now)
    assert refused_cuts(bench) == {reasons.robot_faulty(REFLEX): 1}
    assert tick(bench).state is not None
    assert (bench.state.cut_id, bench.state.outcome, bench.robot.cuts) == ("c1", "FAILED_NOT_CUT", [])
    assert not bench.robot.sent[-1].blades


class Drifting(IdealRobot):
    """Is measured to move a little, whatever it is told."""

    drift: Array = np.zeros(9)

    def read(self) -> Measurement:
        return replace(self.now, velocity=self.drift)


@pytest.mark.parametrize(
    ("actuator", "speed", "cuts"),
    [(0, 0.039, True), (1, 0.041, False), (1, -0.041, False), (2, 0.099, True), (8, 0.11, False), (2, -0.11, False)],
)
def test_the_blades_close_only_while_wheels_and_joints_are_slow(actuator: int, speed: float, cuts: bool) -> None:
    bench, robot = Bench(), Drifting()
    robot.drift = np.zeros(9)
    bench.robot, bench.core = robot, BridgeCore(robot, BridgeConfig(), MODEL.limits, odometer(), "sim")
    bench.run(0.1, REST)
    robot.drift[actuator] = speed
    bench.run(0.02, REST)
    bench.core.on_cut(cut(bench, "c1"), bench.now)
    assert robot.cuts == (["c1"] if cuts else [])
    assert refused_cuts(bench) == ({} if cuts else {MOVING_CUT: 1})


class Feeling(IdealRobot):
    """At rest on level ground, with inertial sensors that can fall silent."""

    silent = False
    reads = 0

    def read(self) -> Measurement:
        self.reads += 1
        if self.silent:
            return replace(self.now, inertial=None)
        on_base = MODEL.pose(np.concatenate([np.zeros(3), self.now.position]), MODEL.camera_id).rotation
        force = on_base.T @ np.array([0.0, 0.0, GRAVITY])
        return replace(self.now, inertial=Inertial(self.reads * TICK_S, np.zeros(3), force))


def test_inertial_sensors_that_fall_silent_are_told_once_and_so_is_their_return(bench: Bench) -> None:
    robot = Feeling()
    followed = Odometer(MODEL.drive, OdometryConfig(), TICK_S, 0, BaseOrientation(RobotModel()))
    bench.robot, bench.core = robot, BridgeCore(robot, BridgeConfig(), MODEL.limits, followed, "sim")
    told = []
    for silent in (False, True, False):
        robot.silent = silent
        told.append([line for _ in range(1500) for line in lines(tick(bench))])
    assert told == [
        [],
        [("warning", text_of(reasons.inertial_lost()))],
        [("info", text_of(reasons.inertial_works()))],
    ]


def test_following_and_its_end_are_told_at_once(bench: Bench) -> None:
    bench.run(0.1, None)
    bench.ask()
    bench.core.on_motion(bench.message(REST), bench.now)
    out = tick(bench)
    assert ("info", text_of(reasons.setpoints_arrive())) in lines(out)
    assert out.state is not None and not out.state.watchdog
    outs = [tick(bench) for _ in range(300)]
    (ended,) = [out for out in outs if lines(out)]
    assert lines(ended) == [("warning", text_of(reasons.setpoints_missing()))]
    assert ended.state is not None and ended.state.watchdog


def test_a_fault_is_told_once_as_a_warning_and_its_end_as_information(bench: Bench) -> None:
    bench.drive_on()
    told = len(bench.log)
    bench.robot.now = replace(bench.robot.now, fault=SILENT)
    bench.run(0.1, FORWARD)
    bench.robot.now = replace(bench.robot.now, fault=None)
    bench.run(0.1, FORWARD)
    events = [event for out in bench.outputs for event in out.events][told:]
    own = [event.reason for event in events if event.reason.code.startswith("robot_")]
    assert own == [reasons.robot_faulty(SILENT), reasons.robot_ready_again()]
    assert [severity_of(reason) for reason in own] == ["warning", "info"]
    assert all((event.process, event.header.stamp > 0.0) == ("bridge", True) for event in events)


def fails(bench: Bench, fault: m.Reason | None) -> None:
    bench.robot.now = replace(bench.robot.now, fault=fault, severe=fault is not None)


def test_a_severe_fault_is_a_stop_once_and_again_where_the_robot_does_not_recover_from_it(bench: Bench) -> None:
    bench.run(0.1, REST)
    fails(bench, REFLEX)
    for _ in range(3):
        bench.now += TICK_S
        bench.hear(bench.core.step(bench.now, wall_time=9.0), REST)
    (first,) = bench.stops.stops
    assert (first.source, first.reason, first.wall_time) == ("robot", REFLEX, 9.0)
    assert bench.state.stop_id == first.stop_id
    assert bench.core.on_release(release(first.stop_id), bench.now).ok
    bench.run(2.5, REST)
    assert bench.state.stop_id == "", "it may take a while to recover"
    bench.run(1.0, REST)
    (second,) = bench.stops.stops
    assert second.source == "robot" and second.stop_id != first.stop_id
    fails(bench, None)
    bench.run(0.1, REST)
    assert bench.state.stop_id == second.stop_id, "a person has to look first"


def test_a_severe_fault_under_a_stop_adds_none(bench: Bench) -> None:
    bench.run(0.1, REST)
    bench.core.on_stop(stop(), bench.now)
    fails(bench, REFLEX)
    bench.run(0.1, REST)
    assert [each.stop_id for each in bench.stops.stops] == ["s1"]


def test_what_must_survive_a_restart_is_kept(bench: Bench) -> None:
    memory = KeptValue(Remembered())
    bench.core = BridgeCore(bench.robot, BridgeConfig(), MODEL.limits, odometer(), "sim", memory=memory)
    bench.run(0.1, REST)
    bench.core.on_stop(stop("s1"), bench.now, 5.0)
    assert [each.stop_id for each in memory.value.stops] == ["s1"]
    assert bench.core.on_release(release("s1"), bench.now).ok
    bench.core.on_stop(stop("s2"), bench.now, 6.0)
    kept = memory.value
    assert (kept.epoch, kept.token, kept.released, kept.released_by) == (
        1,
        bench.token,
        ("s1",),
        reasons.stop_reset("ada", "checked"),
    )
    assert [(each.stop_id, each.wall_time) for each in kept.stops] == [("s2", 6.0)]


def test_a_long_reason_is_cut_to_what_the_wire_carries(bench: Bench) -> None:
    bench.core.on_stop(m.StopRequest(stop_id="s1", source="page", user="ada", reason=said("x" * 500)), bench.now)
    (event,) = tick(bench).events
    assert len(text_of(as_received(event).reason)) == 500


def test_after_a_cut_the_camera_looks_more_often_again(bench: Bench) -> None:
    def pictures(seconds: float) -> int:
        before = len(bench.outputs)
        bench.run(seconds, REST)
        return sum(out.frame is not None for out in bench.outputs[before:])

    bench.run(6.5, REST)
    assert pictures(2.0) == 1
    bench.core.on_cut(cut(bench, "c1"), bench.now)
    bench.robot.end_cut("DONE")
    assert pictures(2.0) >= 4


def test_braking_after_its_controllers_mode_has_ended_is_no_motion_against_that_mode(bench: Bench) -> None:
    bench.drive_on()
    bench.mode = "IDLE"
    bench.ask()
    bench.run(0.05, FORWARD)
    bench.run(0.5, REST)
    assert not any("commanded to move" in line for line in bench.log) and not bench.state.moving


def test_after_a_fault_nothing_moves_before_a_setpoint_at_rest(bench: Bench) -> None:
    bench.drive_on()
    bench.robot.now = replace(bench.robot.now, fault=REFLEX)
    bench.run(0.5, REST)
    bench.run(0.2, FORWARD)
    bench.robot.now = replace(bench.robot.now, fault=None)
    # Longer than a fault is waited for to stay away.
    bench.run(3.0, FORWARD)
    assert bench.moved_within(3.0) == 0.0
    bench.run(0.1, REST)
    bench.run(0.5, FORWARD)
    assert bench.moved_within(0.1) > 0.0


def test_while_the_robot_moves_the_camera_looks_more_often(bench: Bench) -> None:
    def pictures(seconds: float, xi: tuple[float, ...]) -> int:
        before = len(bench.outputs)
        bench.run(seconds, xi)
        return sum(out.frame is not None for out in bench.outputs[before:])

    bench.run(6.5, REST)
    assert pictures(2.0, REST) == 1
    assert pictures(6.0, FORWARD) >= 11


class SlowCamera(IdealRobot):
    """Has a picture only some time after it was asked for one."""

    waits = 0

    def capture(self, expose: bool) -> Picture | None:
        self.waits = 40 if expose else self.waits - 1
        return PICTURE if self.waits == 0 else None


def test_a_frame_is_told_when_its_picture_has_come_and_not_before() -> None:
    bench = Bench()
    bench.core = BridgeCore(SlowCamera(), BridgeConfig(), MODEL.limits, odometer(), "sim")
    bench.run(0.3, REST)
    assert not any(out.frame for out in bench.outputs)
    bench.run(0.3, REST)
    assert [out.frame.color_jpeg for out in bench.outputs if out.frame is not None] == [PICTURE.color_jpeg]


class RunningCamera(IdealRobot):
    """Its pictures are a quarter of a second old."""

    clock = 0.0

    def capture(self, expose: bool) -> Picture | None:
        return replace(PICTURE, taken_at=self.clock - 0.25) if expose else None


def test_a_picture_is_told_with_the_posture_in_which_it_was_taken() -> None:
    bench = Bench()
    bench.robot = RunningCamera()
    bench.core = BridgeCore(bench.robot, BridgeConfig(), MODEL.limits, odometer(), "sim")
    for xi, seconds in ((REST, 0.1), (FORWARD, 2.0)):
        for _ in range(round(seconds * 1000)):
            bench.now += TICK_S
            bench.robot.clock = bench.now
            bench.hear(bench.core.step(bench.now), xi)
    frame, told = next((out.frame, bench.now) for out in reversed(bench.outputs) if out.frame is not None)
    (then,) = {
        (out.joints.position, out.joints.velocity)
        for out in bench.outputs
        if out.joints is not None and out.joints.header.stamp == frame.header.stamp
    }
    assert frame.header.stamp < told - 0.2 and (frame.position, frame.velocity) == then


def test_an_order_that_is_refused_for_itself_is_not_told_as_a_cut_that_failed(bench: Bench) -> None:
    bench.drive_on()
    bench.core.on_cut(cut(bench, "c1"), bench.now)
    bench.run(0.1, FORWARD)
    assert refused_cuts(bench) == {MOVING_CUT: 1}
    assert (bench.state.cut_id, bench.state.outcome) == ("", "")


def test_odometry_keeps_its_rate_however_often_the_joints_are_told() -> None:
    bench = Bench()
    bench.core = BridgeCore(bench.robot, BridgeConfig(joints_hz=500.0), MODEL.limits, odometer(), "sim")
    bench.run(2.0, REST)
    told = sum(out.odometry is not None for out in bench.outputs)
    assert told == pytest.approx(2.0 * ODOMETRY.rate_hz, abs=2)


def test_round_trips_are_those_of_the_last_second(bench: Bench) -> None:
    bench.run(0.5, REST)
    assert bench.state.round_trip_worst_s == 0.0
    echo = bench.echo
    bench.run(0.05, None)
    bench.echo = echo
    bench.command(REST)
    bench.run(0.1, REST)
    assert bench.state.round_trip_worst_s == pytest.approx(0.05, abs=0.01)
    bench.run(1.2, REST)
    assert bench.state.round_trip_worst_s < 0.01


def test_scenery_tells_its_rods_in_odom() -> None:
    rod = Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, 1.0), start_radius=0.1, end_radius=0.1, kind="post")
    core = BridgeCore(IdealRobot(), BridgeConfig(), MODEL.limits, odometer(), "sim", scenery=lambda: (1, (rod,)))
    scenery = core.step(7.5).scenery
    assert scenery is not None and (scenery.header.frame_id, scenery.capsules) == ("map", (rod,))
