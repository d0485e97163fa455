"""What has been cut off: which points are cut, how far the lines of their canes still stand, and what falls."""

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.spatial import cKDTree

from rolling_panda import messages as m
from rolling_panda.messages.page import PagePoint
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.differential_drive import Array

Line = tuple[m.Vector3, ...]
#: Place of a cut (3, m, odom) and the cane's direction there (3, unit, away from the cordon).
Cut = tuple[m.Vector3, m.UnitVector3]

#: A line whose axis passes a cut by no more than this (m), in about its direction, is of the cane that was cut.
_NEAR, _ALIKE = 0.02, 0.6
#: Less than this beyond a cut (m) is how well its place is known.
_LEAST = 0.01


def cut_points(points: Iterable[PagePoint], bridge: m.BridgeState | None) -> dict[str, Cut]:
    """Points whose cane is off: those that are done, and the one whose blades have told so.

    The controller looks again before it calls a cut done; should the cane still stand, its point is none of these.

    Args:
        points: As the page is told of them.
        bridge: Its newest word; None before the first.
    """
    told = bridge.cut_id if bridge is not None and bridge.outcome == "DONE" else ""
    return {
        row.point.point_id: (row.point.position, row.point.tangent)
        for row in points
        if row.entry.state == "DONE" or (row.entry.state == "INTENT" and told and row.entry.cut_id == told)
    }


def standing(lines: Sequence[Line], cuts: dict[str, Cut]) -> tuple[list[Line], dict[str, Line]]:
    """What of lines is left below the cuts, and by the cut's name what is beyond it.

    Perception tells canes at full length until it has seen that they are off, which it cannot while the robot works.

    Args:
        lines: Axes of canes, each from its base on (m, odom).
        cuts: By name.
    """
    left = list(lines)
    off: dict[str, Line] = {}
    pairs = [(number, k) for number, line in enumerate(lines) for k in range(len(line) - 1)]
    if not pairs or not cuts:
        return left, off
    start = np.array([lines[number][k] for number, k in pairs])
    along = np.array([lines[number][k + 1] for number, k in pairs]) - start
    tree, reach = cKDTree(start + along / 2), float(np.linalg.norm(along, axis=1).max()) / 2 + _NEAR
    ends: dict[int, float] = {}
    for name, (place, direction) in cuts.items():
        near = np.array(tree.query_ball_point(place, reach), dtype=int)
        found = _nearest(start[near], along[near], np.array(place), np.array(direction))
        if found is None:
            continue
        number, k = pairs[near[found[0]]]
        at = k + found[1]
        if at < ends.get(number, np.inf):
            ends[number] = at
            below, beyond = _split(lines[number], at)
            left[number] = below
            if _length(beyond) > _LEAST:
                off[name] = beyond
    return [line for line in left if len(line) > 1], off


def _nearest(start: Array, along: Array, place: Array, direction: Array) -> tuple[int, float] | None:
    """Which piece of a line passes a cut nearest, and at which share of it (0…1); None where none does."""
    if not len(start):
        return None
    square = np.maximum((along * along).sum(axis=1), 1e-12)
    share = np.clip(((place - start) * along).sum(axis=1) / square, 0.0, 1.0)
    gap = np.linalg.norm(start + share[:, None] * along - place, axis=1)
    gap[along @ direction / np.sqrt(square) < _ALIKE] = np.inf
    first = int(np.argmin(gap))
    return (first, float(share[first])) if gap[first] <= _NEAR else None


def _split(line: Line, at: float) -> tuple[Line, Line]:
    """A line up to a place and from there on; `at` counts its corners, with the share of the piece behind one."""
    k = min(int(at), len(line) - 2)
    x, y, z = (np.array(line[k]) + (at - k) * (np.array(line[k + 1]) - np.array(line[k]))).tolist()
    corner = (x, y, z)
    below = line[: k + 1] if at == k else (*line[: k + 1], corner)
    return below, (corner, *line[k + 1 :])


def _length(line: Line) -> float:
    return float(np.linalg.norm(np.diff(np.array(line), axis=0), axis=1).sum())


def as_rods(line: Line, radius: float) -> list[Capsule]:
    """A line as pieces of cane (m)."""
    return [Capsule("cane", a, b, radius, radius) for a, b in zip(line, line[1:], strict=False)]


def fallen_rods(before: Sequence[Capsule], after: Sequence[Capsule]) -> list[Capsule]:
    """What of a row has gone since: whole rods, and of those that are shorter now the rest."""
    now = {(rod.kind, rod.start): rod for rod in after}
    gone = []
    for rod in before:
        stays = now.get((rod.kind, rod.start))
        if stays is None:
            gone.append(rod)
        elif stays.end != rod.end:
            gone.append(Capsule(rod.kind, stays.end, rod.end, stays.end_radius, rod.end_radius))
    return gone
