"""Clearance of a previewed motion from obstacles that were detected since.

The camera keeps seeing more of the row, and sees known parts more accurately. An approved motion stays valid as long as
no new obstacle is too near to it. A new obstacle extends more than `SAME` beyond all known ones. It is too near to a
part of the robot if it is nearer than the collision guard allows, or nearer than both the smallest distance shown for
that cut and the clearance of plans.
"""

import math
from collections.abc import Sequence

import numpy as np

from controller.config import HierarchyConfig
from controller.motion.surroundings import WorkPlace, obstacles_of, removable, touchable
from controller.planning.preview_plan import STEP, Preview, SweptVolume
from controller.whole_body.collision_geometry import BLADES
from controller.whole_body.compiled import NOTHING, NUMBER, PACKED, VECTOR, compiled
from controller.whole_body.obstacle import Axes
from controller.work.posture_search import CLEARANCE
from rolling_panda import reasons
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.supervision import PreviewedCut
from rolling_panda.messages.types import WOOD_CLASSES, Reason
from rolling_panda.model.differential_drive import Array

#: Accuracy of the position of a known obstacle that is seen again (m).
SAME = 0.005
#: Number of samples of the motion that are checked together.
_BLOCK = 16
#: Distance between two checked positions along an axis (m).
_SPACING = 0.01


class PathWatch:
    """One instance for each preview. A check takes about a millisecond, longer if many obstacles are near."""

    def __init__(self, preview: Preview, swept: SweptVolume, settings: HierarchyConfig) -> None:
        """Watch one motion.

        Args:
            preview: The approved preview.
            swept: Swept volume of the motion.
            settings: Distances of the collision guard.
        """
        self._preview, self._swept = preview, swept
        self._before = preview.request.obstacles
        self._known = frozenset(self._before)
        self._axes = Axes(tuple(obstacles_of(self._before)))
        parts = swept.shapes.parts
        self._blades = [part == BLADES for part in parts]
        self._kept = {
            kind: np.array([settings.kept((part, f"{kind} ")) + STEP for part in parts]) for kind in WOOD_CLASSES
        }
        self._most = max(CLEARANCE, *(float(kept.max()) for kept in self._kept.values()))
        self._ways = [_Way(swept, cut) for cut in preview.cuts]
        self._low = np.min([way.low.min(axis=0, initial=np.inf) for way in self._ways], axis=0, initial=np.inf)
        self._high = np.max([way.high.max(axis=0, initial=-np.inf) for way in self._ways], axis=0, initial=-np.inf)

    def changed(self, now: Sequence[Capsule], first: str = "") -> Reason | None:
        """An obstacle that is too near; None without one.

        Args:
            now: Current obstacles.
            first: Current point of the work; the motion before it is finished. Empty at the start.
        """
        fresh = [capsule for capsule in now if capsule not in self._known]
        spots = self._new_spots(fresh)
        if not len(spots):
            return None
        canes = tuple(capsule for capsule in now if capsule.kind == "cane")
        cordons = tuple(capsule for capsule in now if capsule.kind == "cordon")
        axes, cordon_axes = Axes(tuple(obstacles_of(canes))), Axes(tuple(obstacles_of(cordons)))
        points = {
            point.point_id: WorkPlace.of(np.array(point.position), point) for point in self._preview.request.points
        }
        cuts = self._preview.cuts
        begun = not first
        worst, found = 0.0, None
        for number, cut in enumerate(cuts):
            begun = begun or cut.point_id == first
            if not begun:
                continue
            places = [points[each.point_id] for each in cuts[number : number + 2]]
            touched = {canes[index] for index in touchable(canes, axes, places)}
            touched |= {cordons[index] for index in removable(cordons, cordon_axes, places)}
            needed = self._needed(fresh, spots, cut, touched)
            lacking, part, spot, distance = self._worst(self._ways[number], spots, needed)
            if lacking > worst:
                worst = lacking
                kind, name = fresh[int(spots[spot, 4])].kind, self._swept.shapes.parts[part]
                found = _found(kind, name, cut.point_id, distance, distance + lacking)
        return found

    def _new_spots(self, fresh: Sequence[Capsule]) -> Array:
        """Samples of the new obstacles near the motion (m×5): position, radius and index of the capsule."""
        rows = [_spots(capsule, number) for number, capsule in enumerate(fresh)]
        spots = np.vstack([*rows, np.empty((0, 5))])
        room = spots[:, 3:4] + self._most
        near = ((spots[:, :3] > self._low - room) & (spots[:, :3] < self._high + room)).all(axis=1)
        spots = np.ascontiguousarray(spots[near])
        if len(spots) and self._before:
            sticks_out = self._axes.gaps(spots[:, :3], -spots[:, 3]).min(axis=1)
            spots = np.ascontiguousarray(spots[sticks_out > SAME])
        return spots

    def _needed(self, fresh: Sequence[Capsule], spots: Array, cut: PreviewedCut, touched: set[Capsule]) -> Array:
        """Required distance of each part from each spot on the motion to a cut (p×m, m); −∞ if contact is allowed."""
        shown = min(cut.clearance, CLEARANCE) - SAME
        needed = np.maximum(np.column_stack([self._kept[capsule.kind] for capsule in fresh]), shown)
        needed[np.ix_(self._blades, [capsule in touched for capsule in fresh])] = -math.inf
        return np.ascontiguousarray(needed[:, spots[:, 4].astype(int)])

    def _worst(self, way: "_Way", spots: Array, needed: Array) -> tuple[float, int, int, float]:
        """Largest violation of the required distance (m), its part and spot, and the distance (m)."""
        shapes, out = self._swept.shapes, np.zeros(5)
        spots = np.ascontiguousarray(spots[:, :4])
        _largest_violation(way.placed, way.low, way.high, shapes.half, shapes.around, spots, needed, out)
        lacking, _, part, spot, distance = out.tolist()
        return lacking, int(part), int(spot), distance


