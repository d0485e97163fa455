"""Simulation of the work as the controller would execute it from the present state.

It runs the controller's own sequence, whole-body method and limits, period by period, on a robot without mass. Cutter
and camera always succeed. The preview is therefore the motion that will be commanded.
"""

import hashlib
import math
from collections import deque
from dataclasses import dataclass

import msgspec
import numpy as np

from controller.config import ControllerConfig
from controller.identity import Token
from controller.ledger.journal import EventLogger, Journal, LedgerState
from controller.motion.follower import Measured
from controller.motion.torque import JointTorque, torque_report
from controller.planning.preview_plan import Preview, PreviewRequest, sweep
from controller.whole_body.collision import CollisionModel
from controller.whole_body.joint_limits import margin
from controller.whole_body.manipulability import arm_omega
from controller.work.movement import MotionResult, Movement
from controller.work.point_queue import PointQueue, Ticket
from controller.work.posture_search import CutPlan, Unreachable
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.config import RobotConfig
from rolling_panda.errors import ControlError
from rolling_panda.messages.perception import ON_THE_WAY, CloseUpResult, Obstacles
from rolling_panda.messages.supervision import PreviewedCut, PreviewRow
from rolling_panda.mode_table import Event
from rolling_panda.model.differential_drive import NXI, Array, DifferentialDrive
from rolling_panda.model.robot import RobotModel
from rolling_panda.model.wire_values import actuated, planar_pose, vector3
from rolling_panda.transport.inbox import Inbox

#: Time between two rows of the preview (s).
ROW_S = 0.1
#: Time from the order to cut to its outcome (s).
CLOSING_S = 0.5
#: Time limit of each point (s).
_LONGEST_S = 90.0
_TOKEN = Token(1, "preview")


class Rollout:
    """Answers preview requests. Equal requests have equal answers, from any instance."""

    def __init__(self, config: ControllerConfig, robot_config: RobotConfig) -> None:
        """Nothing is built yet: each preview begins with a robot of its own."""
        self._config, self._robot_config = config, robot_config

    def roll(self, request: PreviewRequest) -> Preview:
        """The work on the points of a request; takes about a tenth of the time of the work itself.

        Raises:
            ControlError: The request's configuration is not finite.
        """
        if not np.isfinite(request.q).all():
            raise ControlError(f"a preview from {request.q.tolist()} was asked for; every coordinate must be finite")
        return _Run(self._config, self._robot_config, request).all()


