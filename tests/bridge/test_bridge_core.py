from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config import BridgeConfig, OdometryConfig
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.cut_orders import ForLife
from bridge.core.interface import NO_CUT, Measurement, Setpoint
from bridge.core.odometer import Odometer
from bridge.core.picture import Picture
from bridge.core.state_memory import Remembered
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CloseUpRequest
from rolling_panda.messages.supervision import StopState
from rolling_panda.reasons import said, severity_of, text_of
from rolling_panda.runtime.latest_file import KeptValue
from rolling_panda.topics import TOKEN
from rolling_panda.transport.codec import StrictDecoder, encode
from rolling_panda.transport.rejections import Rejections
from tests.support.bridge_rig import MODEL, PICTURE, REST, Commander

MIDDLE = (MODEL.limits.lower[5:] + MODEL.limits.upper[5:]) / 2
FORWARD = (*MODEL.drive.wheels(0.3, 0.0), 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2)


class IdealRobot:
    """Does at once what it is told, and remembers it."""

    def __init__(self) -> None:
        self.now = Measurement(np.concatenate([np.zeros(2), MIDDLE]), np.zeros(9), "open", "", "", NO_CUT)
        self.sent: list[Setpoint] = []
        self.cuts: list[str] = []
        self.points: list[str] = []

    def read(self) -> Measurement:
        return self.now

    def write(self, setpoint: Setpoint) -> None:
        self.sent.append(setpoint)
        position = self.now.position + setpoint.xi * 1e-3
        self.now = replace(self.now, position=position, velocity=setpoint.xi)

    def cut(self, cut_id: str, point_id: str) -> None:
        self.cuts.append(cut_id)
        self.points.append(point_id)
        self.now = replace(self.now, cutter="closing", cut_id=cut_id, outcome="")

    def end_cut(self, outcome: m.Outcome) -> None:
        self.now = replace(self.now, cutter="open", outcome=outcome, detail=said("by the robot"))

    def capture(self, expose: bool) -> Picture | None:
        return PICTURE if expose else None

    def close(self) -> None:
        pass


def odometer() -> Odometer:
    return Odometer(MODEL.drive, OdometryConfig(), TICK_S)


class Bench(Commander):
    """A core on an ideal robot, with a controller that repeats one velocity at 100 Hz for as long as it lives."""

    def __init__(self) -> None:
        super().__init__()
        self.robot = IdealRobot()
        self.core = BridgeCore(self.robot, BridgeConfig(), MODEL.limits, odometer(), "sim")

    def run(self, seconds: float, xi: tuple[float, ...] | None) -> None:
        for _ in range(round(seconds * 1000)):
            self.now += 1e-3
            self.hear(self.core.step(self.now), xi)

    def drive_on(self) -> None:
        self.run(0.1, REST)
        self.run(0.5, FORWARD)
        assert self.robot.sent[-1].xi == pytest.approx(FORWARD)

    @property
    def stops(self) -> StopState:
        return next(out.stops for out in reversed(self.outputs) if out.stops is not None)

    @property
    def log(self) -> list[str]:
        return [text_of(event.reason) for out in self.outputs for event in out.events]

    def moved_within(self, seconds: float) -> float:
        """Time since which nothing has been sent any more, counted from `seconds` ago."""
        sent = self.robot.sent[-round(seconds * 1000) :]
        moving = [i for i, setpoint in enumerate(sent) if np.abs(setpoint.xi).max() > 0]
        return (moving[-1] + 1) * 1e-3 if moving else 0.0


@pytest.fixture
def bench() -> Bench:
    return Bench()


def stop(stop_id: str = "s1") -> m.StopRequest:
    return m.StopRequest(stop_id=stop_id, source="page", user="ada", reason=said("button"))


def release(stop_id: str = "s1") -> m.ReleaseStop:
    return m.ReleaseStop(stop_id=stop_id, user="ada", reason="checked")


def cut(bench: Bench, cut_id: str, epoch: int = 1) -> m.CutCommand:
    return m.CutCommand(epoch=epoch, token=bench.token, echo=bench.echo, cut_id=cut_id, point_id="p1")


