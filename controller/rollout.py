"""What the robot would do now: the work itself, rolled forward from where the robot is against the world as known.

It is the controller's own sequence, whole-body law and limits, period by period, on a robot without mass. Cutter and
camera answer as they should. Nothing is planned a second time, so that what is shown is what will be sent.
"""

import hashlib
import math
from collections import deque

import msgspec
import numpy as np

from controller.config import ControllerConfig
from controller.interface import Inputs, Sample
from controller.journal import Journal, LedgerState
from controller.lease import Token
from controller.lines import Lines
from controller.modes import Event
from controller.movement import Moved, Movement
from controller.planning.cuts import CLOSING_S
from controller.preview_plan import Preview, PreviewRequest
from controller.queue import PointQueue, Ticket
from controller.reach import CutPlan, Unreachable
from controller.rollout_cuts import CutLog
from controller.servos import Servos
from controller.swept import sweep
from rolling_panda import messages as m
from rolling_panda.config import RobotConfig
from rolling_panda.differential_drive import Array
from rolling_panda.errors import ControlError
from rolling_panda.look_messages import CloseLook
from rolling_panda.preview_messages import PreviewRow
from rolling_panda.row_messages import Obstacles

#: Between two rows of the motion that is shown (s).
ROW_S = 0.1
#: A preview ends after so long a point (s).
_LONGEST_S = 90.0
_TOKEN = Token(1, "preview")