class _Run:
    """Computation of one preview."""

    def __init__(self, config: ControllerConfig, robot_config: RobotConfig, request: PreviewRequest) -> None:
        self._configs, self._request, self._dt = (config, robot_config), request, 1.0 / config.rate_hz
        self._journal = Journal()
        # What is not reached at once is refused: the plan is of one try.
        self._queue = PointQueue(config.work, self._journal, tries=1)
        told = m.PruningPoints(header=m.Header(), segmenter="", frames=0, points=request.points, canes=request.canes)
        self._queue.update(told)
        for point in request.points:
            self._queue.accept(point.point_id, point.revision, "preview")
        for point_id, azimuth in request.turned:
            self._queue.approaches.turn(point_id, azimuth, "preview")
        for point_id, tries in request.tries:
            self._queue.tries.put(point_id, tries)
        self._queue.hold(tuple(point.point_id for point in request.points))
        self._movement = Movement(config, robot_config, self._queue, EventLogger(self._journal), "preview", self._known)
        robot = self._movement.body.robot
        self._actuators = ActuatorLag(
            robot.drive, request.q, config.motion.base_lag_s, config.motion.arm_lag_s, self._dt
        )
        self._log = CutLog(robot, self._movement.body.surroundings.model, self._queue)
        self._inbox = Inbox()
        self._inbox.put(Obstacles(header=m.Header(0.0, "map"), capsules=request.obstacles), 0.0)
        self._asked: set[int] = set()
        self._pending: deque[tuple[float, CloseUpResult]] = deque()
        self._closing: tuple[str, str, float] | None = None
        self._cut: set[str] = set()
        self._plans: dict[str, CutPlan] = {}
        self._hash = hashlib.sha256()

    def all(self) -> Preview:
        """Work until the work ends."""
        rows: list[PreviewRow] = []
        times: list[float] = []
        way: list[Array] = []
        rates: list[Array] = []
        every = max(1, round(ROW_S / self._dt))
        longest = math.ceil(_LONGEST_S * len(self._request.points) / self._dt)
        self._movement.sequence.start()
        why: m.Reason | None = reasons.takes_too_long(_LONGEST_S)
        now = 0.0
        for number in range(longest):
            now = number * self._dt
            moved = self._period(number, now)
            if number % every == 0 or moved.event is not None:
                rows.append(self._sample_at(now))
            times.append(now)
            way.append(self._actuators.q.copy())
            rates.append(self._actuators.xi.copy())
            self._hash.update(np.ascontiguousarray(way[-1], dtype="<f8").tobytes())
            if moved.event is not None:
                event, why = moved.event
                why = None if event is Event.FINISHED else why
                break
        samples = Samples(np.array(times), np.array(way), np.array(rates))
        cuts, refused = self._log.cuts(now, why, samples)
        swept = sweep(self._movement.body.surroundings.model, times, way)
        # The robot did not come to any point.
        failure = why if self._request.points and not cuts else None
        return Preview(self._request, cuts, refused, self._plans, tuple(rows), now, self._digest(), failure, swept)

    def _period(self, number: int, now: float) -> MotionResult:
        """One control period, with the robot's response."""
        movement, sequence = self._movement, self._movement.sequence
        inbox, bridge = self._inbox, self._bridge(now)
        self._measure(number, now)
        inbox.put(bridge, now)
        self._journal.drain()
        self._journal.observe(LedgerState(self._journal.number), now)
        movement.update(inbox)
        close_up = inbox.newest(CloseUpResult)
        sequence.watch(bridge, None if close_up is None else close_up.message, None, now)
        moved = movement.step("AUTO", True, now)
        command = movement.send(moved.xi, _TOKEN, inbox.newest(m.JointState), latched=False)
        if moved.cut is not None and (self._closing is None or self._closing[0] != moved.cut[0]):
            self._closing = (*moved.cut, now)
            self._log.closed(moved.cut[1], now)
        due = sequence.picture(now)
        if due is not None and due[0] not in self._asked and not due[1].startswith(ON_THE_WAY):
            # Two points can be due at the same time: that of the previous cut and the next one.
            self._asked.add(due[0])
            self._pending.append((now + self._request.close_up_s, self._shown(*due)))
        if command is not None:
            self._actuators.step(np.array(command.xi))
        return moved

    def _measure(self, number: int, now: float) -> None:
        """The robot's state, and a close-up that has been taken by now, arrive."""
        header = m.Header(now, "odom")
        position, velocity = actuated(self._actuators.q[3:]), actuated(self._actuators.xi)
        linear, angular = self._movement.body.robot.drive.twist(*velocity[:2])
        joints = m.JointState(header=header, sequence=number, position=position, velocity=velocity)
        base = planar_pose(self._actuators.q)
        odometry = m.Odometry(header=header, sequence=number, pose=base, linear=linear, angular=angular)
        if self._pending and now >= self._pending[0][0]:
            self._inbox.put(self._pending.popleft()[1], now)
        self._inbox.put(joints, now)
        self._inbox.put(odometry, now)

    def _bridge(self, now: float) -> m.BridgeState:
        cut_id, point_id, since = self._closing or ("", "", now)
        done = bool(cut_id) and now - since > CLOSING_S
        if done:
            self._cut.add(point_id)
        return m.BridgeState(
            header=m.Header(now),
            kind="sim",
            epoch=_TOKEN.epoch,
            watchdog=False,
            stop_id="",
            stopped_by=None,
            cutter="closing" if cut_id and not done else "open",
            cut_id=cut_id,
            outcome="DONE" if done else "",
            real_time_factor=1.0,
        )

    def _shown(self, number: int, point_id: str) -> CloseUpResult:
        """A close-up result that confirms the expectation."""
        ticket, header = self._queue.get(point_id), m.Header(0.0, "odom")
        if ticket is None or point_id in self._cut:
            return CloseUpResult(header=header, point_id=point_id, number=number, finding="severed")
        point = ticket.point
        return CloseUpResult(
            header=header,
            point_id=point_id,
            number=number,
            finding="seen",
            position=point.position,
            tangent=point.tangent,
        )

    def _known(self, ticket: Ticket) -> CutPlan | Unreachable | None:
        return self._request.cuts.get(ticket.point.point_id)

    def _sample_at(self, now: float) -> PreviewRow:
        measured, sequence = self._movement.body.measured, self._movement.sequence
        assert measured is not None
        self._log.sample(measured, sequence.active, now)
        if sequence.active and sequence.plan is not None:
            self._plans[sequence.active] = sequence.plan
        q = measured.q
        tool = vector3(measured.kinematics.T_odom_tool.translation)
        return PreviewRow(now, planar_pose(q), actuated(q[3:]), tool)

    def _digest(self) -> str:
        encode = msgspec.msgpack.Encoder(order="deterministic").encode
        request, out = self._request, self._hash
        wanted = request.turned, request.tries
        for part in (*self._configs, request.points, request.obstacles, request.canes, *wanted, request.close_up_s):
            out.update(encode(part))
        out.update(np.ascontiguousarray(request.q, dtype="<f8").tobytes())
        return out.hexdigest()