def test_it_follows_a_controller_and_says_so(bench: Bench) -> None:
    bench.drive_on()
    assert not bench.state.watchdog
    assert bench.state.epoch == 1
    assert bench.robot.sent[-1].sequence == bench.sequence - 1
    assert any("follows" in line for line in bench.log)


def test_silence_brings_base_and_arm_to_rest_softly_and_in_time(bench: Bench) -> None:
    bench.drive_on()
    bench.run(0.6, None)
    assert bench.moved_within(0.6) <= 0.3
    sent = np.array([setpoint.xi for setpoint in bench.robot.sent[-600:]])
    assert np.all(np.abs(np.diff(sent, axis=0)) <= MODEL.limits.acceleration * 1e-3 + 1e-12)
    assert bench.state.watchdog
    assert bench.log.count(text_of(reasons.setpoints_missing())) == 1
    assert not bench.robot.sent[-1].blades


def test_after_the_watchdog_the_robot_waits_for_rest(bench: Bench) -> None:
    bench.drive_on()
    bench.run(0.5, None)
    bench.run(0.5, FORWARD)
    assert bench.moved_within(0.5) == 0.0
    assert bench.state.watchdog
    assert any(row.reason == reasons.must_begin_at_rest() for row in bench.state.rejections)
    bench.run(0.1, REST)
    bench.run(0.3, FORWARD)
    assert bench.robot.sent[-1].xi == pytest.approx(FORWARD)


def test_commands_from_old_joint_states_do_not_keep_it_moving(bench: Bench) -> None:
    bench.drive_on()
    stale = bench.echo
    for _ in range(60):
        bench.run(0.01, None)
        bench.echo = stale
        bench.command(FORWARD)
    assert bench.state.watchdog
    assert np.abs(bench.robot.sent[-1].xi).max() == 0.0


def test_the_software_stop_latches_and_release_moves_nothing(bench: Bench) -> None:
    bench.drive_on()
    bench.core.on_stop(stop(), bench.now)
    bench.run(0.5, FORWARD)
    assert 0.0 < bench.moved_within(0.5) <= 0.2
    assert (bench.state.stop_id, bench.state.watchdog) == ("s1", False)
    assert bench.state.stopped_by == reasons.software_stop("ada", said("button"))
    assert not bench.core.on_release(release("other"), bench.now).ok
    bench.run(0.1, FORWARD)
    assert bench.core.on_release(release(), bench.now).ok
    bench.core.on_stop(stop(), bench.now)
    bench.run(0.5, FORWARD)
    assert bench.moved_within(0.6) == 0.0
    assert bench.state.stop_id == ""
    bench.run(0.3, REST)
    bench.run(0.3, FORWARD)
    assert bench.robot.sent[-1].xi == pytest.approx(FORWARD)


def test_a_latched_stop_survives_a_restart_of_the_bridge(bench: Bench) -> None:
    memory = KeptValue(Remembered())
    bench.core = BridgeCore(bench.robot, BridgeConfig(), MODEL.limits, odometer(), "sim", memory=memory)
    bench.drive_on()
    bench.core.on_stop(stop(), bench.now, 5.0)
    again = Bench()
    again.core = BridgeCore(again.robot, BridgeConfig(), MODEL.limits, odometer(), "sim", memory=memory)
    again.run(0.3, REST)
    again.run(0.3, FORWARD)
    assert again.moved_within(0.6) == 0.0 and again.state.stop_id == "s1"
    told = next(out.stops for out in again.outputs if out.stops)
    assert told.process == "bridge" and [each.wall_time for each in told.stops] == [5.0]
    assert again.core.on_release(release(), again.now).ok
    third = Bench()
    third.core = BridgeCore(third.robot, BridgeConfig(), MODEL.limits, odometer(), "sim", memory=memory)
    third.core.on_stop(stop(), third.now)
    third.run(0.1, REST)
    assert third.state.stop_id == ""


UNWRITABLE = reasons.file_unwritable("bridge.json", "Read-only file system")


