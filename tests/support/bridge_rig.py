"""A bridge of any kind with this test in the controller's place, and its plant to be judged by."""

import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from bridge.core.bridge import BridgeCore, BridgeOutputs
from bridge.core.interface import Measurement, Setpoint
from bridge.core.picture import DEPTH_UNIT, Picture, encode_picture
from bridge.core.robot_time import RobotTime
from bridge.sim.robot.robot import SimulatedRobot
from rolling_panda import messages as m
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel

MODEL = RobotModel()
REST = (0.0,) * 9
FORWARD = (*MODEL.drive.wheels(0.2, 0.0), 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1)
#: A step of a real bridge, or an answer of a device, that takes longer was held up by the machine (s).
_IN_TIME_S = 0.02
LENS = Intrinsics(4, 4, 1.0, 1.0, 2.0, 2.0)
PICTURE = Picture(LENS, b"c", b"d", b"")
#: Number of an exposure as the distance of a wall (m).
NUMBER_M = 0.001


class Plant(Protocol):
    """What is really actuated, whatever the bridge says of it."""

    def velocity(self) -> Array: ...  # ξ̇ (9, rad/s)

    def breaches(self) -> list[str]: ...  # every limit that was broken, in words

    def bites(self) -> int: ...  # how often the blades have met

    def push(self, torques: tuple[float, ...]) -> None: ...  # external torques of the arm's joints (7, N·m) from now on

    def heading(self) -> float: ...  # by how much the base has turned since the start (rad, not wrapped)

    def stream(self) -> None: ...  # pictures and inertial samples tell of motion from now on

    def exposed_at(self, frame: CameraFrame) -> float: ...  # when its picture was really exposed (s, the robot's time)


@dataclass(frozen=True)
class Parts:
    """A bridge that can be started more than once on the same plant."""

    start: Callable[[], BridgeCore]
    plant: Plant
    time: Callable[[], RobotTime]
    #: Whether the plant moves on by itself; else it stands still while nobody steps it.
    real: bool
    close: Callable[[], None]


class Commander:
    """What commands a bridge and keeps all that it says; whoever has one steps it."""

    core: BridgeCore

    def __init__(self, token: str = "a1") -> None:
        self.epoch, self.sequence, self.echo, self.token = 1, 0, 0, token
        self.mode: m.Mode = "TELEOP"
        self.now = 0.0
        self.outputs: list[BridgeOutputs] = []

    def message(self, xi: tuple[float, ...]) -> m.MotionCommand:
        self.sequence += 1
        return m.MotionCommand(
            epoch=self.epoch,
            sequence=self.sequence,
            echo=self.echo,
            xi=xi,  # type: ignore[arg-type]
            token=self.token,
        )

    def ask(self, token: str = "") -> None:
        """Ask for the fencing token, or to keep it."""
        request = m.TokenRequest(token=token or self.token, echo=self.echo, mode=self.mode)
        self.core.on_token(request, self.now)

    def command(self, xi: tuple[float, ...]) -> None:
        if self.sequence % 10 == 0:
            self.ask()
        self.core.on_motion(self.message(xi), self.now)

    def hear(self, out: BridgeOutputs, xi: tuple[float, ...] | None) -> None:
        """Keep what a tick gave; with `xi`, answer its joint state."""
        self.outputs.append(out)
        if out.joints is not None:
            self.echo = out.joints.sequence
            if xi is not None:
                self.command(xi)

    @property
    def state(self) -> m.BridgeState:
        return next(out.state for out in reversed(self.outputs) if out.state is not None)