@dataclass
class _Least:
    """Smallest figures since the start of a point."""

    point_id: str
    begins: float
    closed: float | None = None
    clearance: float = 1e3
    between: tuple[str, str] = ("", "")
    omega: float = 1e3
    margin: float = 1e3


class CutLog:
    """Collects the figures of each cut: call `sample` regularly and `cuts` at the end."""

    def __init__(self, robot: RobotModel, collision: CollisionModel, queue: PointQueue) -> None:
        """Start without cuts.

        Args:
            robot: Robot model.
            collision: Collision model with the obstacles and the allowed contacts of the blades.
            queue: The queue, for the outcome of each point.
        """
        self._robot, self._collision, self._queue = robot, collision, queue
        self._points: list[_Least] = []

    def sample(self, robot: Measured, active: str, now: float) -> None:
        """Record the robot's state during the motion to, at or from the `active` point; empty for the last one."""
        if active and (not self._points or self._points[-1].point_id != active):
            begins = now if self._points else 0.0
            self._points.append(_Least(active, begins))
        if not self._points:
            return
        least = self._points[-1]
        near = self._collision.least(robot.q)
        if near.distance < least.clearance:
            least.clearance, least.between = near.distance, near.pair
        least.omega = min(least.omega, arm_omega(robot.kinematics.J))
        least.margin = min(least.margin, margin(robot.q, self._robot.limits))

    def closed(self, point_id: str, now: float) -> None:
        """The blades close on a point."""
        for least in self._points:
            if least.point_id == point_id and least.closed is None:
                least.closed = now

    def cuts(
        self, now: float, why: m.Reason | None, samples: "Samples"
    ) -> tuple[tuple[PreviewedCut, ...], dict[str, m.Reason]]:
        """All cuts, and the reason for each that was not made, by id.

        Args:
            now: End of the work (s).
            why: Reason of an early end; None otherwise.
            samples: The whole motion.
        """
        refused: dict[str, m.Reason] = {}
        out = []
        for number, least in enumerate(self._points):
            ends = now if number + 1 == len(self._points) else self._points[number + 1].begins
            torque = samples.tightest(self._robot, least.begins, ends)
            ticket, closed = self._queue.get(least.point_id), least.closed
            if closed is None:
                open_still = ticket is None or ticket.state in ("ACCEPTED", "CUTTING")
                reason = why if ticket is None or open_still else ticket.reason
                refused[least.point_id] = reason or reasons.work_ended_before()
            elif torque.margin < 0.0:
                closed = None
                refused[least.point_id] = reasons.torque_lacking(torque.joint, torque.peak, torque.limit)
            out.append(
                PreviewedCut(
                    point_id=least.point_id,
                    revision=0 if ticket is None else ticket.point.revision,
                    begins_s=least.begins,
                    cut_s=closed,
                    ends_s=ends,
                    reason=refused.get(least.point_id),
                    clearance=least.clearance,
                    between=least.between,
                    manipulability=least.omega,
                    joint_margin=least.margin,
                    torque_margin=torque.margin,
                    torque_joint=torque.joint,
                )
            )
        return tuple(out), refused


@dataclass(frozen=True)
class Samples:
    """A motion in every control period: times (T, s), configurations (T×12) and velocities ξ̇ (T×9)."""

    times: Array
    q: Array
    xi: Array

    def tightest(self, robot: RobotModel, begins: float, ends: float) -> JointTorque:
        """The actuator that uses the largest fraction of its torque between two times (s)."""
        first, last = np.searchsorted(self.times, [begins, ends])
        first = min(int(first), len(self.times) - 2)
        part = slice(first, max(int(last) + 1, first + 2))
        return torque_report(robot, self.times[part], self.q[part], self.xi[part]).tightest


class ActuatorLag:
    """Response of the actuators to the commands. Call `step` once for each control period."""

    def __init__(self, drive: DifferentialDrive, q: Array, wheel_lag_s: float, arm_lag_s: float, dt: float) -> None:
        """At rest.

        Args:
            drive: Of the base.
            q: Configuration (12).
            wheel_lag_s: Time constant of the wheels (s).
            arm_lag_s: Of the arm's joints (s).
            dt: Control period (s).
        """
        self._drive, self._dt = drive, dt
        self.q, self.xi = q.copy(), np.zeros(NXI)
        lags = (*[wheel_lag_s] * 2, *[arm_lag_s] * (NXI - 2))
        self._left = np.array([math.exp(-dt / lag) if lag > 0.0 else 0.0 for lag in lags])
        self._late = np.array(lags) * (1.0 - self._left)

    def step(self, command: Array) -> None:
        """One period with ξ̇ (9, rad/s) sent at its beginning."""
        behind = self.xi - command
        turned = command * self._dt + behind * self._late
        self.xi = command + behind * self._left
        self.q[:3] = self._drive.integrate(self.q[:3], float(turned[0]), float(turned[1]))
        self.q[3:] += turned