class Disk(KeptValue[Remembered]):
    """A memory whose disk is slow or broken."""

    kept, failure = True, None  # type: ignore[assignment]


def test_a_stop_is_told_to_be_latched_once_a_restart_would_find_it(bench: Bench) -> None:
    disk = Disk(Remembered())
    bench.core = BridgeCore(bench.robot, BridgeConfig(), MODEL.limits, odometer(), "sim", memory=disk)
    bench.drive_on()
    disk.kept = False  # type: ignore[misc]
    bench.outputs.clear()
    bench.core.on_stop(stop(), bench.now)
    bench.run(1.0, FORWARD)
    assert bench.state.stop_id == "s1" and bench.moved_within(0.5) == 0.0, "it stops at once"
    assert [out for out in bench.outputs if out.stops and out.stops.stops] == []
    disk.kept = True  # type: ignore[misc]
    bench.run(0.01, FORWARD)
    assert [each.stop_id for out in bench.outputs if out.stops for each in out.stops.stops] == ["s1"]


def test_a_bridge_that_cannot_remember_holds_the_robot_and_says_why(bench: Bench) -> None:
    disk = Disk(Remembered())
    bench.core = BridgeCore(bench.robot, BridgeConfig(), MODEL.limits, odometer(), "sim", memory=disk)
    bench.drive_on()
    disk.failure, disk.kept = UNWRITABLE, False  # type: ignore[misc]
    bench.run(1.0, FORWARD)
    assert bench.moved_within(0.3) == 0.0 and bench.state.watchdog
    assert text_of(reasons.robot_faulty(UNWRITABLE)) in bench.log
    bench.core.on_stop(stop(), bench.now)
    bench.run(0.1, FORWARD)
    assert any(out.stops and out.stops.stops for out in bench.outputs), "who stops is not kept waiting for ever"
    assert bench.core.on_release(release(), bench.now).ok
    disk.failure, disk.kept = None, True  # type: ignore[misc]
    bench.run(0.2, REST)
    bench.run(0.3, FORWARD)
    assert bench.robot.sent[-1].xi == pytest.approx(FORWARD)


def test_the_emergency_stop_button_stops_latches_and_has_to_be_released_first(bench: Bench) -> None:
    bench.drive_on()
    bench.robot.now = replace(bench.robot.now, emergency=True)
    bench.run(0.5, FORWARD)
    assert 0.0 < bench.moved_within(0.5) <= 0.3
    assert bench.state.stop_id.startswith("hardware-")
    assert bench.stops.hardware
    assert "button is pressed" in text_of(bench.core.on_release(release(bench.state.stop_id), bench.now).reason)
    bench.robot.now = replace(bench.robot.now, emergency=False)
    bench.run(0.01, FORWARD)
    assert bench.state.stop_id and bench.moved_within(0.01) == 0.0
    assert not bench.stops.hardware, "that it is not pressed any more is told at once"
    assert bench.core.on_release(release(bench.state.stop_id), bench.now).ok


def test_a_cut_is_made_once_and_its_end_is_told(bench: Bench) -> None:
    bench.run(0.1, REST)
    for _ in range(20):
        bench.core.on_cut(cut(bench, "c1"), bench.now)
        bench.run(0.01, REST)
    assert (bench.robot.cuts, bench.robot.points) == (["c1"], ["p1"])
    assert (bench.state.cut_id, bench.state.outcome) == ("c1", "")
    bench.robot.end_cut("DONE")
    bench.run(0.01, REST)
    assert (bench.state.cut_id, bench.state.outcome) == ("c1", "DONE")
    told = [event for out in bench.outputs for event in out.events if event.reason.code == "cut_reported"]
    assert [severity_of(event.reason) for event in told] == ["info"]
    bench.core.on_cut(cut(bench, "c1"), bench.now)
    assert bench.robot.cuts == ["c1"]


