"""Cylinders fitted to occupied cells, with priors from the geometry of a trained row.

Posts and trunks stand upright; wires and cordons run along the row; all are in the plane of the row and have a largest
radius. The direction of a line is a maximum a posteriori estimate, with a prior on its slope; cells far from the line
are outliers. Implausible fits are rejected and counted.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from perception.arrays import Array, Index, Mask, distance
from perception.config import ObstacleConfig
from perception.obstacles.occupancy import OccupiedCells
from perception.plant.model import SURFACE_OFFSET
from rolling_panda.messages.types import WoodClass

#: Why wood is implausible.
Rejection = Literal[
    "off the row", "that another one is", "above the cordon", "leaning", "lying", "too thick", "hardly seen"
]

#: Index of each cell along its line, in cells.
Levels = NDArray[np.int_]

_UPRIGHT: tuple[WoodClass, ...] = ("post", "trunk")
#: Prior standard deviation of the slope of an axis, and scatter of cells about it (m).
_SLOPE: dict[WoodClass, float] = {"post": 0.04, "trunk": 0.10, "cordon": 0.15, "wire": 0.04}
_SCATTER = 0.012
#: Radius of a wire, with its sag and the depth noise at arm's length (m).
_WIRE_RADIUS = 0.004
#: Inliers are within this distance of the surface of a cylinder (m).
_INLIER = 0.025
#: Cells on too few levels that are reported as a lying post or trunk, or as a scarcely visible wire.
_MIN_REPORTED = 20
#: Width in which the start of an upright and of a horizontal line is searched, and its resolution (m).
_UPRIGHT_WIDTH, _ALONG_WIDTH, _RESOLUTION = 0.06, 0.04, 0.01
#: Across a gap longer than this a wire continues only at the same height, within this (m).
_MAX_GAP, _SAME_HEIGHT = 0.5, 0.03
#: Smallest fraction of the levels of a wire with cells (true wires of 0.5 to 5.3 m had 0.47 and more).
_MIN_DENSITY = 0.25
#: Most iterations of a fit.
_ITERATIONS = 8
#: The position of the row is a median over this distance to either side, at this spacing (m).
_ROW_WINDOW, _ROW_SPACING = 1.5, 0.5
#: Cells of cordon and wires that it needs; with fewer, posts and trunks are used too.
_MIN_ROW_CELLS = 30


@dataclass(frozen=True)
class Cylinder:
    """An axis from `start` to `end` (3, m, odom) and its radius (m)."""

    start: Array
    end: Array
    radius: float


@dataclass(frozen=True)
class RowPlane:
    """Position of the row: y at increasing x (K each, m, odom); unknown without any."""

    x: Array
    y: Array

    def near(self, positions: Array, distance: float) -> Mask:
        """Which positions (N×3) are within a distance of it (m); all while it is unknown."""
        if len(self.x) == 0:
            return np.ones(len(positions), dtype=bool)
        return np.asarray(np.abs(positions[:, 1] - np.interp(positions[:, 0], self.x, self.y)) < distance)


def row_plane(occupied: dict[WoodClass, OccupiedCells]) -> RowPlane:
    """Moving median of the occupied cells: most of them are in the row."""
    for kinds in (("cordon", "wire"), tuple(occupied)):
        position = np.concatenate([np.zeros((0, 3)), *(occupied[kind].position for kind in occupied if kind in kinds)])
        if len(position) >= _MIN_ROW_CELLS:
            break
    else:
        return RowPlane(np.zeros(0), np.zeros(0))
    position = position[np.argsort(position[:, 0])]
    x = np.unique(np.round(position[:, 0] / _ROW_SPACING)) * _ROW_SPACING
    first, last = (np.searchsorted(position[:, 0], x + side) for side in (-_ROW_WINDOW, _ROW_WINDOW))
    y = [float(np.median(position[i:j, 1])) for i, j in zip(first, last, strict=True)]
    return RowPlane(x, np.array(y))


def fit_cylinders(
    kind: WoodClass, cells: OccupiedCells, config: ObstacleConfig
) -> tuple[list[Cylinder], list[Rejection]]:
    """The cylinders of a group of cells, and why others were rejected.

    Args:
        kind: Class of the wood.
        cells: Cells of one group, near the plane of the row.
        config: Limits of plausible wood.
    """
    cylinders, scattered = [], 0
    rejected: list[Rejection] = []
    for line, count, levels in _lines(kind, cells, config):
        if levels < config.min_cells:
            scattered += count
        elif line.slope > np.tan(config.max_lean if kind in _UPRIGHT else config.max_slope):
            rejected.append("leaning")
        elif line.cylinder.radius > _max_radius(kind, config):
            rejected.append("too thick")
        elif distance(line.cylinder.end, line.cylinder.start) >= config.min_length:
            cylinders.append(line.cylinder)
    if scattered > _MIN_REPORTED:
        rejected.append("lying" if kind in _UPRIGHT else "hardly seen")
    return cylinders, rejected


@dataclass(frozen=True)
class _Line:
    cylinder: Cylinder
    slope: float


def _lines(kind: WoodClass, cells: OccupiedCells, config: ObstacleConfig) -> Iterator[tuple[_Line, int, int]]:
    """Lines in the order of their support, each with its number of cells and of levels."""
    along, across = (2, 0) if kind in _UPRIGHT else (0, 2)
    left = cells
    while len(left) >= config.min_cells:
        level = np.floor(left.position[:, along] / config.cell_size).astype(int)
        level -= level.min()
        start = _densest(left.position[:, across], level, _UPRIGHT_WIDTH if kind in _UPRIGHT else _ALONG_WIDTH)
        line, own, beside = _fit(kind, left, level, start, config)
        if not own.any():
            return
        if kind == "wire":
            here = _longest_run(left.position[:, along], left.position[:, across], level, own, config)
            if not here.any():
                yield line, int(np.count_nonzero(own)), 0
                left = left.select(~own)
                continue
            if not here.all():
                part = np.flatnonzero(here)
                heights = np.sort(left.position[own & here, across])
                start = float(heights[len(heights) // 2])
                line, of_part, near_part = _fit(kind, left.select(part), level[part], start, config)
                own, beside = np.zeros_like(own), np.zeros_like(own)
                own[part], beside[part] = of_part, near_part
                if not own.any():
                    return
        yield line, int(np.count_nonzero(own)), len(np.unique(level[own]))
        left = left.select(~(own | beside))


def _longest_run(t: Array, height: Array, level: Levels, own: Mask, config: ObstacleConfig) -> Mask:
    """Which cells are along the longest run of inliers that is one wire; none where no run is dense enough."""
    order = np.flatnonzero(own)[np.argsort(t[own])]
    joined: list[Index] = []
    for run in np.split(order, np.nonzero(np.diff(t[order]) > _MAX_GAP)[0] + 1):
        filled = len(np.unique(level[run]))
        if filled < max(config.min_cells, _MIN_DENSITY * (np.ptp(level[run]) + 1)):
            continue
        if joined and abs(float(np.median(height[run]) - np.median(height[joined[-1]]))) < _SAME_HEIGHT:
            joined[-1] = np.concatenate([joined[-1], run])
        else:
            joined.append(run)
    if not joined:
        return np.zeros(len(t), dtype=bool)
    best = max(joined, key=len)
    if len(best) == len(order):
        return np.ones(len(t), dtype=bool)
    return np.asarray((t > t[best].min() - _MAX_GAP / 2) & (t < t[best].max() + _MAX_GAP / 2))


def _densest(across: Array, level: Levels, width: float) -> float:
    """Middle of the interval of a width (m) whose cells are on the most levels (a Hough vote)."""
    first, steps = float(across.min()), round(width / _RESOLUTION)
    column = np.floor((across - first) / _RESOLUTION).astype(int)
    filled = np.zeros((int(level.max()) + 1, int(column.max()) + 1 + 2 * steps), dtype=int)
    filled[level, column + steps] = 1
    until = np.cumsum(filled, axis=1)
    votes = np.count_nonzero(until[:, steps:] > until[:, :-steps], axis=0)
    # Of equal maxima the middle one.
    ties = np.flatnonzero(votes == votes.max())
    best = int(ties[len(ties) // 2])
    # Column `i` of the votes counts those from `i + 1 - steps` on.
    return first + _RESOLUTION * (best + 1 - steps / 2)


def _fit(
    kind: WoodClass, cells: OccupiedCells, level: Levels, start: float, config: ObstacleConfig
) -> tuple[_Line, Mask, Mask]:
    """A line near `start`, its inliers, and the cells so near beside it that they belong to no other line."""
    along, across = (2, 0) if kind in _UPRIGHT else (0, 2)
    t, pair = cells.position[:, along], cells.position[:, [across, 1]]
    radius = _WIRE_RADIUS if kind == "wire" else 0.7 * _max_radius(kind, config)
    near = np.abs(pair[:, 0] - start) < radius + _INLIER
    middle, at, slope = float(np.median(t[near])), np.array([start, float(np.median(pair[near, 1]))]), np.zeros(2)
    own = np.zeros(len(t), dtype=bool)
    for _ in range(_ITERATIONS):
        off = pair - at - np.outer(t - middle, slope)
        before, own = own, (np.abs(off) < radius + _INLIER).all(axis=1)
        if np.array_equal(own, before) or not own.any():
            break
        # All levels have the same weight.
        weight = cells.weight[own] / np.maximum(np.bincount(level[own], cells.weight[own])[level[own]], 1e-9)
        total = float(weight.sum())
        middle = float(weight @ t[own]) / total
        at = weight @ pair[own] / total
        reach = t[own] - middle
        slope = (weight * reach) @ (pair[own] - at) / (float(weight @ reach**2) + (_SCATTER / _SLOPE[kind]) ** 2)
        if kind != "wire":
            beside = np.abs((pair[own] - at)[:, 0] - slope[0] * reach)
            core = beside < 1.3 * radius + 0.5 * config.cell_size
            square = (beside**2 + cells.variance[own, across])[core]
            # A cylinder in side view has a uniform distribution of points over its width.
            radius = float(np.sqrt(3.0 * np.average(square, weights=weight[core]))) if core.any() else radius
            radius = max(radius, _WIRE_RADIUS)
    off = np.abs(pair - at - np.outer(t - middle, slope))
    beside = off[:, 0] < radius + 2 * _INLIER
    if not own.any():
        return _Line(Cylinder(np.zeros(3), np.zeros(3), radius), np.inf), own, beside
    if kind == "wire":
        beside &= (t > t[own].min() - _MAX_GAP / 2) & (t < t[own].max() + _MAX_GAP / 2)
    ends = np.zeros((2, 3))
    for end, far in zip(ends, (t[own].min(), t[own].max()), strict=True):
        end[[across, 1]] = at + (far - middle) * slope
        end[along] = far
    if kind != "wire":
        axis = ends[1] - ends[0]
        axis /= max(float(np.linalg.norm(axis)), 1e-9)
        direction = cells.weight[own] @ cells.view_direction[own]
        direction -= float(direction @ axis) * axis
        ends += SURFACE_OFFSET * radius * direction / max(float(np.linalg.norm(direction)), 1e-9)
    return _Line(Cylinder(ends[0], ends[1], radius), float(np.linalg.norm(slope))), own, beside


def _max_radius(kind: WoodClass, config: ObstacleConfig) -> float:
    radius: float = getattr(config.max_radius, kind, _WIRE_RADIUS)
    return radius
