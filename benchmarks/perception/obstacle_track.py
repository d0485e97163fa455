"""Records where the camera is while the robot works along a row, for `bench obstacles`."""

import tempfile
from pathlib import Path

import msgspec
import numpy as np
from msgspec import Struct

from benchmarks.control.row_walk import walk
from bridge.sim.robot.robot import SimulatedRobot
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.messages import Message
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.resources import resource
from tests.support.worlds.closed_loop import ClosedLoop

#: Places that are kept, evenly in time, and how far the base goes along the row (m).
_KEPT, _END = 160, 3.4
_SURVEY_S = 6.0


class Place(Struct, frozen=True):
    """Where a picture is taken.

    Attributes:
        base: As measured.
        position: Of the joints, as measured.
        camera: Where the camera really is, 4×4 by rows; empty where the measurement is true.
    """

    base: m.PlanarPose
    position: m.Actuated
    camera: tuple[float, ...] = ()


class Track(Struct, frozen=True):
    """Places of one run of work, at the rate at which the camera took them."""

    seed: int
    seconds: float
    places: tuple[Place, ...]


class _Watched(ClosedLoop):
    """Notes the places of all frames that perception gets."""

    def __init__(self, seed: int, trace: Path) -> None:
        super().__init__(seed, trace, resource("assets/config/sim.toml"), segmenter="labels")
        self.places: list[Place] = []

    def say(self, message: Message) -> None:
        super().say(message)
        if isinstance(message, CameraFrame):
            robot = self.bridge.robot
            assert isinstance(robot, SimulatedRobot)
            camera = tuple(np.round(robot.true_camera(), 6).ravel().tolist())
            self.places.append(Place(message.base, message.position, camera))


def record(seed: int, path: Path) -> str:
    """Work along a row in a closed loop with classes from the simulator, and write where the camera was.

    Args:
        seed: Of the row.
        path: File to write.

    Returns:
        What came of it, in words.
    """
    with tempfile.TemporaryDirectory() as folder, _Watched(seed, Path(folder) / "trace") as loop:
        loop.run(_SURVEY_S)
        loop.command(intents.Arm(user="bench"))
        walk(loop, _END)
        places, seconds = loop.places, loop.now
    kept = [places[int(k * len(places) / _KEPT)] for k in range(min(_KEPT, len(places)))]
    path.write_bytes(msgspec.json.format(msgspec.json.encode(Track(seed, round(seconds, 1), tuple(kept))), indent=0))
    return f"{len(places)} pictures in {seconds:.0f} s of work, {len(kept)} places kept in {path}"