def test_a_cut_that_was_made_before_the_bridge_started_is_not_made_again(bench: Bench) -> None:
    class Known(ForLife):
        @property
        def known(self) -> frozenset[str]:
            return frozenset({"c1"})

    bench.core = BridgeCore(bench.robot, BridgeConfig(), MODEL.limits, odometer(), "sim", cuts=Known())
    bench.run(0.1, REST)
    for cut_id in ("c1", "c2"):
        bench.core.on_cut(cut(bench, cut_id), bench.now)
    assert bench.robot.cuts == ["c2"]


@pytest.mark.parametrize("fault", ["stop", "silence"])
def test_the_cutter_is_inhibited_without_control_and_the_order_is_spent(bench: Bench, fault: str) -> None:
    bench.run(0.1, REST)
    if fault == "stop":
        bench.core.on_stop(stop(), bench.now)
    elif fault == "silence":
        bench.run(0.3, None)
    bench.core.on_cut(cut(bench, "c1"), bench.now)
    bench.run(0.1, REST)
    assert bench.robot.cuts == []
    assert (bench.state.cut_id, bench.state.outcome) == ("c1", "FAILED_NOT_CUT")
    bench.core.on_release(release(), bench.now)
    bench.run(0.1, REST)
    bench.core.on_cut(cut(bench, "c1"), bench.now)
    assert bench.robot.cuts == []


def test_no_cut_before_any_motion_command_or_in_motion_or_from_an_old_view(bench: Bench) -> None:
    bench.run(0.1, None)
    bench.core.on_cut(cut(bench, "c1", epoch=0), bench.now)
    bench.drive_on()
    bench.core.on_cut(cut(bench, "c2"), bench.now)
    bench.run(0.6, REST)
    seen = bench.echo
    bench.run(0.3, REST)
    bench.echo, newest = seen, bench.echo
    bench.core.on_cut(cut(bench, "c3"), bench.now)
    bench.echo = newest
    bench.run(0.05, REST)
    assert bench.robot.cuts == []
    refused = {row.reason for row in bench.state.rejections if row.topic == "command/cut"}
    assert len(refused) == 3 and reasons.cut_in_motion() in refused
    bench.core.on_cut(cut(bench, "c2"), bench.now)
    assert bench.robot.cuts == ["c2"]


def test_after_a_restart_an_older_token_moves_nothing_and_the_newest_one_goes_on(bench: Bench) -> None:
    memory = KeptValue(Remembered(epoch=6, token="before"))

    def started(token: str, epoch: int) -> Bench:
        out = Bench()
        out.core = BridgeCore(out.robot, BridgeConfig(), MODEL.limits, odometer(), "sim", memory=memory)
        out.token, out.epoch = token, epoch
        out.run(0.2, REST)
        out.run(0.2, FORWARD)
        return out

    assert started("before", 6).moved_within(0.2) > 0.0
    # Another one waits until the one from before the restart has had its time.
    bench = started("after", 7)
    assert bench.moved_within(0.4) == 0.0
    bench.run(1.0, REST)
    bench.run(0.2, FORWARD)
    assert bench.moved_within(0.2) > 0.0 and memory.value.epoch == bench.state.epoch == 7
    again = started("before", 6)
    assert again.moved_within(0.4) == 0.0
    assert any(row.reason == reasons.epoch_old() for row in again.state.rejections)
    assert started("after", 7).moved_within(0.2) > 0.0


def test_who_holds_the_token_is_told_once_a_restart_would_know_it(bench: Bench) -> None:
    class SlowDisk(KeptValue[Remembered]):
        kept = False

    disk = SlowDisk(Remembered())
    bench.core = BridgeCore(bench.robot, BridgeConfig(), MODEL.limits, odometer(), "sim", memory=disk)
    bench.run(0.2, REST)
    assert bench.state.holder == ""
    disk.kept = True
    bench.run(0.002, REST)
    assert bench.state.holder == m.fingerprint(bench.token)


