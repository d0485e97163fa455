"""A simulated robot beside one obstacle: led against it by hand, or at work, with the truth of every touch."""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from bridge.config import BridgeConfig
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.odometer import Odometer
from bridge.sim.robot.robot import SimulatedRobot
from bridge.sim.robot.trace import TraceWriter
from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.world.config import CALM, WorldConfig
from controller.config import ControllerConfig
from controller.core import Controller
from controller.motion.contact import Spots
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.messages.perception import Capsule, Obstacles
from rolling_panda.messages.supervision import BaseVelocity, Person, Presence, TeleopTarget
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel
from rolling_panda.model.wire_values import vector3
from rolling_panda.resources import resource
from tests.support.cameras import Blind
from tests.support.controller_config import controller_config
from tests.support.points import point
from tests.support.worlds.world import RobotWorld

MODEL = RobotModel()
USER = "ada"
#: Speed of joints and wheels below which the robot is at rest (rad/s).
AT_REST = 0.01
#: Distance between points of endless work, where the first is (m), and how many are ahead.
_SPACING_M, _FIRST_M, _AHEAD = 0.12, 0.6, 4


@dataclass(frozen=True)
class Moment:
    """A ms of a protective stop.

    Attributes:
        at: Time (s).
        commanded: Whether the newest command was to move.
        speed: Of the fastest spot of base, arm and tool, by the truth (m/s).
    """

    at: float
    commanded: bool
    speed: float


def capsule_of(rod: Rod, shift: Array | None = None) -> Capsule:
    """What perception says of a rod, which it may see elsewhere (3, m)."""
    by = np.zeros(3) if shift is None else shift
    ends = vector3(rod.start + by), vector3(rod.end + by)
    return Capsule(rod.kind, *ends, rod.start_radius, rod.end_radius, rod.vine, rod.spur)


