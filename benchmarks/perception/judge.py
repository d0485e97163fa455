"""Judges pruning points of a surveyed row: right cane or not, how far along, how many nodes stay, what was visible."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from benchmarks.perception.blocked import Blocker, blocked_by
from bridge.sim.camera.renderer import RgbdImage
from bridge.sim.vineyard.row import Array, Rod, Row
from bridge.sim.vineyard.truth import RightCut, judge
from rolling_panda import messages as m
from rolling_panda.messages.robot import Intrinsics
from rolling_panda.reasons import text_of

#: A point this near to the axis is on the wood (m).
ON_AXIS = 0.010
#: Share of the way from cordon to cut that was in plain view at best: from these on it is clear, and partly clear.
_CLEAR, _PARTLY = 0.9, 0.6
#: Places looked at on each rod.
_PLACES = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
_MARGIN = 12

Visibility = Literal["clear", "partly", "hidden"]


@dataclass(frozen=True)
class JudgedPoint:
    """One point that was shown; lengths in metres, angles in degrees, None where the cane is the wrong one.

    Attributes:
        seed: Of the row.
        point_id: Its name.
        vine: True vine of the wood it is on.
        spur: True spur.
        kind: Shortening of the keeper, or renewal.
        visibility: Of the spur, over all frames.
        right_cane: On the cane (or stub) that the judge cuts.
        right: On it, and within the right interval.
        along_error: Beyond the best place, signed.
        off_axis: From the true axis.
        plane_error: Between its tangent and the wood.
        nodes_left: Count nodes that would stay.
        confidence: As told.
        reason: As told.
    """

    seed: int
    point_id: str
    vine: int
    spur: int
    kind: str
    visibility: Visibility
    right_cane: bool
    right: bool
    along_error: float | None
    off_axis: float
    plane_error: float | None
    nodes_left: int | None
    confidence: float
    reason: str


@dataclass
class Sight:
    """What one has to see of a place: places on its wood (N×3, m), the rod of each, and the best share seen at once."""

    places: Array
    rods: "np.ndarray[tuple[int], np.dtype[np.int64]]"
    best: float = 0.0


@dataclass
class RowJudge:
    """Follows a survey frame by frame, then judges what came of it."""

    row: Row
    seed: int
    _sights: dict[tuple[int, int], Sight] = field(default_factory=dict)
    _cuts: dict[tuple[int, int], RightCut] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Collect where one has to look on each spur."""
        for truth in judge(self.row):
            if truth.cut is None:
                continue
            rods = [
                (index, rod)
                for index, rod in self.row.standing()
                if (rod.vine, rod.spur) == (truth.vine, truth.spur)
                and (rod.kind == "spur" or (rod.cane == truth.keeper and index <= truth.cut.rod))
            ]
            self._cuts[truth.vine, truth.spur] = truth.cut
            self._sights[truth.vine, truth.spur] = Sight(*sight_places(self.row, rods))

    def look(self, image: RgbdImage, k: Intrinsics, T_world_camera: Array) -> None:
        """Take note of what one frame shows."""
        for sight in self._sights.values():
            x, y, z = ((sight.places - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]).T
            if z.min() <= 0.1:
                continue
            u, v = np.rint(k.cx + k.fx * x / z).astype(int), np.rint(k.cy + k.fy * y / z).astype(int)
            if u.min() < _MARGIN or v.min() < _MARGIN or u.max() >= k.width - _MARGIN or v.max() >= k.height - _MARGIN:
                continue
            seen = np.zeros(len(u), dtype=bool)
            for dv in (-1, 0, 1):
                for du in (-1, 0, 1):
                    seen |= image.rods[v + dv, u + du] == sight.rods
            sight.best = max(sight.best, float(seen.mean()))

    def visibility(self, vine: int, spur: int) -> Visibility:
        """How well a spur was seen at best."""
        sight = self._sights.get((vine, spur))
        best = 0.0 if sight is None else sight.best
        return "clear" if best >= _CLEAR else "partly" if best >= _PARTLY else "hidden"

    def spurs(self) -> tuple[tuple[int, int], ...]:
        """Vine and number of each spur that has a right cut and was in view."""
        return tuple(place for place, sight in self._sights.items() if sight.best > 0.0)

    def kind(self, spur: int) -> str:
        """Kind of the cut that belongs to a place."""
        return "spur cut"

    def blocked(self, vine: int, spur: int) -> Blocker:
        """What is in the blades' way wherever the right cut may be made; empty for nothing."""
        return blocked_by(self.row, self._cuts[vine, spur])

    def point(self, point: m.PruningPoint) -> JudgedPoint:
        """Judge one point."""
        position, tangent = np.array(point.position), np.array(point.tangent)
        off_axis, rod = nearest_rod(self.row, position)
        truth = next(t for t in judge(self.row) if (t.vine, t.spur) == (rod.vine, rod.spur))
        renewal = point.kind == "renewal cut"
        cut: RightCut | None = truth.renewal if renewal else truth.cut
        right_cane = cut is not None and (rod.kind == "spur" if renewal else rod.cane == truth.keeper)
        along = cut.past_best(position) if right_cane and cut is not None else None
        inside = cut is not None and float((position - cut.least) @ cut.tangent) >= 0.0 >= cut.past_most(position)
        plane = nodes = None
        if right_cane and cut is not None:
            plane = float(np.degrees(np.arccos(np.clip(abs(float(tangent @ cut.tangent)), 0.0, 1.0))))
            nodes = int(np.sum((truth.nodes - position) @ cut.tangent < 0.0)) if len(truth.nodes) else 0
        return JudgedPoint(
            seed=self.seed,
            point_id=point.point_id,
            vine=rod.vine,
            spur=rod.spur,
            kind="renewal cut" if renewal else "spur cut",
            visibility=self.visibility(rod.vine, rod.spur),
            right_cane=bool(right_cane),
            right=bool(right_cane and inside and off_axis < ON_AXIS),
            along_error=along,
            off_axis=off_axis,
            plane_error=plane,
            nodes_left=nodes,
            confidence=point.confidence,
            reason=text_of(point.reason),
        )


def nearest_rod(row: Row, position: Array) -> tuple[float, Rod]:
    """Distance (m) and rod of the spurs' and canes' wood whose axis is nearest to a place (3, m); laterals are none."""
    distance, _, rod = min(
        ((_distance(rod, position), index, rod) for index, rod in row.standing() if rod.spur >= 0 and rod.organ < 0),
        key=lambda found: found[:2],
    )
    return distance, rod


def sight_places(row: Row, rods: list[tuple[int, Rod]]) -> tuple[Array, "np.ndarray[tuple[int], np.dtype[np.int64]]"]:
    """Places on rods (N×3, m) that one has to see, and the rod of each; none inside the bark of what carries them."""
    places = np.concatenate([rod.start + _PLACES[:, None] * (rod.end - rod.start) for _, rod in rods])
    numbers = np.repeat([index for index, _ in rods], len(_PLACES))
    inside = np.array([_buried(row, rod, share) for _, rod in rods for share in _PLACES])
    return places[~inside], numbers[~inside]


def _buried(row: Row, rod: Rod, share: float) -> bool:
    parent = row.rods[rod.parent] if rod.parent >= 0 else None
    return parent is not None and parent.kind != rod.kind and _distance(parent, rod.at(share)[0]) < parent.start_radius


def _distance(rod: Rod, point: Array) -> float:
    axis = rod.end - rod.start
    share = float(np.clip((point - rod.start) @ axis / (axis @ axis), 0.0, 1.0))
    return float(np.linalg.norm(point - rod.start - share * axis))