class Rollout:
    """Answers preview requests. The same request, asked of any instance, has the same answer."""

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
    """One preview under way."""

    def __init__(self, config: ControllerConfig, robot_config: RobotConfig, request: PreviewRequest) -> None:
        self._configs, self._request, self._dt = (config, robot_config), request, 1.0 / config.rate_hz
        self._journal = Journal()
        self._queue = PointQueue(config, self._journal)
        self._queue.update(m.PruningPoints(header=m.Header(), segmenter="", frames=0, points=request.points))
        for point in request.points:
            self._queue.accept(point.point_id, point.revision, "preview")
        for point_id, azimuth in request.turned:
            self._queue.approaches.turn(point_id, azimuth, "preview")
        self._queue.arrange(tuple(point.point_id for point in request.points))
        self._movement = Movement(config, robot_config, self._queue, Lines(self._journal), "preview", self._known)
        robot = self._movement.body.robot
        self._servos = Servos(robot.drive, request.q, config.base_lag_s, config.arm_lag_s, self._dt)
        self._log = CutLog(robot.limits, self._movement.body.surroundings.model, self._queue)
        self._obstacles = Sample(Obstacles(header=m.Header(0.0, "odom"), capsules=request.obstacles), 0.0)
        self._asked: set[int] = set()
        self._coming: deque[tuple[float, CloseLook]] = deque()
        self._look: Sample[CloseLook] | None = None
        self._closing: tuple[str, str, float] | None = None
        self._cut: set[str] = set()
        self._plans: dict[str, CutPlan] = {}
        self._hash = hashlib.sha256()

    def all(self) -> Preview:
        """Work until the work ends."""
        rows: list[PreviewRow] = []
        times: list[float] = []
        way: list[Array] = []
        every = max(1, round(ROW_S / self._dt))
        longest = math.ceil(_LONGEST_S * len(self._request.points) / self._dt)
        self._movement.sequence.begin()
        why = f"it takes longer than {_LONGEST_S:.0f} s a point"
        now = 0.0
        for number in range(longest):
            now = number * self._dt
            moved = self._period(number, now)
            if number % every == 0 or moved.event is not None:
                rows.append(self._look_at(now))
            times.append(now)
            way.append(self._servos.q.copy())
            self._hash.update(np.ascontiguousarray(way[-1], dtype="<f8").tobytes())
            if moved.event is not None:
                event, why = moved.event
                why = "" if event is Event.FINISHED else why
                break
        cuts = self._log.cuts(now, why)
        swept = sweep(self._movement.body.surroundings.model, times, way)
        return Preview(self._request, cuts, self._plans, tuple(rows), now, self._digest(), swept=swept)

    def _period(self, number: int, now: float) -> Moved:
        """One control period, and what the robot does of it."""
        movement, sequence = self._movement, self._movement.sequence
        inputs = self._inputs(number, now)
        self._journal.take()
        self._journal.observe(LedgerState(self._journal.number), now)
        movement.take(inputs)
        look = None if inputs.look is None else inputs.look.message
        assert inputs.bridge is not None
        sequence.watch(inputs.bridge.message, look, now)
        moved = movement.step("AUTO", True, now)
        command = movement.send(moved.xi, _TOKEN, inputs.joints, latched=False)
        if moved.cut is not None and (self._closing is None or self._closing[0] != moved.cut[0]):
            self._closing = (*moved.cut, now)
            self._log.closed(moved.cut[1], now)
        due = sequence.picture(now)
        if due is not None and due[0] not in self._asked:
            # Of two points at the same time, too: of the cut before, and of the next one.
            self._asked.add(due[0])
            self._coming.append((now + self._request.look_s, self._shown(*due)))
        if command is not None:
            self._servos.step(np.array(command.xi))
        return moved

    def _inputs(self, number: int, now: float) -> Inputs:
        header = m.Header(now, "odom")
        a, b, c, d, e, f, g, h, i = self._servos.q[3:].tolist()
        j, k, n, o, p, r, s, t, u = self._servos.xi.tolist()
        drive = self._movement.body.robot.drive
        linear, angular = drive.twist(j, k)
        joints = m.JointState(
            header=header, sequence=number, position=(a, b, c, d, e, f, g, h, i), velocity=(j, k, n, o, p, r, s, t, u)
        )
        base = _planar(self._servos.q)
        odometry = m.Odometry(header=header, sequence=number, pose=base, linear=linear, angular=angular)
        if self._coming and now >= self._coming[0][0]:
            self._look = Sample(self._coming.popleft()[1], now)
        bridge = Sample(self._bridge(now), now)
        return Inputs(Sample(joints, now), Sample(odometry, now), bridge, obstacles=self._obstacles, look=self._look)

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
            stopped_by="",
            cutter="closing" if cut_id and not done else "open",
            cut_id=cut_id,
            outcome="DONE" if done else "",
            real_time_factor=1.0,
        )

    def _shown(self, number: int, point_id: str) -> CloseLook:
        """A picture that shows what is expected."""
        ticket, header = self._queue.get(point_id), m.Header(0.0, "odom")
        if ticket is None or point_id in self._cut:
            return CloseLook(header=header, point_id=point_id, number=number, finding="severed")
        point = ticket.point
        return CloseLook(
            header=header,
            point_id=point_id,
            number=number,
            finding="seen",
            position=point.position,
            tangent=point.tangent,
        )

    def _known(self, ticket: Ticket) -> CutPlan | Unreachable | None:
        return self._request.cuts.get(ticket.point.point_id)

    def _look_at(self, now: float) -> PreviewRow:
        measured, sequence = self._movement.body.measured, self._movement.sequence
        assert measured is not None
        self._log.look(measured, sequence.active, now)
        if sequence.active and sequence.plan is not None:
            self._plans[sequence.active] = sequence.plan
        q = measured.q
        x, y, z = measured.kinematics.T_odom_tool.translation.tolist()
        a, b, c, d, e, f, g, h, i = q[3:].tolist()
        return PreviewRow(now, _planar(q), (a, b, c, d, e, f, g, h, i), (x, y, z))

    def _digest(self) -> str:
        encode = msgspec.msgpack.Encoder(order="deterministic").encode
        request, out = self._request, self._hash
        for part in (*self._configs, request.points, request.obstacles, request.turned, request.look_s):
            out.update(encode(part))
        out.update(np.ascontiguousarray(request.q, dtype="<f8").tobytes())
        return out.hexdigest()


def _planar(q: Array) -> m.PlanarPose:
    x, y, phi = q[:3].tolist()
    return m.PlanarPose(x, y, phi)