class _Way:
    """The motion for one cut, with bounding boxes around its pieces."""

    def __init__(self, swept: SweptVolume, cut: PreviewedCut) -> None:
        on_the_way = (swept.time >= cut.begins_s) & (swept.time <= cut.ends_s)
        placed, shapes = swept.placed[on_the_way], swept.shapes
        reach = (np.linalg.norm(shapes.half, axis=1) + shapes.around)[:, None]
        pieces = [placed[first : first + _BLOCK, :, 9:] for first in range(0, len(placed), _BLOCK)]
        none = np.empty((0, 3))
        self.placed = np.ascontiguousarray(placed.reshape(-1, 12))
        self.low = np.vstack([none, *(piece.min(axis=0) - reach for piece in pieces)])
        self.high = np.vstack([none, *(piece.max(axis=0) + reach for piece in pieces)])


def _spots(capsule: Capsule, number: int) -> Array:
    """Places along the axis of a capsule (m×5)."""
    start, end = np.array(capsule.start), np.array(capsule.end)
    count = math.ceil(float(np.linalg.norm(end - start)) / _SPACING) + 1
    along = np.linspace(0.0, 1.0, count)[:, None]
    radius = max(capsule.start_radius, capsule.end_radius)
    return np.hstack([start + along * (end - start), np.tile([radius, number], (count, 1))])


def _found(kind: str, part: str, point_id: str, distance: float, needed: float) -> Reason:
    if distance > 0.0:
        return reasons.obstacle_near_way(kind, 1e3 * distance, part, point_id, 1e3 * needed)
    return reasons.obstacle_in_way(kind, part, point_id, 1e3 * needed)


@compiled(NUMBER(VECTOR, VECTOR, NUMBER, VECTOR))
def _distance(placed: Array, half: Array, around: float, spot: Array) -> float:
    """From a part, placed (12), to a ball (4: middle and radius); negative where they overlap."""
    square = 0.0
    for axis in range(3):
        along = 0.0
        for i in range(3):
            along += placed[3 * i + axis] * (spot[i] - placed[9 + i])
        over = max(abs(along) - half[axis], 0.0)
        square += over * over
    distance: float = math.sqrt(square) - around - spot[3]
    return distance


@compiled(NOTHING(PACKED, PACKED, PACKED, PACKED, VECTOR, PACKED, PACKED, VECTOR))
def _largest_violation(
    placed: Array,
    low: Array,
    high: Array,
    half: Array,
    around: Array,
    spots: Array,
    needed: Array,
    out: Array,
) -> None:
    """Write the largest violation: amount (m), row of `placed`, part, spot, distance (m); nothing without one.

    Args:
        placed: All parts of one sample after the other (k p×12).
        low: Lower corner of a box around each part over `_BLOCK` samples (blocks p×3, m).
        high: The opposite corner.
        half: Half sizes of the parts (p×3, m).
        around: Radii of the parts (p, m).
        spots: Middle and radius (m×4, m).
        needed: Required distances (p×m, m).
        out: Written (5).
    """
    parts = len(around)
    for block in range(len(low)):
        part = block % parts
        first = (block // parts) * _BLOCK
        last = min(first + _BLOCK, len(placed) // parts)
        for spot in range(len(spots)):
            room = spots[spot, 3] + needed[part, spot]
            near = room > 0.0
            for axis in range(3):
                at = spots[spot, axis]
                near = near and low[block, axis] - room < at < high[block, axis] + room
            if not near:
                continue
            for place in range(first, last):
                row = place * parts + part
                distance = _distance(placed[row], half[part], around[part], spots[spot])
                if needed[part, spot] - distance > out[0]:
                    out[0], out[1], out[2], out[3] = needed[part, spot] - distance, row, part, spot
                    out[4] = distance
