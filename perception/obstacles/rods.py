"""Rods through the cells in which wood is held to be, as a trained row lets one expect them.

Posts and trunks stand upright, wires and cordons run along the row, all of them in the row's plane, none is thicker
than its kind is. A line is fitted with its direction drawn towards what is usual for its kind, the less the longer the
stretch is that was seen (maximum a posteriori), and cells far from it count for nothing. What is still implausible is
no rod, and is counted.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.config import ObstacleConfig
from perception.obstacles.evidence import Surface
from perception.plant.model import Array
from perception.segmentation.frame import Index
from rolling_panda.messages.types import WoodClass

Levels = NDArray[np.int_]
Mask = NDArray[np.bool_]

_UPRIGHT: tuple[WoodClass, ...] = ("post", "trunk")
#: Standard deviation of the axis's slope against what is usual, and of the places of cells about it (m).
_SLOPE: dict[WoodClass, float] = {"post": 0.04, "trunk": 0.10, "cordon": 0.15, "wire": 0.04}
_SCATTER = 0.012
#: A wire's radius with its sag and the noise of the depth at arm's length (m).
_THIN = 0.004
#: Cells this far beside a line are still looked at for it, beyond its radius (m).
_BESIDE = 0.025
#: So many cells beside each other and not above each other are a post or a trunk that lies; so many of wires are told
#: when they are left out.
_ASTRAY = 20
#: Lines are looked for at places so far apart (m).
_STEP = 0.01
#: Over a gap longer than this a wire goes on only where it is seen at the same height, within this (m).
_GAP, _LEVEL = 0.5, 0.03
#: Cells of a wire are on at least this share of its levels (true ones of 0.5 to 5.3 m were seen on 0.47 and more).
_DENSE = 0.25
#: How often a line is fitted anew to the cells beside it.
_ROUNDS = 8
#: The row's place is the middle of what was seen within this distance along it, and is told every so often (m).
_STRETCH, _EVERY = 1.5, 0.5
#: Cells that tell it; with fewer of cordon and wires, posts and trunks do.
_ENOUGH = 30


@dataclass(frozen=True)
class Rod:
    """An axis from `start` to `end` (3, m, odom) and its radius (m)."""

    start: Array
    end: Array
    radius: float


@dataclass(frozen=True)
class RowPlane:
    """Where the row is: its y at some x (K each, m, odom), which grows. Without any, nobody knows."""

    x: Array
    y: Array

    def near(self, places: Array, distance: float) -> Mask:
        """Which places (N×3) are within a distance of it (m); all of them while it is unknown."""
        if len(self.x) == 0:
            return np.ones(len(places), dtype=bool)
        return np.asarray(np.abs(places[:, 1] - np.interp(places[:, 0], self.x, self.y)) < distance)


def row_plane(seen: dict[WoodClass, Surface]) -> RowPlane:
    """The middle of what was seen, stretch by stretch: wood in the row is most of it."""
    for kinds in (("cordon", "wire"), tuple(seen)):
        place = np.concatenate([np.zeros((0, 3)), *(seen[kind].place for kind in seen if kind in kinds)])
        if len(place) >= _ENOUGH:
            break
    else:
        return RowPlane(np.zeros(0), np.zeros(0))
    place = place[np.argsort(place[:, 0])]
    middles = np.unique(np.round(place[:, 0] / _EVERY)) * _EVERY
    begin, end = (np.searchsorted(place[:, 0], middles + side) for side in (-_STRETCH, _STRETCH))
    y = [float(np.median(place[i:j, 1])) for i, j in zip(begin, end, strict=True)]
    return RowPlane(middles, np.array(y))


def rods_of(kind: WoodClass, surface: Surface, config: ObstacleConfig) -> tuple[list[Rod], list[str]]:
    """The rods of a group of cells, and why others are none: `leaning`, `lying`, `too thick`, `hardly seen`.

    Args:
        kind: Of the wood.
        surface: Cells of one stretch, all near the row's plane.
        config: What is plausible.
    """
    rods, implausible, astray = [], [], 0
    for line, cells, levels in _lines(kind, surface, config):
        if levels < config.least:
            astray += cells
        elif line.slope > np.tan(config.lean if kind in _UPRIGHT else config.turn):
            implausible.append("leaning")
        elif line.radius > _thickest(kind, config):
            implausible.append("too thick")
        elif float(np.linalg.norm(line.rod.end - line.rod.start)) >= config.shortest:
            rods.append(line.rod)
    if astray > _ASTRAY:
        implausible.append("lying" if kind in _UPRIGHT else "hardly seen")
    return rods, implausible


@dataclass(frozen=True)
class _Line:
    rod: Rod
    slope: float
    radius: float


def _lines(kind: WoodClass, surface: Surface, config: ObstacleConfig) -> Iterator[tuple[_Line, int, int]]:
    """One line after the other, the one that most levels speak for first, with its cells and the levels they are on."""
    along, across = (2, 0) if kind in _UPRIGHT else (0, 2)
    left = surface
    while len(left) >= config.least:
        level = np.floor(left.place[:, along] / config.cell).astype(int)
        level -= level.min()
        start = _densest(left.place[:, across], level, 0.06 if kind in _UPRIGHT else 0.04)
        line, own, beside = _fit(kind, left, level, start, config)
        if not own.any():
            return
        if kind == "wire":
            here = _stretch(left.place[:, along], left.place[:, across], level, own, config)
            if not here.any():
                yield line, int(np.count_nonzero(own)), 0
                left = left.take(~own)
                continue
            if not here.all():
                part = np.flatnonzero(here)
                heights = np.sort(left.place[own & here, across])
                start = float(heights[len(heights) // 2])
                line, of_part, near_part = _fit(kind, left.take(part), level[part], start, config)
                own, beside = np.zeros_like(own), np.zeros_like(own)
                own[part], beside[part] = of_part, near_part
                if not own.any():
                    return
        yield line, int(np.count_nonzero(own)), len(np.unique(level[own]))
        left = left.take(~(own | beside))


def _stretch(t: Array, height: Array, level: Levels, own: Mask, config: ObstacleConfig) -> Mask:
    """Which cells are along the longest run of a line's own that is one wire; none where nothing is dense enough.

    A wire is seen on a good share of its length, and two things at different heights with nothing between are not one.
    """
    order = np.flatnonzero(own)[np.argsort(t[own])]
    joined: list[Index] = []
    for run in np.split(order, np.nonzero(np.diff(t[order]) > _GAP)[0] + 1):
        filled = len(np.unique(level[run]))
        if filled < max(config.least, _DENSE * (np.ptp(level[run]) + 1)):
            continue
        if joined and abs(float(np.median(height[run]) - np.median(height[joined[-1]]))) < _LEVEL:
            joined[-1] = np.concatenate([joined[-1], run])
        else:
            joined.append(run)
    if not joined:
        return np.zeros(len(t), dtype=bool)
    best = max(joined, key=len)
    if len(best) == len(order):
        return np.ones(len(t), dtype=bool)
    return np.asarray((t > t[best].min() - _GAP / 2) & (t < t[best].max() + _GAP / 2))


def _densest(place: Array, level: Levels, width: float) -> float:
    """Middle of the stretch, of a width (m), whose cells are on the most levels."""
    first, steps = float(place.min()), round(width / _STEP)
    column = np.floor((place - first) / _STEP).astype(int)
    filled = np.zeros((int(level.max()) + 1, int(column.max()) + 1 + 2 * steps), dtype=int)
    filled[level, column + steps] = 1
    until = np.cumsum(filled, axis=1)
    votes = np.count_nonzero(until[:, steps:] > until[:, :-steps], axis=0)
    # Where several are as good, the one in the middle of them.
    ties = np.flatnonzero(votes == votes.max())
    best = int(ties[len(ties) // 2])
    # Column `i` of the votes counts those from `i + 1 - steps` on.
    return first + _STEP * (best + 1 - steps / 2)


def _fit(
    kind: WoodClass, surface: Surface, level: Levels, start: float, config: ObstacleConfig
) -> tuple[_Line, Mask, Mask]:
    """A line near `start`, which cells are its own, and which are so near beside it that they are no other one's."""
    along, across = (2, 0) if kind in _UPRIGHT else (0, 2)
    t, pair = surface.place[:, along], surface.place[:, [across, 1]]
    radius = _THIN if kind == "wire" else 0.7 * _thickest(kind, config)
    near = np.abs(pair[:, 0] - start) < radius + _BESIDE
    middle, at, slope = float(np.median(t[near])), np.array([start, float(np.median(pair[near, 1]))]), np.zeros(2)
    own = np.zeros(len(t), dtype=bool)
    for _ in range(_ROUNDS):
        off = pair - at - np.outer(t - middle, slope)
        before, own = own, (np.abs(off) < radius + _BESIDE).all(axis=1)
        if np.array_equal(own, before) or not own.any():
            break
        # A level counts once, however many cells are on it.
        weight = surface.weight[own] / np.maximum(np.bincount(level[own], surface.weight[own])[level[own]], 1e-9)
        total = float(weight.sum())
        middle = float(weight @ t[own]) / total
        at = weight @ pair[own] / total
        reach = t[own] - middle
        slope = (weight * reach) @ (pair[own] - at) / (float(weight @ reach**2) + (_SCATTER / _SLOPE[kind]) ** 2)
        if kind != "wire":
            beside = np.abs((pair[own] - at)[:, 0] - slope[0] * reach)
            core = beside < 1.3 * radius + 0.5 * config.cell
            square = (beside**2 + surface.spread[own, across])[core]
            # A rod seen from the side has as many points on each strip of its width.
            radius = float(np.sqrt(3.0 * np.average(square, weights=weight[core]))) if core.any() else radius
            radius = max(radius, _THIN)
    off = np.abs(pair - at - np.outer(t - middle, slope))
    beside = off[:, 0] < radius + 2 * _BESIDE
    if not own.any():
        return _Line(Rod(np.zeros(3), np.zeros(3), radius), np.inf, radius), own, beside
    if kind == "wire":
        beside &= (t > t[own].min() - _GAP / 2) & (t < t[own].max() + _GAP / 2)
    ends = np.zeros((2, 3))
    for end, far in zip(ends, (t[own].min(), t[own].max()), strict=True):
        end[[across, 1]] = at + (far - middle) * slope
        end[along] = far
    if kind != "wire":
        # Of a half cylinder that is seen from one side, the mean of the surface lies π/4 of a radius before the axis.
        axis = ends[1] - ends[0]
        axis /= max(float(np.linalg.norm(axis)), 1e-9)
        away = surface.weight[own] @ surface.away[own]
        away -= float(away @ axis) * axis
        ends += 0.785 * radius * away / max(float(np.linalg.norm(away)), 1e-9)
    return _Line(Rod(ends[0], ends[1], radius), float(np.linalg.norm(slope)), radius), own, beside


def _thickest(kind: WoodClass, config: ObstacleConfig) -> float:
    allowed: dict[WoodClass, float] = {
        "post": config.thickest.post,
        "trunk": config.thickest.trunk,
        "cordon": config.thickest.cordon,
    }
    return allowed.get(kind, _THIN)