class Rig(Commander):
    """Steps the bridge and answers each of its joint states, for as long as there is something to say."""

    def __init__(self, parts: Parts) -> None:
        super().__init__()
        self.parts, self.plant = parts, parts.plant
        self.start()

    def start(self) -> None:
        """(Re)start the bridge; the plant stays as it is."""
        self.core = self.parts.start()
        self.time = self.parts.time()
        #: For how long this machine has held up the last run, or an answer of a real device (s).
        self.held_up = 0.0
        self.echo, self.outputs = 0, []

    def run(self, seconds: float, xi: tuple[float, ...] | None) -> None:
        """Let robot time pass; with `xi`, command it after each joint state."""
        # A real plant went on while nobody stepped the bridge.
        end = (time.monotonic() if self.parts.real else self.time.now) + seconds
        self.held_up, last = 0.0, time.monotonic()
        while self.time.now < end:
            last = self._note_delay(last)
            due = self.time.due(time.monotonic())
            for _ in range(due):
                self.now = self.time.tick()
                self.hear(self.core.step(self.now, time.monotonic()), xi)
            if self.parts.real:
                time.sleep(0.004)

    def until(self, condition: Callable[[], bool], xi: tuple[float, ...] | None, limit_s: float = 5.0) -> bool:
        """Run until the condition holds; False when it has not within the limit.

        A busy machine may leave a real robot's bridge without a command for longer than its deadline. Then it wants one
        at rest first.
        """
        end = self.time.now + limit_s
        while not condition() and self.time.now < end:
            self.run(0.02, REST if self.state.watchdog else xi)
        return condition()

    def _note_delay(self, since: float) -> float:
        now = time.monotonic()
        self.held_up += max(0.0, now - since - _IN_TIME_S)
        return now

    @property
    def skipped_s(self) -> float:
        """Time whose steps the bridge has skipped in the last run, as the machine held it up (s)."""
        return self.held_up if self.parts.real else 0.0

    def comes_to_rest(self, xi: tuple[float, ...] | None) -> bool:
        """Whether base and arm are at rest after the last run; as much later as the machine has held up a real one."""
        began = time.monotonic()
        if self.at_rest():
            return True
        self._note_delay(began)
        return self.parts.real and self.until(self.at_rest, xi, 2.0 * self.held_up)

    def drive_on(self) -> None:
        """Come to a steady velocity of base and arm, and see it in the plant."""
        self.run(0.2, REST)
        self.run(1.0, FORWARD)
        assert self.until(lambda: np.allclose(self.plant.velocity(), FORWARD, rtol=0.0, atol=0.06), FORWARD)

    def cut(self, cut_id: str, epoch: int | None = None) -> None:
        self.core.on_cut(
            m.CutCommand(
                epoch=self.epoch if epoch is None else epoch,
                cut_id=cut_id,
                point_id="p1",
                echo=self.echo,
                token=self.token,
            ),
            self.now,
        )

    def at_rest(self) -> bool:
        return float(np.abs(self.plant.velocity()).max()) < 0.02

    @property
    def refusals(self) -> str:
        return "\n".join(f"{row.topic}: {row.reason.code} ×{row.count}" for row in self.state.rejections)

    def close(self) -> None:
        self.core.robot.close()
        self.parts.close()


def number_of(frame: CameraFrame) -> int:
    """Which exposure a picture shows: they are numbered by the distance of a wall."""
    counts = np.frombuffer(zlib.decompress(frame.depth_zlib), "<u2")
    return round(float(np.median(counts)) * DEPTH_UNIT / NUMBER_M)


class NoCamera:
    """A photographer whose pictures show their number and nothing else."""

    def __init__(self) -> None:
        self._ready: Picture | None = None
        #: When each was exposed (s), number 1 first.
        self.exposures: list[float] = []

    def expose(self, row: object, T_world_camera: Array, at: float, velocity: Array) -> bool:
        self.exposures.append(at)
        wall = np.full((LENS.height, LENS.width), len(self.exposures) * NUMBER_M, np.float32)
        self._ready = encode_picture(LENS, np.zeros((*wall.shape, 3), np.uint8), wall, None)
        return True

    def ready(self) -> Picture | None:
        picture, self._ready = self._ready, None
        return picture

    def close(self) -> None:
        pass


class SimulatedPlant:
    """Stands between core and simulated robot: notes what goes to the servos, and what the physics make of it."""

    def __init__(self, robot: SimulatedRobot, camera: NoCamera | None = None) -> None:
        self.robot = robot
        self._exposures = [] if camera is None else camera.exposures
        self._last = np.zeros(9)
        self._bites = 0
        self._breaches: list[str] = []
        self._push = np.zeros(7)

    def read(self) -> Measurement:
        measured = self.robot.read()
        assert measured.external_torque is not None
        return replace(measured, external_torque=measured.external_torque + self._push)

    def push(self, torques: tuple[float, ...]) -> None:
        self._push = np.array(torques)

    def write(self, setpoint: Setpoint) -> None:
        change = np.abs(setpoint.xi - self._last)
        if not np.all(np.abs(setpoint.xi) <= MODEL.limits.velocity + 1e-9):
            self._breaches.append(f"velocity {setpoint.xi}")
        if not np.all(change <= MODEL.limits.acceleration * 1e-3 + 1e-9):
            self._breaches.append(f"acceleration {change / 1e-3}")
        self._last = setpoint.xi.copy()
        self.robot.write(setpoint)

    def cut(self, cut_id: str, point_id: str) -> None:
        self._bites += 1
        self.robot.cut(cut_id, point_id)

    def capture(self, expose: bool) -> Picture | None:
        return self.robot.capture(expose)

    def close(self) -> None:
        pass

    def velocity(self) -> Array:
        return self.robot.read().velocity.copy()

    def breaches(self) -> list[str]:
        lower, upper = MODEL.limits.lower[5:], MODEL.limits.upper[5:]
        arm = self.robot.read().position[2:]
        return self._breaches + [f"joint {i + 1} at {q}" for i, q in enumerate(arm) if not lower[i] < q < upper[i]]

    def bites(self) -> int:
        return self._bites

    def stream(self) -> None:
        """They always do."""

    def heading(self) -> float:
        return float(self.robot.true_base().pose[2])

    def exposed_at(self, frame: CameraFrame) -> float:
        return self._exposures[number_of(frame) - 1]
