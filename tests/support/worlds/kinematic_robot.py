"""A robot without mass or contact: velocities follow commands with a first-order lag. For control tests and timing."""

from dataclasses import dataclass, field

import msgspec
import numpy as np

from bridge.core.fence import Fence
from controller.core import Controller
from controller.inputs import Sample
from controller.interface import Outputs, StepInputs
from controller.ledger.journal import LedgerState
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.messages.perception import Capsule, CloseUpRequest, CloseUpResult, Obstacles
from rolling_panda.messages.supervision import Person, Presence, TeleopTarget
from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.model.wire_values import actuated, planar_pose

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
        self._points: Sample[m.PruningPoints] | None = None
        self._told: Sample[Obstacles] | None = None
        self._stops: tuple[m.StopRequest, ...] = ()
        self._close_up: Sample[CloseUpResult] | None = None
        self._joints: Sample[m.JointState] | None = None
        self._odometry: Sample[m.Odometry] | None = None

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
        self._points = Sample(message, self.now)

    def stop(self, stop_id: str = "stop-1") -> None:
        """Press the software stop."""
        self._stops = (m.StopRequest(stop_id=stop_id, source="test", user="ada", reason="test"),)
        self.stop_id = stop_id

    def inputs(self) -> StepInputs:
        """What the controller is given now."""
        self._sequence += 1
        if not self.frozen_sensors or self._joints is None:
            self._measure()
        seen = self.now
        present = _ALL - ({"server"} if not self.server else set()) - ({"perception"} if not self.perception else set())
        stops, self._stops = self._stops, ()
        return StepInputs(
            joints=self._joints,
            odometry=self._odometry,
            bridge=Sample(self._bridge(), self.now),
            points=self._points,
            obstacles=self._around(),
            teleop=None if self.teleop is None else Sample(self._renewed(self.teleop), self.now),
            presence=Sample(self._present(), self.now) if self.server else None,
            server_seen=seen,
            perception_seen=seen,
            present=present,
            stops=stops,
            ledger=self.ledger,
            close_up=self._close_up,
        )

    def _renewed(self, teleop: TeleopTarget) -> TeleopTarget:
        return msgspec.structs.replace(teleop, sequence=round(self.now / self.dt))

    def _around(self) -> Sample[Obstacles] | None:
        told = self._told
        if told is None or told.message.capsules is not self.obstacles or self.now - told.at > 1.0:
            self._told = Sample(Obstacles(header=m.Header(self.now, "odom"), capsules=self.obstacles), self.now)
        return self._told

    def step(self) -> Outputs:
        """One control period: controller first, then the robot."""
        return self.take(self.controller.step(self.inputs(), self.now))

    def take(self, out: Outputs) -> Outputs:
        """Act on what the controller sent, for one period."""
        command = np.zeros(NXI)
        if out.motion is not None:
            command = np.array(out.motion.xi)
            if self._fence.refuse(out.motion.epoch, out.motion.token) is not None:
                raise ValueError(f"a command of epoch {out.motion.epoch}, which is not the fence's")
            self._followed, self._moving = out.motion.sequence, bool(command.any())
        if out.token is not None:
            self._fence.claim(out.token.token, self.now, not self._moving)
        if out.picture is not None:
            self._close_up = self.close_up(out.picture)
        if out.cut is not None and out.cut.cut_id != self._cut_id:
            self._cut_id, self._cut_at = out.cut.cut_id, self.now
            self.cuts.append((out.cut.point_id, self.model.kinematics(self.q).T_odom_tool.homogeneous.copy()))
        if out.release is not None and out.release.stop_id == self.stop_id:
            self.stop_id = ""
        if out.state is not None:
            self.state = out.state
        if out.records and not self.ledger.failure:
            self.ledger = LedgerState(out.records[-1].number)
        self.events += [event.text for event in out.events]
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

    def close_up(self, request: CloseUpRequest) -> Sample[CloseUpResult] | None:
        """A camera that always sees the point: where it was shown, and off once its cut is done."""
        shown = () if self._points is None else self._points.message.points
        point = next((each for each in shown if each.point_id == request.point_id), None)
        off = self.outcome == "DONE" and any(cut[0] == request.point_id for cut in self.cuts)
        look = CloseUpResult(
            header=m.Header(self.now, "odom"),
            point_id=request.point_id,
            number=request.number,
            finding="severed" if off else "unseen" if point is None else "seen",
            position=None if off or point is None else point.position,
            tangent=None if off or point is None else point.tangent,
        )
        return Sample(look, self.now)

    def _measure(self) -> None:
        header = m.Header(self.now, "odom")
        v, w = self.model.drive.twist(float(self.xi[0]), float(self.xi[1]))
        self._joints = Sample(
            m.JointState(
                header=header, sequence=self._sequence, position=actuated(self.q[3:]), velocity=actuated(self.xi)
            ),
            self.now,
        )
        pose = planar_pose(self.q)
        self._odometry = Sample(
            m.Odometry(header=header, sequence=self._sequence, pose=pose, linear=v, angular=w), self.now
        )

    def _bridge(self) -> m.BridgeState:
        done = self._cut_id != "" and self.now - self._cut_at > 0.5
        return m.BridgeState(
            header=m.Header(self.now),
            kind="sim",
            epoch=self._fence.epoch,
            watchdog=False,
            stop_id=self.stop_id,
            stopped_by="ada" if self.stop_id else "",
            cutter="closing" if self._cut_id and not done else "open",
            cut_id=self._cut_id,
            outcome=self.outcome if done else "",
            real_time_factor=1.0,
            holder=self._fence.holder,
            sequence=self._followed,
            moving=self._moving,
        )

    def integrate(self, command: Array) -> None:
        """What a command makes of the robot in one period."""
        inner = 10
        dt = self.dt / inner
        for _ in range(inner):
            self.xi += (command - self.xi) * min(dt / self.lag, 1.0)
            self.q[:3] = self.model.drive.integrate(self.q[:3], float(self.xi[0] * dt), float(self.xi[1] * dt))
            self.q[3:] += self.xi * dt
