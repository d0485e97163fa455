"""A robot without mass or contact: velocities follow commands with a first-order lag. For control tests and timing."""

from collections.abc import Callable
from dataclasses import dataclass, field, is_dataclass
from typing import Any

import msgspec
import numpy as np

from bridge.core.validator import Fence
from controller.core import Controller
from controller.ledger.journal import LedgerState, Records
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule, CloseUpRequest, CloseUpResult, Obstacles
from rolling_panda.messages.supervision import Person, Presence, TeleopTarget
from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.model.wire_values import actuated, planar_pose
from rolling_panda.reasons import said, text_of
from rolling_panda.transport.inbox import Inbox

_ALL = frozenset({"bridge", "controller", "perception", "server"})


@dataclass
class KinematicRobot:
    """The robot and its cutter as the controller sees them, stepped together with the controller.

    Attributes:
        controller: What commands it.
        start_arm: Posture at the start (7, rad).
        lag: Time constant of every velocity servo (s).
        dt: Control period (s).
        outcome: How a cut ends.
        server: False takes the server away.
        perception: False takes perception away.
        obstacles: What stands around.
        record: Velocities commanded (9 each).
        people: Names of who is there; whoever asks for something is.
        watching: Whether they see the robot.
        deaf: Types of messages that do not arrive.
        bridge_changes: What the bridge says in place of what is.
        external_torque: Torques of the arm's joints by what touches it (7, N·m); None without an estimate.
    """

    controller: Controller
    start_arm: tuple[float, ...]
    lag: float = 0.03
    dt: float = 0.01
    outcome: m.Outcome = "DONE"
    server: bool = True
    perception: bool = True
    frozen_sensors: bool = False
    teleop: TeleopTarget | None = None
    obstacles: tuple[Capsule, ...] = ()
    record: list[Array] = field(default_factory=list)
    cuts: list[tuple[str, Array]] = field(default_factory=list)
    events: list[str] = field(default_factory=list)
    state: m.ControllerState | None = None
    now: float = 0.0
    stop_id: str = ""
    ledger: LedgerState = LedgerState()
    people: set[str] = field(default_factory=set)
    watching: bool = True
    deaf: set[type] = field(default_factory=set)
    bridge_changes: dict[str, Any] = field(default_factory=dict)
    external_torque: m.ArmTorques | None = None

    def __post_init__(self) -> None:
        """Place the robot at the origin."""
        self.model = RobotModel()
        self.q: Array = np.zeros(12)
        self.q[ARM_Q] = self.start_arm
        self.xi: Array = np.zeros(NXI)
        self._sequence, self._followed, self._moving = 0, 0, False
        self._fence = Fence()
        self._cut_id, self._cut_at = "", 0.0
        self._told_presence = False
        self.inbox = Inbox()
        self._shown: tuple[m.PruningPoint, ...] = ()

    def show(
        self,
        points: tuple[m.PruningPoint, ...],
        rule: m.PruningRule | None = None,
        undecided_sites: tuple[m.UndecidedSite, ...] = (),
    ) -> None:
        """What perception holds true from now on, by a rule, and what it leaves open."""
        header = m.Header(self.now, "odom")
        message = m.PruningPoints(
            header=header, segmenter="none", frames=1, points=points, rule=rule, undecided_sites=undecided_sites
        )
        self._shown = points
        self.hear(message)

    def stop(self, stop_id: str = "stop-1") -> None:
        """Press the software stop."""
        self.hear(m.StopRequest(stop_id=stop_id, source="test", user="ada", reason=said("test")))
        self.stop_id = stop_id

    def hear(self, message: object) -> None:
        """A message arrives at the controller."""
        if type(message) not in self.deaf:
            self.inbox.put(message, self.now)

    def inputs(self) -> Inbox:
        """What the controller is given now."""
        self._sequence += 1
        inbox, now = self.inbox, self.now
        if not self.frozen_sensors or self._sequence == 1:
            self._measure()
        self.hear(self._bridge())
        told = inbox.newest(Obstacles)
        if told is None or told.message.capsules is not self.obstacles or now - told.at > 1.0:
            self.hear(Obstacles(header=m.Header(now, "odom"), capsules=self.obstacles))
        if self.teleop is not None:
            self.hear(msgspec.structs.replace(self.teleop, sequence=round(now / self.dt)))
        if self.server:
            self.hear(self._present())
        for process, there in (("server", self.server), ("perception", self.perception)):
            if there:
                self.hear(m.Heartbeat(process=process, sequence=self._sequence))
        gone = {name for name, there in (("server", self.server), ("perception", self.perception)) if not there}
        inbox.present = _ALL - gone
        self.hear(self.ledger)
        return inbox

    def step(self) -> list[object]:
        """One control period: controller first, then the robot."""
        return self.take(self.controller.step(self.inputs(), self.now))

    def take(self, out: list[object]) -> list[object]:
        """Act on what the controller sent, for one period."""
        command = np.zeros(NXI)
        for message in out:
            match message:
                case m.MotionCommand():
                    command = np.array(message.xi)
                    if self._fence.refuse(message.epoch, message.token) is not None:
                        raise ValueError(f"a command of epoch {message.epoch}, which is not the fence's")
                    self._followed, self._moving = message.sequence, bool(command.any())
                case m.TokenRequest():
                    self._fence.claim(message.token, self.now, not self._moving)
                case CloseUpRequest():
                    if (seen := self.close_up(message)) is not None:
                        self.hear(seen)
                case m.CutCommand() if message.cut_id != self._cut_id:
                    self._cut_id, self._cut_at = message.cut_id, self.now
                    place = self.model.kinematics(self.q).T_odom_tool.homogeneous.copy()
                    self.cuts.append((message.point_id, place))
                case m.ReleaseStop() if message.stop_id == self.stop_id:
                    self.stop_id = ""
                case m.ControllerState():
                    self.state = message
                case Records() if not self.ledger.failure:
                    self.ledger = LedgerState(message.rows[-1].number)
                case m.LogEvent():
                    self.events.append(text_of(message.reason))
                case _ if not isinstance(message, msgspec.Struct) and not is_dataclass(message):
                    raise TypeError(f"the runner cannot send {message!r}")
        self.record.append(command)
        self.integrate(command)
        self.now += self.dt
        return out

    def ask(self, intent: intents.Intent) -> m.Answer:
        """An operator's intent."""
        self.people.add(intent.user)
        if not self._told_presence:
            self.step()
        return self.controller.answer(intent, self.now)

    def _present(self) -> Presence:
        if self.teleop is not None:
            self.people.add(self.teleop.user)
        self._told_presence = bool(self.people)
        age = 0.0 if self.watching else 1e6
        people = tuple(Person(name, name, "supervisor", 0.0, age) for name in sorted(self.people))
        return Presence(sequence=self._sequence, people=people)

    def run(self, seconds: float) -> None:
        """Let time pass."""
        for _ in range(round(seconds / self.dt)):
            self.step()

    def close_up(self, request: CloseUpRequest) -> CloseUpResult | None:
        """A camera that always sees the point: where it was shown, and off once its cut is done.

        Pictures on the way to a cut show nothing; None is for an answer that comes later.
        """
        point = next((each for each in self._shown if each.point_id == request.point_id), None)
        off = self.outcome == "DONE" and any(cut[0] == request.point_id for cut in self.cuts)
        return CloseUpResult(
            header=m.Header(self.now, "odom"),
            point_id=request.point_id,
            number=request.number,
            finding="severed" if off else "unseen" if point is None else "seen",
            position=None if off or point is None else point.position,
            tangent=None if off or point is None else point.tangent,
        )

    def _measure(self) -> None:
        header = m.Header(self.now, "odom")
        v, w = self.model.drive.twist(float(self.xi[0]), float(self.xi[1]))
        position, velocity = actuated(self.q[3:]), actuated(self.xi)
        self.hear(
            m.JointState(
                header=header,
                sequence=self._sequence,
                position=position,
                velocity=velocity,
                external_torque=self.external_torque,
            )
        )
        pose = planar_pose(self.q)
        self.hear(m.Odometry(header=header, sequence=self._sequence, pose=pose, linear=v, angular=w))

    def _bridge(self) -> m.BridgeState:
        done = self._cut_id != "" and self.now - self._cut_at > 0.5
        state = m.BridgeState(
            header=m.Header(self.now),
            kind="sim",
            epoch=self._fence.epoch,
            watchdog=False,
            stop_id=self.stop_id,
            stopped_by=reasons.software_stop("ada", reasons.said("dog")) if self.stop_id else None,
            cutter="closing" if self._cut_id and not done else "open",
            cut_id=self._cut_id,
            outcome=self.outcome if done else "",
            real_time_factor=1.0,
            holder=self._fence.holder,
            sequence=self._followed,
            moving=self._moving,
        )
        return msgspec.structs.replace(state, **self.bridge_changes)

    def integrate(self, command: Array) -> None:
        """What a command makes of the robot in one period."""
        inner = 10
        dt = self.dt / inner
        for _ in range(inner):
            self.xi += (command - self.xi) * min(dt / self.lag, 1.0)
            self.q[:3] = self.model.drive.integrate(self.q[:3], float(self.xi[0] * dt), float(self.xi[1] * dt))
            self.q[3:] += self.xi * dt


class KinematicLoop:
    """What a benchmark needs of a closed loop, with a kinematic robot. Subclasses say what happens in `run`."""

    def __init__(self, robot: KinematicRobot) -> None:
        """Around a robot."""
        self.robot = robot
        self.controller, self.command = robot.controller, robot.ask

    @property
    def now(self) -> float:
        """Time (s)."""
        return self.robot.now

    def run(self, seconds: float) -> None:
        """Run for so long."""
        for _ in range(round(seconds / self.robot.dt)):
            self.robot.step()

    def run_until(self, condition: Callable[[], bool], limit_s: float) -> bool:
        """Run until a condition holds, but not longer than the limit; whether it holds."""
        end = self.now + limit_s
        while self.now < end:
            self.run(0.05)
            if condition():
                return True
        return False
