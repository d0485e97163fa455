"""Core of the bridge: commands in, one tick of 1 ms, messages out. No wire.

Latch, watchdog and limits belong to the bridge: no other process can override them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bridge.config import BridgeConfig
from bridge.core.calibration import Calibration
from bridge.core.camera_trigger import CameraTrigger, Posture
from bridge.core.cut_orders import FORGETFUL, CutMemory, CutOrders
from bridge.core.interface import Measurement, Robot, Setpoint
from bridge.core.latch import StopLatch, told
from bridge.core.limiter import Limiter, Watchdog
from bridge.core.odometer import Odometer
from bridge.core.refusals import Refusals
from bridge.core.robot_faults import RobotFaults, draw_id
from bridge.core.robot_time import RoundTrip, TimeRatio
from bridge.core.state_memory import Remembered
from bridge.core.validator import SILENT_S, CommandValidator, Fence
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule, CloseUpRequest, MovedCapsule, Scenery, SceneryMotion
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.messages.supervision import StopState
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import Limits
from rolling_panda.model.wire_values import actuated, arm_torques
from rolling_panda.runtime.latest_file import KeptValue
from rolling_panda.topics import BRIDGE, CLOSE_UP_REQUEST, CUT, MOTION, ODOMETRY, SCENERY_MOTION, TOKEN
from rolling_panda.transport.rejections import Rejections

TICK_S = 0.001
_ODOMETRY_TICKS = round(1 / ODOMETRY.rate_hz / TICK_S)
_SCENERY_MOTION_TICKS = round(1 / SCENERY_MOTION.rate_hz / TICK_S)
_STATE_TICKS = round(1 / BRIDGE.rate_hz / TICK_S)
# Speed limits of wheels and joints for closing the blades (rad/s): 5 mm/s at the axle, and the motion that holding
# the tool in place needs.
_CUT_WHEELS, _CUT_JOINTS = 0.04, 0.1
MOVING_CUT = reasons.cut_in_motion()
# Time without a step (s) after which the robot's own deadlines have begun to stop it. The setpoint then restarts from
# the measured motion.
_STANDSTILL_S = 0.05
# Modes of the holder in which nothing moves, except for braking, and the time limit of braking (s).
_STILL: tuple[m.Mode, ...] = ("IDLE", "FAULT", "ESTOP_LATCHED")
_BRAKING_S = 0.3
# Largest external torque that is told (N·m), far beyond what a joint bears.
_MOST_TORQUE = 1000.0
# Speed above which the camera uses its moving rate (rad/s).
_MOVING = 0.01

SceneryOf = Callable[[], tuple[int, tuple[Capsule, ...]]]
SceneryMotionOf = Callable[[], tuple[int, tuple[MovedCapsule, ...]] | None]


@dataclass(frozen=True)
class BridgeOutputs:
    """Messages to send after a tick; None or empty if nothing is due."""

    joints: m.JointState | None = None
    odometry: m.Odometry | None = None
    state: m.BridgeState | None = None
    frame: CameraFrame | None = None
    scenery: Scenery | None = None
    scenery_motion: SceneryMotion | None = None
    events: tuple[m.LogEvent, ...] = ()
    stops: StopState | None = None

    @property
    def messages(self) -> list[m.Message]:
        """All of them, in the order in which they are sent."""
        states = (self.joints, self.odometry, self.state, self.frame, self.stops)
        each = (*states, self.scenery, self.scenery_motion, *self.events)
        return [message for message in each if message is not None]


class BridgeCore:
    """The bridge between the wire and a robot. Not thread-safe. `now` is the robot's time (s); it never decreases.

    `clock` is the machine's clock, for the record and the real-time factor. It differs from `now` when a simulation is
    slower than real time.
    """

    def __init__(
        self,
        robot: Robot,
        config: BridgeConfig,
        limits: Limits,
        odometer: Odometer,
        kind: m.BridgeKind,
        scenery: SceneryOf | None = None,
        rejections: Rejections | None = None,
        cuts: CutMemory | None = None,
        memory: KeptValue[Remembered] | None = None,
        relaxed_limits: tuple[m.Reason, ...] = (),
        draw: Callable[[], str] = draw_id,
        calibration: Calibration | None = None,
        scenery_motion: SceneryMotionOf | None = None,
    ) -> None:
        """Start with the watchdog tripped, at rest, without a stop.

        Args:
            robot: Simulated or real.
            config: Deadlines and rates.
            limits: Limits of the robot over ξ.
            odometer: Odometry from the wheels.
            kind: Kind of the robot, for display.
            scenery: Revision and rods of the simulated row; None on a real robot.
            rejections: Table of refusals shared with the transport.
            cuts: Durable memory of cuts; None keeps them for the life of the process.
            memory: State that survives a restart; None keeps nothing.
            relaxed_limits: Safety limits that the configuration sets less strictly than usual, to report.
            draw: Draws the random part of the bridge's own stops.
            calibration: Of wheels and joints; None takes them to be as drawn.
            scenery_motion: Revision and displaced rods of the simulated row when they have moved, else None; None on a
                real robot.
        """
        self.robot = robot
        self._calibration = calibration or Calibration(odometer.drive.sizes, float(limits.velocity[0]))
        self.refusals = Refusals(rejections)
        self.kind = kind
        self._odometer = odometer
        self._scenery = scenery
        self._scenery_revision = -1
        self._scenery_motion = scenery_motion
        self._memory = memory or KeptValue(Remembered())
        before = self._memory.value
        self._fence = Fence(before.epoch, before.token)
        self._validator = CommandValidator(limits.velocity, config.max_age_s, self._fence)
        #: Whether the holder of the token is on disk; it is reported only then.
        self._fence_kept = True
        self._mode: tuple[m.Mode | None, float] = None, 0.0
        self._wanted, self._unwanted_said = 0.0, False
        self._latch = StopLatch(before.stops, before.released, before.released_by)
        self._watchdog = Watchdog(config.fade_s, config.deadline_s)
        self._limiter = Limiter(limits, config.wheel_acceleration, config.joint_margin, TICK_S)
        self._draw = draw
        self._faults = RobotFaults(draw)
        self._orders = CutOrders(cuts)
        self._configured_delay = config.frame_time_offset
        self._camera_trigger = CameraTrigger(config.camera_moving_hz, config.camera_resting_hz, TICK_S)
        self._pace = TimeRatio()
        self._ticks = 0
        self._joint_ticks = round(1 / config.joints_hz / TICK_S)
        self._round_trip = RoundTrip()
        self._clock = self._wall = 0.0
        self._stepped = float("-inf")
        self._stops_due = True
        self._desired: Array = np.zeros_like(limits.velocity)
        self._was_tripped = True
        self._measured = self._calibration.measured(robot.read())
        self._odometer.follow(self._measured, 0.0)
        self._inertial_lost = False
        self._calibrations_old: tuple[m.Reason, ...] = ()
        self._cut_id = ""
        self._outcome: m.Outcome = ""
        self._relaxed_limits = relaxed_limits
        self._events = [reasons.limits_relaxed(each) for each in relaxed_limits]
        self._state_due = True

    @property
    def joints_s(self) -> float:
        """Period of the joint states (s)."""
        return self._joint_ticks * TICK_S

    def on_motion(self, command: m.MotionCommand, now: float, clock: float | None = None) -> None:
        """Take a motion command received at `now`; a refused one is counted and changes nothing."""
        reason = self._validator.refuse(command, now)
        if reason is not None:
            self.refusals.add(MOTION.name, reason)
            return
        self._desired = np.array(command.xi)
        self._watchdog.feed(now, self._limiter.braking_s(self._desired))
        self._round_trip.back(command.echo, self._clock if clock is None else clock)

    def on_token(self, request: m.TokenRequest, now: float) -> None:
        """Give the fencing token out, let its holder keep it, or take it back."""
        epoch = self._fence.epoch
        if request.releases:
            if self._fence.release(request.token):
                self._halt()
                self._token_changed(reasons.token_given_back(epoch))
            return
        reason = self._validator.claim(request, now, not np.any(self._limiter.sent))
        if reason is not None:
            self.refusals.add(TOKEN.name, reason)
            return
        self._mode = request.mode, now
        if self._fence.epoch != epoch:
            # The token changes hands at rest only, and the validator asks the new holder for rest first.
            self._token_changed(reasons.token_issued(self._fence.epoch))

    def _token_changed(self, told: m.Reason) -> None:
        self._log(told)
        self._remember()
        self._fence_kept, self._state_due = False, True

    def on_cut(self, command: m.CutCommand, now: float) -> None:
        """Close the blades, once for a `cut_id`."""
        inhibited = None
        if self._latch.stop_id:
            inhibited = reasons.stop_latched()
        elif self._faults.current:
            inhibited = reasons.robot_faulty(self._faults.current)
        elif self._watchdog.tripped(now) or self._validator.must_rest:
            inhibited = reasons.cutter_inhibited()
        wrong = self._validator.refuse_cut(command, now) or self._unsteady()
        verdict, reason = self._orders.judge(command, wrong, self._measured.cutter == "open", inhibited)
        if reason is not None:
            self.refusals.add(CUT.name, reason)
        if verdict == "cut":
            self.robot.cut(command.cut_id, command.point_id)
            self._measured = replace(self._measured, cutter="closing")
            self._begin_cut(command.cut_id, "")
        elif verdict == "refuse" and reason in (inhibited, FORGETFUL):
            self._begin_cut(command.cut_id, "FAILED_NOT_CUT")

    def on_picture(self, request: CloseUpRequest) -> None:
        """Take a picture as soon as the camera is free; only for the token's holder."""
        if request.epoch != self._fence.epoch:
            self.refusals.add(CLOSE_UP_REQUEST.name, reasons.not_in_command())
            return
        self._camera_trigger.want(request)

    def _unsteady(self) -> m.Reason | None:
        speed = np.abs(self._measured.velocity)
        still = speed[:2].max() <= _CUT_WHEELS and speed[2:].max() <= _CUT_JOINTS
        return None if still else MOVING_CUT

    def on_stop(self, request: m.StopRequest, now: float, wall_time: float = 0.0) -> None:
        """Latch a stop; repetitions change nothing. `wall_time` (s since 1970) is for people."""
        if self._latch.stop(request, wall_time):
            self._log(told(request))
            self._stops_changed()

    def _stops_changed(self) -> None:
        self._state_due = self._stops_due = True
        self._remember()

    def _watch_button(self, now: float) -> None:
        pressed = self._measured.emergency
        if pressed and not self._latch.hardware:
            stop_id = f"hardware-{self._draw()}"
            pressed_there = reasons.button_pressed()
            self.on_stop(
                m.StopRequest(stop_id=stop_id, source="hardware", user="", reason=pressed_there), now, self._wall
            )
        if pressed != self._latch.hardware:
            self._latch.hardware, self._stops_due = pressed, True

    def on_release(self, request: m.ReleaseStop, now: float) -> m.Answer:
        """Release the latched stop that the request names. Nothing moves before a setpoint at rest has come."""
        reason = self._latch.release(request)
        if reason is not None:
            return m.Answer(ok=False, reason=reason)
        self._halt()
        self._faults.released(now)
        self._stops_changed()
        self._log(reasons.stop_reset(request.user, request.reason))
        return m.Answer(ok=True)

    def on_calibration(self, request: m.UseCalibration) -> m.Answer:
        """Use a calibration of the robot once it is on disk; at rest only."""
        refused = None
        if bool(np.any(self._limiter.sent)):
            refused = reasons.calibration_in_motion()
        elif (asked := request.base or request.arm or request.timing) is not None:
            refused = self._calibration.request(asked)
        return m.Answer(ok=refused is None, reason=refused)

    def answer(self, request: m.ReleaseStop | m.UseCalibration, now: float) -> m.Answer:
        """Answer a request of the controller."""
        if isinstance(request, m.UseCalibration):
            return self.on_calibration(request)
        return self.on_release(request, now)

    def step(self, now: float, clock: float | None = None, wall_time: float = 0.0) -> BridgeOutputs:
        """Advance one tick of 1 ms; `clock` is `now` unless given, `wall_time` (s since 1970) is for people."""
        self._clock, self._wall = now if clock is None else clock, wall_time
        if now - self._stepped > _STANDSTILL_S:
            self._measured = self._calibration.measured(self.robot.read())
            self._limiter.restart(self._measured.velocity)
        self._stepped = now
        self._watch_button(now)
        tripped = self._watch(now)
        stopped = bool(self._latch.stop_id)
        speed_scale = 0.0 if stopped or self._faults.current else self._watchdog.trust(now)
        arm = self._calibration.own_angles(self._measured.position[2:])
        xi = self._limiter.step(speed_scale * self._desired, arm)
        blades = not (stopped or tripped)
        releases = self._faults.releases
        real = self._calibration.commanded(xi)
        self.robot.write(Setpoint(real, blades, self._fence.epoch, self._validator.sequence, self._clock, releases))
        self._measured = self._calibration.measured(self.robot.read())
        self._odometer.feel(self._measured)
        self._ticks += 1
        self._follow_cut()
        if (used := self._calibration.kept(not xi.any())) is not None:
            self._log(used)
            self._state_due = True
        return self._outputs(now)

    def _watch(self, now: float) -> bool:
        self._watch_robot(now)
        tripped = self._watchdog.tripped(now) or bool(self._faults.current)
        if tripped and not self._was_tripped:
            self._halt()
            if not self._faults.current:
                self._log(reasons.setpoints_missing())
        elif self._was_tripped and not tripped:
            self._log(reasons.setpoints_arrive())
        if tripped != self._was_tripped:
            self._state_due = True
        self._was_tripped = tripped
        return tripped

    def _watch_robot(self, now: float) -> None:
        measured = self._measured
        # A bridge that cannot store stops and tokens could move the robot after a restart.
        fault = measured.fault or self._memory.failure
        change = self._faults.follow(fault, measured.severe, bool(self._latch.stop_id), now)
        if change is not None:
            self._halt()
            self._log(change.told)
            if change.stop is not None:
                self.on_stop(change.stop, now, self._wall)

    def _halt(self) -> None:
        self._desired = np.zeros_like(self._desired)
        self._validator.require_rest()

    def _remember(self) -> None:
        latch = self._latch
        self._memory.keep(Remembered(self._fence.epoch, self._fence.token, latch.stops, latch.over, latch.released_by))

    def _begin_cut(self, cut_id: str, outcome: m.Outcome) -> None:
        self._cut_id, self._outcome = cut_id, outcome
        self._state_due = True

    def _follow_cut(self) -> None:
        measured = self._measured
        if measured.cut_id == self._cut_id and measured.outcome != self._outcome:
            self._outcome = measured.outcome
            done = measured.outcome == "DONE"
            self._log(
                reasons.cut_reported(self._cut_id, measured.detail)
                if done
                else reasons.cut_not_done(self._cut_id, measured.outcome, measured.detail)
            )
            self._camera_trigger.wake(self._ticks)
            self._state_due = True

    def _log(self, told: m.Reason) -> None:
        self._events.append(told)

    def _outputs(self, now: float) -> BridgeOutputs:
        joints = odometry = state = frame = motion = None
        ticks = self._ticks
        if ticks % self._joint_ticks == 0:
            self._follow_odometry(now)
            joints = self._joint_state(now)
            self._validator.sent(joints.sequence, now)
            self._round_trip.out(joints.sequence, self._clock)
            frame = self._frame(now)
            if ticks % _ODOMETRY_TICKS == 0:
                self._odometer.measure(ticks, now, self._measured.velocity[:2])
            odometry = self._odometer.due(ticks)
        if not self._fence_kept and self._memory.kept:
            self._fence_kept = self._state_due = True
        if self._state_due or ticks % _STATE_TICKS == 0:
            state = self._state(now)
            self._events += self.refusals.lines(now)
        stops = None
        # A stop is reported as latched when it is on disk. A failure of the disk is reported too.
        if self._stops_due and (self._memory.kept or self._memory.failure):
            self._stops_due = False
            stops = StopState(
                process="bridge",
                stops=self._latch.stops,
                released_by=self._latch.released_by,
                hardware=self._latch.hardware,
            )
        scenery = None if self._scenery is None else self._scenery_message(self._scenery, now)
        if self._scenery_motion is not None and ticks % _SCENERY_MOTION_TICKS == 0:
            motion = self._scenery_motion_message(self._scenery_motion, now)
        events, self._events = self._events, []
        return BridgeOutputs(
            joints,
            odometry,
            state,
            frame,
            scenery,
            motion,
            tuple(m.LogEvent(header=m.Header(now), process="bridge", reason=told) for told in events),
            stops,
        )

    def _follow_odometry(self, now: float) -> None:
        before = self._odometer.attitude
        self._odometer.follow(self._measured, now)
        after = self._odometer.attitude
        if before is None or after is None or before.measured == after.measured:
            return
        if not after.measured:
            self._log(reasons.inertial_lost())
        elif self._inertial_lost:
            self._log(reasons.inertial_works())
        self._inertial_lost = not after.measured

    def _joint_state(self, now: float) -> m.JointState:
        torque = self._measured.external_torque
        # One value that is no number would have the whole joint state refused.
        felt = None
        if torque is not None and np.isfinite(torque).all():
            felt = arm_torques(np.clip(torque, -_MOST_TORQUE, _MOST_TORQUE))
        return m.JointState(
            header=m.Header(now),
            sequence=self._ticks // self._joint_ticks,
            position=actuated(self._measured.position),
            velocity=actuated(self._measured.velocity),
            external_torque=felt,
        )

    def _state(self, now: float) -> m.BridgeState:
        self._state_due = False
        self._round_trip.forget(self._clock)
        moving = bool(np.any(self._limiter.sent))
        self._watch_mode(moving, now)
        self._watch_calibrations()
        return m.BridgeState(
            header=m.Header(now),
            kind=self.kind,
            epoch=self._fence.epoch,
            watchdog=self._was_tripped,
            stop_id=self._latch.stop_id,
            stopped_by=self._latch.stopped_by,
            cutter=self._measured.cutter,
            cut_id=self._cut_id,
            outcome=self._outcome,
            real_time_factor=self._pace.factor(self._ticks * TICK_S, self._clock),
            round_trip_s=self._round_trip.median,
            round_trip_worst_s=self._round_trip.worst,
            rejections=self.refusals.counts(),
            battery=self._measured.battery,
            arm_success=self._measured.arm_success,
            relaxed_limits=self._relaxed_limits,
            holder=self._fence.holder if self._fence_kept else "",
            sequence=max(0, self._validator.sequence),
            moving=moving,
            base=self._calibration.base,
            arm=self._calibration.arm,
            timing=self._calibration.timing,
            calibration_warnings=self._calibrations_old,
        )

    def _watch_calibrations(self) -> None:
        """Log each calibration once that is found to be old."""
        before = {each.code for each in self._calibrations_old}
        self._calibrations_old = self._calibration.warnings(self._wall)
        self._events += [each for each in self._calibrations_old if each.code not in before]

    def _watch_mode(self, moving: bool, now: float) -> None:
        """Log that the robot moves although the newest mode of the token's holder allows no motion."""
        mode, at = self._mode
        if not moving or (mode is not None and mode not in _STILL and now - at <= SILENT_S):
            self._wanted, self._unwanted_said = now, False
        elif now - self._wanted > _BRAKING_S and not self._unwanted_said:
            self._unwanted_said = True
            told = reasons.moved_without_mode() if mode not in _STILL else reasons.moved_in_mode(str(mode))
            self._log(told)

    @property
    def _delay(self) -> float:
        """By how much pictures are exposed later than their times tell (s)."""
        timing = self._calibration.timing
        return self._configured_delay if timing is None else timing.delay

    def _frame(self, now: float) -> CameraFrame | None:
        measured: Measurement = self._measured
        if bool(np.abs(measured.velocity).max() > _MOVING):
            self._camera_trigger.wake(self._ticks)
        posture = Posture(
            self._clock,
            m.Header(now, "camera"),
            self._odometer.pose,
            actuated(measured.position),
            self._calibration.sizes,
            self._calibration.joint_offsets,
            actuated(measured.velocity),
            self._odometer.attitude,
        )
        self._camera_trigger.follow(posture)
        expose = self._camera_trigger.due(self._ticks)
        if expose:
            self._camera_trigger.exposed(self._ticks, posture)
        picture = self.robot.capture(expose)
        return None if picture is None else self._camera_trigger.frame(picture, self._delay)

    def _scenery_message(self, scenery: SceneryOf, now: float) -> Scenery | None:
        """What stands around, when it has changed."""
        revision, capsules = scenery()
        if revision == self._scenery_revision:
            return None
        self._scenery_revision = revision
        return Scenery(header=m.Header(now, "map"), revision=revision, capsules=capsules)

    def _scenery_motion_message(self, motion: SceneryMotionOf, now: float) -> SceneryMotion | None:
        """What wind and arm have displaced, when it has moved."""
        moved = motion()
        if moved is None:
            return None
        return SceneryMotion(header=m.Header(now, "map"), revision=moved[0], moved=moved[1])
