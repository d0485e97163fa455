"""Where the camera was for each frame of the last minutes, so that a click into any of them is a line of sight."""

import threading
from dataclasses import dataclass

import numpy as np

from perception.plant.model import Array
from rolling_panda import messages as m
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from rolling_panda.model.robot import RobotModel, configuration

#: Frames that may be clicked: ten minutes of moving, so that a picture can be looked at in peace.
_MOST = 1200


@dataclass(frozen=True)
class SightLine:
    """A line of sight in odom: where it begins (3, m), and a unit vector along it (3)."""

    origin: Array
    direction: Array


class Sightings:
    """Remembers postures, not images. The loop notes each frame as it comes in; the worker asks."""

    def __init__(self) -> None:
        """Nothing has been seen."""
        self._seen: dict[int, tuple[Intrinsics, m.PlanarPose, m.Actuated]] = {}
        self._lock = threading.Lock()

    def note(self, frame: CameraFrame) -> None:
        """Remember where a frame was taken."""
        with self._lock:
            self._seen[frame.sequence] = frame.intrinsics, frame.base, frame.position
            while len(self._seen) > _MOST:
                del self._seen[next(iter(self._seen))]

    def line(self, sequence: int, u: float, v: float, model: RobotModel) -> SightLine | None:
        """The line of sight through a place in a frame; None where the frame is not remembered.

        Args:
            sequence: Of the frame.
            u: Column, as a share of the width.
            v: Row, as a share of the height.
            model: The robot; its work space is used.
        """
        with self._lock:
            seen = self._seen.get(sequence)
        if seen is None:
            return None
        k, base, position = seen
        camera = model.pose(configuration(base, position), model.camera_id)
        col, row = u * k.width - 0.5, v * k.height - 0.5
        along = np.array([(col - k.cx) / k.fx, (row - k.cy) / k.fy, 1.0])
        direction = np.array(camera.rotation) @ (along / np.linalg.norm(along))
        return SightLine(np.array(camera.translation), direction)
