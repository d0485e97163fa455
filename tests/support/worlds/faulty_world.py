"""One robot under faults: the real bridge core and controller on a plant with servo lag, on one simulated clock.

Between them are links that drop, delay, repeat, reorder or hold back what they carry. What is judged is the record at
the plant's actuators, in the form of the simulator's trace, and nothing that the program says of itself.
"""

import random
from collections.abc import Callable
from typing import cast

from bridge.config import BridgeConfig, OdometryConfig
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.odometer import Odometer
from bridge.core.state_memory import Remembered
from controller.config import ControllerConfig
from controller.core import Controller
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Obstacles
from rolling_panda.messages.supervision import BaseVelocity, ControlState, TeleopTarget
from rolling_panda.model.robot import RobotModel, configuration, pose_message
from rolling_panda.reasons import text_of
from rolling_panda.runtime.latest_file import KeptValue
from rolling_panda.transport.memory import Link
from server.auth.sessions import Session
from server.robots.presence import PresenceTracker
from tests.support.controller_config import controller_config
from tests.support.points import point
from tests.support.worlds.lagged_robot import LaggedRobot
from tests.support.worlds.world import RobotWorld

MODEL = RobotModel()
_USER = "ada"
#: A page speaks, and the server tells who is there, each in so many periods of 1 ms.
_PAGE_TICKS, _PRESENCE_TICKS = 50, 200


class FaultyWorld(RobotWorld):
    """Bridge, controller and what the server and perception say, stepped by milliseconds."""

    def __init__(self, seed: int, hand_speed: float | None = None) -> None:
        """Everything is well; nothing moves yet. `hand_speed` (m/s) is in place of the configured one."""
        self.config = ControllerConfig()
        if hand_speed is not None:
            self.config = controller_config(self.config, teleoperation__base_speed=hand_speed)
        self.robot = LaggedRobot(self.config.work.home)
        self.memory = KeptValue(Remembered())
        chance = random.Random(seed)
        self._draw = lambda: f"{chance.getrandbits(64):016x}"
        self.modes: list[str] = []
        self.commanded: m.MotionCommand | None = None
        self.lease: ControlState | None = None
        super().__init__(self.new_bridge(), self.new_controller(), self.config.rate_hz, seed=seed)
        self._control_ticks = round(1.0 / (self.config.rate_hz * self.tick_s))
        self.motion, self.state, self.odometry = (Link(self.rng) for _ in range(3))
        self.links = {
            topics.MOTION.name: self.motion,
            topics.TOKEN.name: self.motion,
            topics.JOINTS.name: self.state,
            topics.BRIDGE.name: self.state,
            topics.ODOMETRY.name: self.odometry,
        }
        self.server = self.heard = self.watched = self.perception = True
        self.held: BaseVelocity | m.Pose | None = None
        self.holds = True
        self.intruder: Callable[[FaultyWorld], None] = lambda world: None
        self.people: tuple[str, ...] = ()
        self._there = PresenceTracker()

    def new_bridge(self) -> BridgeCore:
        """A bridge that remembers what the last one did."""
        odometer = Odometer(MODEL.drive, OdometryConfig(), TICK_S)
        return BridgeCore(
            self.robot, BridgeConfig(), MODEL.limits, odometer, "sim", memory=self.memory, draw=self._draw
        )

    def new_controller(self) -> Controller:
        """A controller that has just started."""
        return Controller(self.config, RobotConfig(), draw=self._draw)

    def restart_controller(self) -> None:
        """It ends and starts again, with no memory of what it was doing."""
        self.controller = self.new_controller()

    @property
    def alive(self) -> bool:
        """Whether the controller runs; what is sent to it arrives all the same."""
        return not self.controller_node.suspended

    @alive.setter
    def alive(self, alive: bool) -> None:
        self.controller_node.suspended = not alive

    def command(self, intent: intents.Intent) -> m.Answer:
        """What the operator asks must be granted here."""
        answer = super().command(intent)
        if not answer.ok:
            raise RuntimeError(f"{type(intent).__name__}: {answer.reason and text_of(answer.reason)}")
        return answer

    def work(self) -> None:
        """Automatic work on a point that is far away, until base and arm move."""
        self.people = (_USER,)
        self.run(0.3)
        far = point("p", (2.5, 0.75, 1.0))
        points = m.PruningPoints(header=m.Header(self.now, "odom"), segmenter="none", frames=1, points=(far,))
        self.say(points)
        self.run(0.02)
        for intent in (
            intents.Arm(user=_USER),
            intents.AcceptAll(user=_USER, confidence=0.0),
            intents.Start(user=_USER),
        ):
            self.command(intent)
        self.until_it_moves(1.2)

    def drive(self) -> None:
        """An operator drives the base by hand at its greatest speed."""
        self.arm()
        self.held = BaseVelocity(self.config.whole_body.base_speed, 0.0)
        wheel = self.config.teleoperation.base_speed / MODEL.drive.wheel_radius
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
        self.command(intents.Arm(user=_USER))
        # A hold from before arming would count for nothing.
        self.run(0.05)

    def until_it_moves(self, wheel: float) -> None:
        for _ in range(600):
            self.run(0.01)
            if abs(self.robot.now.velocity[:2]).min() > wheel:
                return
        raise RuntimeError(f"the robot does not move: {self.controller.mode}")

    def tick(self) -> None:
        """Advance one tick, for which those say something who are there."""
        if (self.ticks + 1) % self._control_ticks == 0:
            self._others_speak()
        super().tick()
        self.intruder(self)
        if self.ticks % self._control_ticks == 0 and self.alive:
            self.modes.append(self.controller.mode)

    def say(self, message: m.Message) -> None:
        """Send a message; the newest command and state of control are kept."""
        super().say(message)
        if isinstance(message, m.MotionCommand):
            self.commanded = message
        elif isinstance(message, ControlState):
            self.lease = message

    def _others_speak(self) -> None:
        number = self.ticks + 1
        if self.server:
            self.say(m.Heartbeat(process="server", sequence=number))
            if self.heard and number % _PAGE_TICKS == 0:
                self._pages_speak()
            if number % _PRESENCE_TICKS == 0:
                self.say(self._there.message(self.now))
            if self.held is not None and self.heard:
                base = self.held if isinstance(self.held, BaseVelocity) else None
                pose = None if base is not None else cast(m.Pose, self.held)
                self.say(TeleopTarget(sequence=number, hold=self.holds, user=_USER, base=base, target=pose))
        if self.perception:
            self.say(m.Heartbeat(process="perception", sequence=number))
            self.say(Obstacles(header=m.Header(self.now, "odom"), capsules=()))

    def _pages_speak(self) -> None:
        """Each page says that it is there, and which state it has drawn."""
        for name in self.people:
            session = Session("", name, "supervisor", 0.0, client=name)
            self._there.on_activity(session, self.now)
            if self.watched:
                self._there.on_seen(session, self.now)
