"""The room that the robot takes up on its way: every part of it, at places close to each other."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller.whole_body.collision import CollisionModel
from controller.whole_body.collision_geometry import Shapes
from rolling_panda.differential_drive import Array

#: No point of the robot is farther from one place to the next (m).
STEP = 0.005


@dataclass(frozen=True, eq=False)
class Swept:
    """A motion, place by place.

    Attributes:
        shapes: Of the robot's parts.
        time: Of each place (k, s).
        placed: Rotation, row by row, and middle of each part in odom (k×p×12).
    """

    shapes: Shapes
    time: Array
    placed: Array


def sweep(model: CollisionModel, times: Sequence[float], configurations: Sequence[Array]) -> Swept:
    """The room that is taken up by a motion through these configurations (12), which are closer than a place needs."""
    shapes = model.shapes
    reach = np.linalg.norm(shapes.half, axis=1) + shapes.around
    every = [model.placed(q) for q in configurations]
    kept = [0] if every else []
    for number in range(1, len(every)):
        if number == len(every) - 1 or _farthest(every[number + 1], every[kept[-1]], reach) > STEP:
            kept.append(number)
    placed = np.array([every[number] for number in kept]).reshape(-1, len(shapes.parts), 12)
    return Swept(shapes, np.array([times[number] for number in kept]), placed)


def _farthest(placed: Array, before: Array, reach: Array) -> float:
    """How far a point of the robot has moved at most (m)."""
    turned = np.linalg.norm(placed[:, :9] - before[:, :9], axis=1) / np.sqrt(2.0)
    return float((np.linalg.norm(placed[:, 9:] - before[:, 9:], axis=1) + turned * reach).max())