@pytest.mark.parametrize("mode", ["IDLE", "FAULT", "ESTOP_LATCHED"])
def test_the_bridge_says_it_when_it_moves_though_its_controllers_mode_moves_nothing(bench: Bench, mode: m.Mode) -> None:
    bench.drive_on()
    assert not any("commanded to move" in line for line in bench.log)
    bench.mode = mode
    bench.run(1.5, FORWARD)
    events = [event for out in bench.outputs for event in out.events]
    (said,) = [
        event
        for event in events
        if f"commanded to move, though the controller's mode is {mode}" in text_of(event.reason)
    ]
    assert severity_of(said.reason) == "error"
    bench.mode = "AUTO"
    bench.run(1.0, REST)
    bench.run(0.5, FORWARD)
    assert sum("commanded to move" in line for line in bench.log) == 1


def test_the_bridge_says_it_when_it_moves_and_nobody_says_why(bench: Bench) -> None:
    bench.drive_on()
    for _ in range(150):
        bench.run(0.01, None)
        # Of the right token, though without the holder's word of its mode.
        bench.core.on_motion(bench.message(FORWARD), bench.now)
    assert bench.state.moving and any("no controller publishes its mode" in line for line in bench.log)


def test_the_mode_that_somebody_without_the_token_tells_counts_for_nothing(bench: Bench) -> None:
    bench.drive_on()
    bench.mode = "IDLE"
    for _ in range(150):
        bench.run(0.01, FORWARD)
        bench.core.on_token(m.TokenRequest(token="other", echo=bench.echo, mode="AUTO"), bench.now)
    assert any("the controller's mode is IDLE" in line for line in bench.log)
    assert any(row.topic == TOKEN.name and row.count >= 100 for row in bench.state.rejections)


def test_an_older_controllers_cut_is_refused(bench: Bench) -> None:
    bench.run(0.1, REST)
    bench.core.on_cut(cut(bench, "c1", epoch=0), bench.now)
    bench.run(0.1, REST)
    assert bench.robot.cuts == []
    assert any(row.reason == reasons.epoch_old() for row in bench.state.rejections)


def test_what_is_refused_is_counted_and_logged_once(bench: Bench) -> None:
    bench.drive_on()
    for _ in range(50):
        bench.sequence += 1
        bench.core.on_motion(
            m.MotionCommand(
                epoch=1, token=bench.token, sequence=bench.sequence, echo=bench.echo, xi=(100.0, *REST[1:])
            ),  # type: ignore[arg-type]
            bench.now,
        )
        bench.run(0.01, FORWARD)
    assert [row.count for row in bench.state.rejections if row.reason == reasons.velocity_too_high()] == [50]
    assert sum("outside" in line for line in bench.log) == 1
    assert bench.robot.sent[-1].xi == pytest.approx(FORWARD)


def test_the_robot_is_told_which_command_it_follows_and_when_by_the_machines_clock(bench: Bench) -> None:
    bench.run(0.1, REST)
    bench.core.step(bench.now + 1e-3, clock=77.5)
    sent = bench.robot.sent[-1]
    assert (sent.epoch, sent.sequence, sent.at) == (bench.epoch, bench.sequence, 77.5)


def test_what_the_transport_refused_is_told_with_the_bridges_own() -> None:
    table = Rejections()
    core = BridgeCore(IdealRobot(), BridgeConfig(), MODEL.limits, odometer(), "sim", rejections=table)
    table.add("command/motion", said("no message"))
    states = [out.state for out in (core.step(tick * 1e-3) for tick in range(1, 1100)) if out.state is not None]
    assert [(row.topic, row.reason, row.count) for row in states[-1].rejections] == [
        ("command/motion", said("no message"), 1)
    ]


def test_messages_come_at_their_rates_with_growing_sequences(bench: Bench) -> None:
    bench.run(2.0, REST)
    joints = [out.joints for out in bench.outputs if out.joints]
    assert [message.sequence for message in joints] == list(range(1, 201))
    assert [out.odometry.sequence for out in bench.outputs if out.odometry] == list(range(1, 101))
    assert 40 <= len([out for out in bench.outputs if out.state]) <= 44
    frames = [out.frame for out in bench.outputs if out.frame]
    assert [frame.sequence for frame in frames] == [1, 2, 3, 4]
    for out in bench.outputs:
        for message in (out.joints, out.odometry, out.state, out.frame, out.stops, *out.events):
            assert message is None or StrictDecoder(type(message)).decode(encode(message)) == message


