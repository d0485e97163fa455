"""How far a close-up picture is shifted against the plant map.

An error of the hand-eye calibration, of the odometry or of the joints shifts all wood in a picture alike. The shift is
the one under which the canes and nodes that are known around a point coincide with those that the picture shows. It
tells the point's own cane from its neighbours, however far the picture is shifted.

Along the cane only nodes tell. Not all of them are seen, and some that are seen are none. So a shift along is believed
where it explains clearly more of the nodes than no shift does. Where those of the point's own cane contradict it,
nobody knows which internode is which.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from perception.arrays import Array, interpolate
from perception.plant.map import Surroundings
from perception.skeleton.centreline import Centreline

#: Largest shift that is looked for (m): half the usual distance between two canes.
_REACH = 0.03
#: Wood nearer than this to where it is expected is there (m).
_THERE = 0.008
#: Least share of the known wood that a shift must explain, and by how much a larger shift must explain more.
_EXPLAINED, _BETTER = 0.5, 0.15
#: Share of the known nodes that a shift along the cane must explain, and by how much more than no shift.
_AGREED, _CLEARLY = 0.4, 0.25
#: Spacing of samples of a line (m).
_SPACING = 0.002


#: Shift of a picture that is where it is taken to be (3, m).
UNSHIFTED: Array = np.zeros(3)


class PictureShift(NamedTuple):
    """Where a point is seen, less where it is in the map (3, m, odom), and whether the nodes agree along the cane."""

    by: Array
    agreed: bool = True


def picture_shift(
    known: Surroundings, lines: list[Centreline], position: Array, along: Array, expected: Array = UNSHIFTED
) -> PictureShift | None:
    """How far a picture is shifted.

    Args:
        known: Canes and nodes around the point; without any, the shift is the expected one.
        lines: Canes that the picture shows.
        position: The point (3, m, odom).
        along: Unit vector along its cane (3, odom).
        expected: Shift of the last picture of the point that told one (3, m, odom).

    Returns:
        Of the shifts that explain the known wood well, the one nearest to the expected one; None without any.
    """
    if not known.axes:
        return PictureShift(expected)
    if not lines:
        return None
    samples = [interpolate(np.arange(0.0, float(line.arc[-1]), _SPACING), line.arc, line.axis) for line in lines]
    seen, wood = cKDTree(np.concatenate(samples)), np.concatenate(known.axes)
    shifts = [expected]
    shifts += [shift for axis in known.axes for line in samples if (shift := _across(axis, line, position)) is not None]
    shares = np.array([float(np.mean(seen.query(wood + shift)[0] < _THERE)) for shift in shifts])
    if shares.max() < _EXPLAINED:
        return None
    good = [shift for shift, share in zip(shifts, shares, strict=True) if share >= shares.max() - _BETTER]
    across = min(good, key=lambda shift: float(np.linalg.norm(shift - expected)))
    found, nodes = known.nodes + across, _nodes(lines)
    further = _along(found, nodes, along)
    own = found[np.linalg.norm(_aside(found - position - across, along), axis=1) < _THERE]
    agreed = _explained(own, nodes, along, further) >= _explained(own, nodes, along, 0.0)
    return PictureShift(across + further * along, agreed)


def _across(axis: Array, line: Array, position: Array) -> Array | None:
    """Shift (3, m) square to a known axis that brings it onto a line near the point; None where that is too far."""
    k = int(np.argmin(np.linalg.norm(axis - position, axis=1)))
    chord = axis[min(k + 1, len(axis) - 1)] - axis[max(k - 1, 0)]
    direction = chord / max(float(np.linalg.norm(chord)), 1e-9)
    away = line - axis[k]
    across = away - (away @ direction)[:, None] * direction
    nearest = int(np.argmin(np.linalg.norm(away, axis=1)))
    shift: Array = across[nearest]
    # A line that ends before it comes past the point says nothing.
    beside = abs(float(away[nearest] @ direction)) < _THERE
    return shift if beside and float(np.linalg.norm(shift)) <= _REACH else None


def _along(known: Array, seen: Array, along: Array) -> float:
    """Shift along the cane (m) that at least two nodes agree on; 0 where the nodes are as expected, or say nothing.

    Where there are many nodes, or some are not seen, a shift by an internode explains some of them by chance. So it has
    to explain clearly more of them than no shift does.
    """
    apart = seen[None] - known[:, None]
    steps = apart @ along
    beside = np.linalg.norm(_aside(apart, along), axis=2) < _THERE
    shifts = steps[beside & (np.abs(steps) <= _REACH)].tolist()

    def explained(shift: float) -> int:
        return _explained(known, seen, along, shift)

    best = max(shifts, key=lambda shift: (explained(shift), -abs(shift)), default=0.0)
    more = explained(best) - explained(0.0)
    agreed = explained(best) >= 2 and explained(best) >= _AGREED * len(known)
    return float(best) if agreed and more > max(1.0, _CLEARLY * len(known)) else 0.0


def _explained(known: Array, seen: Array, along: Array, shift: float) -> int:
    """How many known nodes a shift along (m) brings to one that is seen; one that is seen explains one."""
    apart = seen[None] - known[:, None] - shift * along
    there = (np.linalg.norm(_aside(apart, along), axis=2) < _THERE) & (np.abs(apart @ along) < _THERE)
    return int(min(there.any(axis=1).sum(), there.any(axis=0).sum()))


def _aside(vectors: Array, along: Array) -> Array:
    """The part of vectors (…×3) across the cane."""
    out: Array = vectors - (vectors @ along)[..., None] * along
    return out


def _nodes(lines: list[Centreline]) -> Array:
    """Positions of all nodes (N×3, m, odom)."""
    found = [interpolate(np.array([node.arc for node in line.nodes]), line.arc, line.axis) for line in lines]
    return np.concatenate([np.zeros((0, 3)), *(each for each in found if len(each))])
