"""What stands in the robot's way: posts, trunks, cordons and wires as rods, gathered over all frames.

Cells gather the evidence for and against each kind of wood (`evidence.py`). Cells of a kind are told apart by where
they are across the rod, and each group gets the lines that a trained row lets one expect there (`rods.py`). What no
trained row has, such as wood far before or behind it, is left out and counted.
"""

import math
from collections import Counter

import numpy as np
from numpy.typing import NDArray

from perception.config import ObstacleConfig
from perception.obstacles.evidence import Evidence, Surface
from perception.obstacles.rods import Rod, RowPlane, rods_of, row_plane
from perception.plant.clearance import Rods
from perception.plant.model import Array
from perception.segmentation.frame import Index, View
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.types import WoodClass

#: Share of all that is told that rods may be: on a long row the nearest, so that canes have room too.
_RODS = 0.75
#: How a class of rods stands: `upright`, `along` the row as one straight line, or along it in bent `pieces`.
_SHAPES: dict[WoodClass, str] = {"post": "upright", "trunk": "upright", "cordon": "pieces", "wire": "along"}

#: Two uprights with less room between them are one (m).
_SAME = 0.01

Fitted = tuple[list[Rod], list[str]]


class ObstacleMap:
    """Gathers where wood is seen, and turns what is plausible into capsules."""

    def __init__(self, config: ObstacleConfig) -> None:
        """Start with nothing seen."""
        self._config = config
        self._seen: dict[WoodClass, Evidence] = {
            kind: Evidence(kind, config.cell, config.hits, config.cells) for kind in _SHAPES
        }
        self._fitted: dict[WoodClass, list[tuple[Array, Fitted]]] = {}
        self.left_out: Counter[tuple[WoodClass, str]] = Counter()
        """What was taken for wood where no such wood can be, by kind and reason, as of the last frame."""

    def update(self, view: View, labels: NDArray[np.uint8]) -> tuple[Capsule, ...]:
        """Take one frame in; everything known now.

        Args:
            view: The frame.
            labels: H×W class indices.

        Returns:
            Rods in odom (m), one radius along each; where they are too many the nearest ones.
        """
        config = self._config
        for kind, cells in self._seen.items():
            nearest = config.nearest if kind == "wire" else config.thick_nearest
            cells.update(view, labels, nearest, config.farthest, config.points)
        held = {kind: cells.held() for kind, cells in self._seen.items()}
        plane = row_plane(held)
        self.left_out.clear()
        capsules = self._once([capsule for kind, cells in held.items() for capsule in self._rods(kind, cells, plane)])
        most = max(1, int(_RODS * config.most))
        if len(capsules) <= most:
            return tuple(capsules)
        gaps = Rods(tuple(capsules)).gaps(view.t[None])[0]
        return tuple(capsules[k] for k in np.sort(np.argsort(gaps, kind="stable")[:most]).tolist())

    def _rods(self, kind: WoodClass, cells: Surface, plane: RowPlane) -> list[Capsule]:
        near = plane.near(cells.place, self._config.off_row)
        astray = sum(len(group) >= self._config.least for group in self._groups(kind, cells.place[~near]))
        if astray:
            self.left_out[kind, "off the row"] += astray
        cells = cells.take(near)
        groups = [group for group in self._groups(kind, cells.place) if len(group) >= self._config.least]
        fitted = self._fits(kind, cells, groups)
        for _, implausible in fitted:
            self.left_out.update((kind, reason) for reason in implausible)
        return [
            Capsule(kind, _vector(rod.start), _vector(rod.end), rod.radius, rod.radius)
            for rods, _ in fitted
            for rod in rods
        ]

    def _once(self, capsules: list[Capsule]) -> list[Capsule]:
        """What is taken for a post and for a trunk is the one of which more was seen."""
        trunks = [capsule for capsule in capsules if capsule.kind == "trunk"]
        posts = tuple(capsule for capsule in capsules if capsule.kind == "post")
        if not trunks or not posts:
            return capsules
        middles = np.array([[trunk.start, trunk.end] for trunk in trunks]).mean(axis=1)
        gaps = Rods(posts).gaps(middles) - np.array([[trunk.start_radius] for trunk in trunks])
        less: list[Capsule] = []
        for i, j in np.argwhere(gaps < _SAME).tolist():
            less.append(min(trunks[i], posts[j], key=lambda each: math.dist(each.start, each.end)))
        for each in less:
            self.left_out[each.kind, "that another one is"] += 1
        return [capsule for capsule in capsules if not any(capsule is each for each in less)]

    def _groups(self, kind: WoodClass, places: Array) -> list[Index]:
        """Numbers of the cells that may be of the same rod."""
        config, shape = self._config, _SHAPES[kind]
        every = np.arange(len(places))
        if shape == "upright":
            return _groups(places, every, 0, config.apart)
        if shape == "along":
            return _groups(places, every, 2, config.wire_apart)
        return _pieces(places, config.piece, config.piece_apart)

    def _fits(self, kind: WoodClass, cells: Surface, groups: list[Index]) -> list[Fitted]:
        """The rods of each group; where no look has changed a group they stay."""
        old = {(len(places), places[0].tobytes()): (places, fitted) for places, fitted in self._fitted.get(kind, [])}
        new = []
        for group in groups:
            places = cells.place[group]
            before = old.get((len(places), places[0].tobytes()))
            if before is not None and np.array_equal(before[0], places):
                new.append(before)
            else:
                new.append((places, rods_of(kind, cells.take(group), self._config)))
        self._fitted[kind] = new
        return [fitted for _, fitted in new]


def _groups(places: Array, which: Index, axis: int, apart: float) -> list[Index]:
    """Of some places, by their numbers, groups between which there is a gap of `apart` along one axis."""
    if len(which) == 0:
        return []
    which = which[np.argsort(places[which, axis], kind="stable")]
    return np.split(which, np.nonzero(np.diff(places[which, axis]) > apart)[0] + 1)


def _pieces(places: Array, piece: float, apart: float) -> list[Index]:
    """Places in groups by the stretch of the row, `piece` long, that they are in, without gaps of `apart` across it."""
    if len(places) == 0:
        return []
    number = np.floor(places[:, 0] / piece)
    order = np.argsort(number, kind="stable")
    pieces = np.split(order, np.nonzero(np.diff(number[order]))[0] + 1)
    return [
        body
        for each in pieces
        for level in _groups(places, each, 2, apart)
        for body in _groups(places, level, 1, apart)
    ]


def _vector(point: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in point)
    return x, y, z