def test_what_stands_around_is_told_when_it_has_changed() -> None:
    revision = 3
    core = BridgeCore(IdealRobot(), BridgeConfig(), MODEL.limits, odometer(), "sim", scenery=lambda: (revision, ()))

    def told(first: int, last: int) -> list[int]:
        outs = [core.step(tick * TICK_S).scenery for tick in range(first, last)]
        return [scenery.revision for scenery in outs if scenery is not None]

    assert told(1, 3000) == [3]
    revision = 4
    assert told(3000, 6000) == [4]


def test_odometry_is_the_integral_of_the_wheels(bench: Bench) -> None:
    bench.drive_on()
    bench.run(1.0, FORWARD)
    odometry = next(out.odometry for out in reversed(bench.outputs) if out.odometry)
    wheels = bench.robot.now.position[:2]
    assert odometry.pose.x == pytest.approx(float(wheels[0]) * MODEL.drive.wheel_radius, abs=0.01)
    assert odometry.linear == pytest.approx(0.3)


@settings(max_examples=15, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["move", "old", "fast", "stop", "release", "silence", "other"]),
            st.lists(st.floats(-2.0, 2.0), min_size=9, max_size=9),
        ),
        max_size=25,
    )
)
def test_nothing_beyond_the_limits_is_ever_sent(script: list[tuple[str, list[float]]]) -> None:
    bench = Bench()
    bench.run(0.05, REST)
    for act, xi in script:
        if act == "fast":
            bench.command((float("nan"), *xi[1:]))
            bench.command((1e308, *xi[1:]))
        elif act == "old":
            bench.sequence = max(0, bench.sequence - 3)
            bench.command(tuple(xi))
        elif act == "stop":
            bench.core.on_stop(stop(f"s{bench.now:.3f}"), bench.now)
        elif act == "release":
            bench.core.on_release(release(bench.state.stop_id or "none"), bench.now)
        elif act == "other":
            bench.core.on_token(m.TokenRequest(token=bench.token, releases=True), bench.now)
            bench.epoch += 1
            bench.token += "x"
            bench.run(0.3, REST)
        bench.run(0.06, None if act == "silence" else tuple(xi))
    sent = np.array([setpoint.xi for setpoint in bench.robot.sent])
    assert np.all(np.isfinite(sent))
    assert np.all(np.abs(sent) <= MODEL.limits.velocity + 1e-12)
    assert np.all(np.abs(np.diff(sent, axis=0)) <= MODEL.limits.acceleration * 1e-3 + 1e-12)
    arm = bench.robot.now.position[2:]
    assert np.all((arm > MODEL.limits.lower[5:]) & (arm < MODEL.limits.upper[5:]))


def test_a_picture_is_taken_at_once_for_the_controller_whose_commands_are_taken_and_no_other(bench: Bench) -> None:
    bench.run(0.7, REST)

    def look(epoch: int, number: int) -> list[tuple[str, int]]:
        before = len(bench.outputs)
        bench.core.on_picture(CloseUpRequest(epoch=epoch, number=number, point_id="p4"))
        bench.run(0.05, REST)
        frames = [out.frame for out in bench.outputs[before:] if out.frame is not None]
        assert all(frame.header == m.Header(pytest.approx(bench.now, abs=0.06), "camera") for frame in frames)
        return [(frame.point_id, frame.number) for frame in frames if frame.point_id]

    assert look(bench.epoch + 1, 1) == []
    assert any("close-up" in refusal.topic for refusal in bench.core.refusals.counts())
    assert look(bench.epoch, 2) == [("p4", 2)]


def test_after_a_standstill_of_the_bridge_what_is_sent_begins_with_how_the_robot_really_moves(bench: Bench) -> None:
    bench.drive_on()
    bench.robot.now = replace(bench.robot.now, velocity=np.zeros(9))
    bench.now += 0.5
    bench.run(0.2, FORWARD)
    assert bench.moved_within(0.2) == 0.0
