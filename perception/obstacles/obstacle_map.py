"""Obstacle map: posts, trunks, cordons and wires as capsules, from all frames.

There is an occupancy grid for each class (`occupancy.py`). Its occupied cells are split into groups by gaps, and
cylinders are fitted to each group with priors from the geometry of a row (`cylinder_fit.py`). Implausible wood, such as
wood off the row, is rejected and counted.
"""

import math
from collections import Counter, deque
from dataclasses import replace

import numpy as np

from perception.arrays import Array, Index, Labels
from perception.config import ObstacleConfig
from perception.obstacles.cylinder_fit import Cylinder, Rejection, RowPlane, fit_cylinders, row_plane
from perception.obstacles.occupancy import OccupancyGrid, OccupiedCells
from perception.plant.capsules import CapsuleSet
from perception.segmentation.frame import View
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.types import WoodClass
from rolling_panda.model.wire_values import vector3

#: Share of the published capsules that may be cylinders; the rest is for canes.
_MAX_SHARE = 0.75
#: Course of each class: `upright`, straight `along` the row, or along it in bent `pieces`.
_SHAPES: dict[WoodClass, str] = {"post": "upright", "trunk": "upright", "cordon": "pieces", "wire": "along"}
#: What is nearer than this to the surface of wood that is known otherwise is a part of it (m).
_APART = 0.018
#: A post and a trunk with a smaller distance between their surfaces are the same thing (m).
_SAME = 0.01

#: A post or trunk reaches at least so far below the cordon beside it, which is at most so far along the row (m).
_BELOW_CORDON, _BESIDE = 0.12, 0.3
#: So far below its lowest cell a post would have been seen (m), if any view has it so far from its edge (px). Views of
#: cameras nearer to each other than this (m) are one; of so many the newest are stored.
_FOOT, _EDGE, _SAME_VIEW, _VIEWS = 0.08, 10, 0.1, 200

#: Cylinders of a group, and why others were rejected.
Fit = tuple[list[Cylinder], list[Rejection]]


