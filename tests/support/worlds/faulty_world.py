"""One robot under faults: the real bridge core and controller on a plant with servo lag, on one simulated clock.

Between them are links that drop, delay, repeat, reorder or hold back what they carry. What is judged is the record at
the plant's actuators, in the form of the simulator's trace, and nothing that the program says of itself.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, cast

import msgspec

from bridge.config import BridgeConfig, OdometryConfig
from bridge.core.bridge import TICK_S, BridgeCore, BridgeOutputs
from bridge.core.odometer import Odometer
from bridge.core.state_memory import Remembered
from bridge.sim.robot.lagged import LaggedRobot
from controller.config import ControllerConfig
from controller.core import Controller
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Obstacles
from rolling_panda.messages.supervision import BaseVelocity, ControlState, TeleopTarget
from rolling_panda.model.robot import RobotModel, configuration, pose_message
from rolling_panda.runtime.latest_file import KeptValue
from server.auth.sessions import Session
from server.robots.presence import PresenceTracker
from tests.support.points import point
from tests.support.sent import newest
from tests.support.worlds.world import World, new_inbox

MODEL = RobotModel()
_USER = "ada"
#: A page speaks, and the server tells who is there, each in so many periods of 1 ms.
_PAGE_TICKS, _PRESENCE_TICKS = 50, 200


@dataclass
class Link:
    """A hop. `loss`, `twice` are shares, `delay` and `jitter` seconds; `held` keeps everything back until it ends."""

    rng: random.Random
    loss: float = 0.0
    twice: float = 0.0
    delay: float = 0.001
    jitter: float = 0.0
    held: bool = False
    waiting: list[tuple[float, Any]] = field(default_factory=list)

    def push(self, message: Any, now: float) -> None:
        """Something is sent."""
        if self.rng.random() < self.loss:
            return
        for _ in range(2 if self.rng.random() < self.twice else 1):
            self.waiting.append((now + self.delay + self.rng.random() * self.jitter, message))

    def arrived(self, now: float) -> list[Any]:
        """What comes out now, in the order in which it comes."""
        if self.held:
            return []
        due = sorted((item for item in self.waiting if item[0] <= now), key=lambda item: item[0])
        self.waiting = [item for item in self.waiting if item[0] > now]
        return [message for _, message in due]


class FaultyWorld(World):
    """Bridge, controller and what the server and perception say, stepped by milliseconds."""

    def __init__(self, seed: int, hand_speed: float | None = None) -> None:
        """Everything is well; nothing moves yet. `hand_speed` (m/s) is in place of the configured one."""
        self.rng = random.Random(seed)
        self.config = ControllerConfig()
        if hand_speed is not None:
            self.config = msgspec.structs.replace(self.config, teleop_base_speed=hand_speed)
        self.robot = LaggedRobot(self.config.home)
        self.memory = KeptValue(Remembered())
        super().__init__(self.new_bridge(), self.new_controller(), self.config.rate_hz)
        self.motion, self.state, self.odometry = (Link(self.rng) for _ in range(3))
        self.alive = self.server = self.heard = self.watched = self.perception = True
        self.held: BaseVelocity | m.Pose | None = None
        self.holds = True
        self.modes: list[str] = []
        self.commanded: m.MotionCommand | None = None
        self.lease: ControlState | None = None
        self.intruder: Callable[[FaultyWorld], None] = lambda world: None
        self.people: tuple[str, ...] = ()
        self._there = PresenceTracker()

    def new_bridge(self) -> BridgeCore:
        """A bridge that remembers what the last one did."""
        odometer = Odometer(MODEL.drive, OdometryConfig(), TICK_S)
        return BridgeCore(self.robot, BridgeConfig(), MODEL.limits, odometer, "sim", memory=self.memory)

    def new_controller(self) -> Controller:
        """A controller that has just started."""
        return Controller(self.config, RobotConfig())

    def restart_controller(self) -> None:
        """It ends and starts again, with no memory of what it was doing."""
        self.controller = self.new_controller()
        present, self.inbox = self.inbox.present, new_inbox()
        self.inbox.present = present

    def receive(self, out: BridgeOutputs) -> None:
        """What the bridge sends goes its way; what has come over a way by now arrives."""
        for link, message in ((self.state, out.joints), (self.state, out.state), (self.odometry, out.odometry)):
            if message is not None:
                link.push(message, self.now)
        self.hear(*self.state.arrived(self.now), *self.odometry.arrived(self.now))
        self.to_bridge(*self.motion.arrived(self.now))
        self.intruder(self)

    def ask(self, intent: intents.Intent) -> None:
        """What the operator asks must be granted here."""
        answer = self.controller.answer(intent, self.now)
        if not answer.ok:
            raise RuntimeError(f"{type(intent).__name__}: {answer.reason}")

    def work(self) -> None:
        """Automatic work on a point that is far away, until base and arm move."""
        self.people = (_USER,)
        self.run(0.3)
        far = point("p", (2.5, 0.75, 1.0))
        points = m.PruningPoints(header=m.Header(self.now, "odom"), segmenter="none", frames=1, points=(far,))
        self.hear(points)
        self.run(0.02)
        for intent in (
            intents.Arm(user=_USER),
            intents.AcceptAll(user=_USER, confidence=0.0),
            intents.Start(user=_USER),
        ):
            self.ask(intent)
        self.until_it_moves(1.2)

    def drive(self) -> None:
        """An operator drives the base by hand at its greatest speed."""
        self.arm()
        self.held = BaseVelocity(self.config.base_speed, 0.0)
        wheel = self.config.teleop_base_speed / MODEL.drive.wheel_radius
        self.until_it_moves(0.95 * wheel)

    def lead(self) -> None:
        """An operator leads the tool along the row, far ahead of it."""
        self.arm()
        joints, odometry = self.inbox.newest(m.JointState), self.inbox.newest(m.Odometry)
        assert joints is not None and odometry is not None
        q = configuration(odometry.message.pose, joints.message.position)
        here = MODEL.pose(q, MODEL.tool_id)
        here.translation[0] += 2.0
        self.held = pose_message(here)
        self.until_it_moves(0.6)

    def arm(self) -> None:
        self.people = (_USER,)
        self.run(0.3)
        self.ask(intents.Arm(user=_USER))
        # A hold from before arming would count for nothing.
        self.run(0.05)

    def until_it_moves(self, wheel: float) -> None:
        for _ in range(600):
            self.run(0.01)
            if abs(self.robot.now.velocity[:2]).min() > wheel:
                return
        raise RuntimeError(f"the robot does not move: {self.controller.mode}")

    def control(self) -> None:
        """One control period, for which those say something who are there."""
        if not self.alive:
            return
        if self.server:
            self.hear(m.Heartbeat(process="server", sequence=self.ticks))
            if self.heard and self.ticks % _PAGE_TICKS == 0:
                self._pages_speak()
            if self.ticks % _PRESENCE_TICKS == 0:
                self.hear(self._there.message(self.now))
            if self.held is not None and self.heard:
                base = self.held if isinstance(self.held, BaseVelocity) else None
                pose = None if base is not None else cast(m.Pose, self.held)
                self.hear(TeleopTarget(sequence=self.ticks, hold=self.holds, user=_USER, base=base, target=pose))
        if self.perception:
            self.hear(m.Heartbeat(process="perception", sequence=self.ticks))
            self.hear(Obstacles(header=m.Header(self.now, "odom"), capsules=()))
        super().control()
        self.modes.append(self.controller.mode)

    def _pages_speak(self) -> None:
        """Each page says that it is there, and which state it has drawn."""
        for name in self.people:
            session = Session("", name, "supervisor", 0.0, client=name)
            self._there.on_activity(session, self.now)
            if self.watched:
                self._there.on_seen(session, self.now)

    def send(self, out: list[object]) -> None:
        """Motion and token go their way; the rest arrives at once."""
        self.commanded = newest(out, m.MotionCommand) or self.commanded
        self.lease = newest(out, ControlState) or self.lease
        delayed = [message for message in out if isinstance(message, m.MotionCommand | m.TokenRequest)]
        for message in delayed:
            self.motion.push(message, self.now)
        super().send([message for message in out if message not in delayed])