class ContactWorld(RobotWorld):
    """Somebody is always present and holds control.

    Attributes:
        touches: For each ms in which the row touched the robot: time (s), force (N), body of the robot.
        modes: Time (s) of each change of mode, and the mode.
        rests: Times (s) of the ms in which nothing was sent but zero and nothing moved.
        stopped: Each ms of protective stops.
        events: Reasons of the lines of the log.
        log: The lines themselves.
    """

    def __init__(
        self,
        rods: Sequence[Rod] = (),
        seen: Sequence[Capsule] = (),
        arm: Sequence[float] | None = None,
        world: WorldConfig = CALM,
        seed: int = 0,
        config: ControllerConfig | None = None,
        canes: Sequence[Rod] = (),
        trace: TraceWriter | None = None,
    ) -> None:
        """Arm the robot.

        Args:
            rods: What stands there.
            seen: What perception tells of it.
            arm: Posture at the start (7, rad); None for the survey posture.
            world: Disturbances.
            seed: Of the disturbances.
            config: Section `[controller]`.
            canes: What perception knows as canes, and not as obstacles: nobody has decided that they stay.
            trace: Records every step.
        """
        # There is no camera, so that nothing is looked at from near.
        settings = controller_config(
            config or ControllerConfig(), work__pre_cut_check=False, work__post_cut_check=False
        )
        posture = tuple(settings.work.home if arm is None else arm)
        bridge = msgspec.structs.replace(
            load_section(resource("assets/config/sim.toml"), "bridge", BridgeConfig), start_arm=posture
        )
        self.robot = SimulatedRobot(bridge, Row(tuple(rods)), Blind(), trace, world, seed)
        odometer = Odometer(MODEL.drive, bridge.odometry, TICK_S, seed)
        self.held: TeleopTarget | None = None
        self.touches: list[tuple[float, float, str]] = []
        self.modes: list[tuple[float, m.Mode]] = []
        self.rests: list[float] = []
        self.stopped: list[Moment] = []
        self._spots = Spots(MODEL)
        self.events: list[m.Reason] = []
        self.log: list[m.LogEvent] = []
        self.cut_ids: set[str] = set()
        self._canes = tuple((vector3(rod.start), vector3(rod.end)) for rod in canes)
        self._seen, self._shown, self._moving = tuple(seen), 0, False
        self.state: m.ControllerState | None = None
        super().__init__(
            BridgeCore(self.robot, bridge, MODEL.limits, odometer, "sim"),
            Controller(settings, RobotConfig()),
            settings.rate_hz,
            seed=seed,
        )
        self._control_ticks = round(1.0 / (settings.rate_hz * self.tick_s))
        self.run(0.3)
        assert self.command(intents.Arm(user=USER)).ok
        self.run(0.1)

    @property
    def touch(self) -> m.Reason | None:
        """What the robot says that it touched; None if it says nothing."""
        stopped = self.state is not None and self.state.mode == "PROTECTIVE_STOP"
        return self.state.reason if stopped and self.state is not None else None

    def hold(self, joints: Array | None = None, base: float | None = None) -> None:
        """Hold a motion from now on: velocities of the joints (7, rad/s), or of the base (m/s); neither lets go."""
        if joints is None and base is None:
            self.held = None
            return
        self.held = TeleopTarget(
            sequence=0,
            hold=True,
            user=USER,
            joints=None if joints is None else tuple(joints.tolist()),  # type: ignore[arg-type]
            base=None if base is None else BaseVelocity(base, 0.0),
        )

    def work(self) -> None:
        """Begin automatic work that never ends: there is always one more point, and somebody who accepts it."""
        self.offer()
        assert self.command(intents.Start(user=USER)).ok

    def offer(self) -> None:
        """Show and accept as many points as are to be ahead."""
        wanted = len(self.cut_ids) + _AHEAD
        if wanted <= self._shown:
            return
        points = tuple(
            point(f"p{k}", (_FIRST_M + k * _SPACING_M, 0.75, 1.0), vine=k // 8, spur=k % 8)
            for k in range(max(0, self._shown - _AHEAD), wanted)
        )
        self._shown = wanted
        header = m.Header(self.now, "odom")
        self.say(m.PruningPoints(header=header, segmenter="none", frames=1, points=points, canes=self._canes))
        self.run(0.02)
        self.command(intents.AcceptAll(user=USER, confidence=0.0))

    def configuration(self) -> Array:
        """True configuration (12)."""
        return np.concatenate([self.robot.true_base().pose, self.robot.read().position])

    def tick(self) -> None:
        """Advance one tick, and note the truth."""
        if (self.ticks + 1) % self._control_ticks == 0:
            self._others_speak()
        super().tick()
        force, body = self.robot.true_touch()
        if force > 0.0:
            self.touches.append((self.now, force, body))
        if not self.modes or self.modes[-1][1] != self.controller.mode:
            self.modes.append((self.now, self.controller.mode))
        measured = self.robot.read()
        if not self._moving and float(np.abs(measured.velocity).max()) < AT_REST:
            self.rests.append(self.now)
        if self.controller.mode == "PROTECTIVE_STOP":
            self.stopped.append(Moment(self.now, self._moving, self._fastest(measured.velocity)))

    def _fastest(self, velocity: Array) -> float:
        """Speed (m/s) of the fastest spot of the robot at these speeds of wheels and joints (9, rad/s)."""
        base = self.robot.true_base()
        places, by_joint = self._spots.at(self.configuration())
        (x, y, heading), (forward, aside, turning) = base.pose, base.velocity
        c, s = np.cos(heading), np.sin(heading)
        carried = np.array([c * forward - s * aside, s * forward + c * aside, 0.0])
        arm = np.zeros_like(places)
        arm[:, 0], arm[:, 1] = -turning * (places[:, 1] - y), turning * (places[:, 0] - x)
        arm += carried + np.einsum("j,njk->nk", velocity[2:], by_joint)
        return float(max(np.linalg.norm(arm, axis=1).max(), np.linalg.norm(carried)))

    def say(self, message: m.Message) -> None:
        """Send a message; what the controller says of itself is kept."""
        super().say(message)
        match message:
            case m.ControllerState():
                self.state = message
            case m.LogEvent():
                self.events.append(message.reason)
                self.log.append(message)
            case m.MotionCommand():
                self._moving = any(message.xi)
            case m.CutCommand():
                self.cut_ids.add(message.cut_id)

    def _others_speak(self) -> None:
        number = self.ticks + 1
        self.say(Presence(sequence=number, people=(Person(USER, USER, "supervisor", 0.0, 0.0),)))
        for process in ("server", "perception"):
            self.say(m.Heartbeat(process=process, sequence=number))  # type: ignore[arg-type]
        self.say(Obstacles(header=m.Header(self.now, "odom"), capsules=self._seen))
        if self.held is not None:
            self.say(msgspec.structs.replace(self.held, sequence=number))
