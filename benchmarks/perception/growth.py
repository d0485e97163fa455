"""Whether a frame costs the more the more vines were seen: one long row, surveyed from end to end.

Run `rolling-panda bench perception --growth --vines 30 --segmenter labels`.
"""

import time
from dataclasses import dataclass

import numpy as np

from bridge.sim.camera.config import CameraConfig
from bridge.sim.camera.frame import survey_frame
from bridge.sim.camera.renderer import Camera
from bridge.sim.vineyard.config import VineyardConfig
from bridge.sim.vineyard.grow import grow
from perception.pipeline import Perception
from rolling_panda.model.robot import RobotModel

#: The camera stands so far ahead of the base in the survey posture (m).
_CAMERA_AHEAD = 0.5


@dataclass(frozen=True)
class Stretch:
    """The frames taken while the camera passed one vine.

    Attributes:
        vines: Passed before, and this one.
        frames: How many.
        frame_ms: Median processor time of a frame through segmentation, plant model and rule.
        spurs: Known at the end.
        points: Shown at the end.
        obstacles: Obstacles told at the end.
    """

    vines: int
    frames: int
    frame_ms: float
    spurs: int
    points: int
    obstacles: int


def grow_long(seed: int, vines: int, step: float, perception: Perception, model: RobotModel) -> list[Stretch]:
    """Survey one row of many vines; one stretch a vine.

    Args:
        seed: Of row and camera.
        vines: Of the row.
        step: Way between two frames (m).
        perception: Fresh.
        model: For the camera's place.
    """
    config = VineyardConfig(vines=vines)
    row, camera = grow(config, seed), Camera(CameraConfig(), seed)
    sequence, out = 0, []
    for vine in range(vines):
        start = config.first_vine_x + (vine - 0.5) * config.vine_spacing - _CAMERA_AHEAD
        times, points = [], 0
        for x in np.arange(start, start + config.vine_spacing - step / 2, step):
            frame = survey_frame(camera, row, model, sequence, float(x))
            began = time.process_time()
            points = len(perception.process(frame).points)
            times.append(1000 * (time.process_time() - began))
            sequence += 1
        spurs, told = len(perception.plant_map.spurs), len(perception.obstacles)
        out.append(Stretch(vine + 1, len(times), float(np.median(times)), spurs, points, told))
    return out


def table(stretches: list[Stretch]) -> str:
    """One line a vine."""
    head = f"{'vines':>6} {'frames':>7} {'ms a frame':>11} {'spurs':>6} {'points':>7} {'obstacles':>10}"
    lines = [
        f"{s.vines:6} {s.frames:7} {s.frame_ms:11.1f} {s.spurs:6} {s.points:7} {s.obstacles:10}" for s in stretches
    ]
    return "\n".join([head, *lines])