class ObstacleMap:
    """Maps the wood that the robot must avoid."""

    def __init__(self, config: ObstacleConfig) -> None:
        """Start with an empty map."""
        self._config = config
        self._grids: dict[WoodClass, OccupancyGrid] = {
            kind: OccupancyGrid(kind, config.cell_size, config.min_hits, config.max_cells) for kind in _SHAPES
        }
        self._fits: dict[WoodClass, list[tuple[Array, Fit]]] = {}
        self._views: deque[View] = deque(maxlen=_VIEWS)
        """Newest viewpoints, without their images."""
        self.rejected: Counter[tuple[WoodClass, Rejection]] = Counter()
        """Implausible wood by class and reason, as of the last frame."""

    def update(
        self, view: View, labels: Labels, only_add: bool = False, apart: tuple[Capsule, ...] = ()
    ) -> tuple[Capsule, ...]:
        """Add one frame; returns the map.

        Args:
            view: The frame.
            labels: H×W class indices.
            only_add: Nothing is forgotten for this frame, whose classes are doubtful.
            apart: Wood of class cordon that is known otherwise, and is no part of this map.

        Returns:
            Capsules in odom (m), the nearest where they are too many.
        """
        config = self._config
        self._add_view(view)
        for kind, grid in self._grids.items():
            min_depth = config.min_depth if kind == "wire" else config.min_depth_thick
            grid.update(view, labels, min_depth, config.max_depth, config.max_points, only_add)
        occupied = {kind: grid.occupied() for kind, grid in self._grids.items()}
        plane = row_plane(occupied)
        cordon = occupied["cordon"]
        occupied["cordon"] = cordon.select(CapsuleSet(apart).nearest(cordon.position) > _APART)
        self.rejected.clear()
        capsules = [capsule for kind, cells in occupied.items() for capsule in self._capsules(kind, cells, plane)]
        capsules = self._without_duplicates(self._standing(capsules, occupied["cordon"].position))
        most = max(1, int(_MAX_SHARE * config.max_capsules))
        if len(capsules) <= most:
            return tuple(capsules)
        distances = CapsuleSet(tuple(capsules)).distances(view.t[None])[0]
        return tuple(capsules[k] for k in np.sort(np.argsort(distances, kind="stable")[:most]).tolist())

    def forget(self, wood: tuple[Capsule, ...]) -> None:
        """Forget wood of class cordon that has fallen: until views refuted it, it would be in the way."""
        self._grids["cordon"].forget(CapsuleSet(wood), _APART)

    def _capsules(self, kind: WoodClass, cells: OccupiedCells, plane: RowPlane) -> list[Capsule]:
        near = plane.near(cells.position, self._config.row_tolerance)
        if off_row := len(self._groups(kind, cells.position[~near])):
            self.rejected[kind, "off the row"] += off_row
        cells = cells.select(near)
        fits = self._fit(kind, cells, self._groups(kind, cells.position))
        for _, rejections in fits:
            self.rejected.update((kind, why) for why in rejections)
        return [
            Capsule(kind, vector3(each.start), vector3(each.end), each.radius, each.radius)
            for cylinders, _ in fits
            for each in cylinders
        ]

    def _add_view(self, view: View) -> None:
        if all(math.dist(view.t, known.t) > _SAME_VIEW for known in self._views):
            self._views.append(replace(view, depth=view.depth[:0], labels=None, color_jpeg=b""))

    def _standing(self, capsules: list[Capsule], cordon: Array) -> list[Capsule]:
        """Without posts and trunks that have no foot where one would be seen: canes look like them along the row."""
        standing = []
        for each in capsules:
            beside = cordon[np.abs(cordon[:, 0] - each.start[0]) < _BESIDE, 2]
            ends_above = len(beside) > 0 and each.start[2] > np.median(beside) - _BELOW_CORDON
            if each.kind in ("post", "trunk") and ends_above and self._foot_in_view(each):
                self.rejected[each.kind, "above the cordon"] += 1
            else:
                standing.append(each)
        return standing

    def _foot_in_view(self, upright: Capsule) -> bool:
        """Whether any view shows the place right below an upright."""
        foot = np.array(upright.start) - (0.0, 0.0, _FOOT)
        for view in self._views:
            u, v, depth = view.pixels(foot)[0]
            inside = _EDGE < u < view.intrinsics.width - _EDGE and _EDGE < v < view.intrinsics.height - _EDGE
            if inside and self._config.min_depth_thick < depth < self._config.max_depth:
                return True
        return False

    def _without_duplicates(self, capsules: list[Capsule]) -> list[Capsule]:
        """Of a post and a trunk at the same place the longer one stays."""
        trunks = [capsule for capsule in capsules if capsule.kind == "trunk"]
        posts = tuple(capsule for capsule in capsules if capsule.kind == "post")
        if not trunks or not posts:
            return capsules
        middles = np.array([[trunk.start, trunk.end] for trunk in trunks]).mean(axis=1)
        gaps = CapsuleSet(posts).distances(middles) - np.array([[trunk.start_radius] for trunk in trunks])
        less: list[Capsule] = []
        for i, j in np.argwhere(gaps < _SAME).tolist():
            less.append(min(trunks[i], posts[j], key=lambda each: math.dist(each.start, each.end)))
        for each in less:
            self.rejected[each.kind, "that another one is"] += 1
        return [capsule for capsule in capsules if not any(capsule is each for each in less)]

    def _groups(self, kind: WoodClass, positions: Array) -> list[Index]:
        """Indices of the cells of each cylinder or stretch of wire; small groups are dropped."""
        config, shape = self._config, _SHAPES[kind]
        every = np.arange(len(positions))
        if shape == "upright":
            groups = _split(positions, every, 0, config.upright_separation)
        elif shape == "along":
            groups = _split(positions, every, 2, config.wire_separation)
        else:
            groups = _pieces(positions, config.cordon_piece, config.cordon_separation)
        return [group for group in groups if len(group) >= config.min_cells]

    def _fit(self, kind: WoodClass, cells: OccupiedCells, groups: list[Index]) -> list[Fit]:
        """The cylinders of each group; unchanged groups are not fitted again."""
        old = {(len(cached), cached[0].tobytes()): (cached, fit) for cached, fit in self._fits.get(kind, [])}
        new = []
        for group in groups:
            positions = cells.position[group]
            cached = old.get((len(positions), positions[0].tobytes()))
            if cached is not None and np.array_equal(cached[0], positions):
                new.append(cached)
            else:
                new.append((positions, fit_cylinders(kind, cells.select(group), self._config)))
        self._fits[kind] = new
        return [fit for _, fit in new]


def _split(positions: Array, which: Index, axis: int, separation: float) -> list[Index]:
    """Groups of some positions, by index, with gaps of `separation` between them along one axis."""
    if len(which) == 0:
        return []
    which = which[np.argsort(positions[which, axis], kind="stable")]
    return np.split(which, np.nonzero(np.diff(positions[which, axis]) > separation)[0] + 1)


def _pieces(positions: Array, length: float, separation: float) -> list[Index]:
    """Groups of positions in pieces of the row of a length, split at gaps of `separation` across it."""
    if len(positions) == 0:
        return []
    number = np.floor(positions[:, 0] / length)
    order = np.argsort(number, kind="stable")
    pieces = np.split(order, np.nonzero(np.diff(number[order]))[0] + 1)
    return [
        body
        for each in pieces
        for level in _split(positions, each, 2, separation)
        for body in _split(positions, level, 1, separation)
    ]
