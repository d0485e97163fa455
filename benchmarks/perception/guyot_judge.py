"""Judges points of a surveyed row of Guyot vines: back to a spur, past the nodes that fruit, last year's cane off."""

from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.perception.judge import ON_AXIS, JudgedPoint, RowJudge, Sight, nearest_rod, sight_places
from bridge.sim.vineyard.row import Array, Rod
from bridge.sim.vineyard.truth import RightCut, judge_guyot
from rolling_panda import messages as m
from rolling_panda.reasons import text_of

#: What the lower and the upper cane of a vine's spur and last year's cane are cut for; these numbers stand for the
#: spur's in results.
KINDS = ("spur cut", "cane cut", "removal")


@dataclass(frozen=True)
class _Wanted:
    """A right cut: its kind, the rods of the wood that it is on, and the middles of its count nodes (N×3, m)."""

    kind: int
    wood: tuple[Rod, ...]
    cut: RightCut
    nodes: Array


@dataclass
class GuyotJudge(RowJudge):
    """Follows a survey frame by frame, then judges what came of it."""

    _wanted: dict[tuple[int, int], _Wanted] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Collect the right cuts, and where one has to look for each."""
        for truth in judge_guyot(self.row):
            for kind, (cane, cut) in enumerate(((truth.lower, truth.spur_cut), (truth.upper, truth.cane_cut))):
                if cut is None:
                    continue
                own = [(k, rod) for k, rod in self.row.standing() if (rod.vine, rod.spur) == (truth.vine, 0)]
                middles = [rod.at(0.5)[0] for _, rod in own if rod.kind == "node" and rod.cane == cane][1:]
                wood = tuple(rod for _, rod in own if rod.cane == cane)
                wanted = _Wanted(kind, wood, cut, np.array(middles).reshape(-1, 3))
                self._wanted[truth.vine, kind] = wanted
                self._cuts[truth.vine, kind] = cut
                seen = [(k, rod) for k, rod in own if rod.kind == "spur" or (rod.cane == cane and k <= cut.rod)]
                self._sights[truth.vine, kind] = Sight(*sight_places(self.row, seen))
            number = truth.removal.rod
            rod = self.row.rods[number]
            assert rod is not None
            last = len(KINDS) - 1
            self._wanted[truth.vine, last] = _Wanted(last, (rod,), truth.removal, np.zeros((0, 3)))
            self._cuts[truth.vine, last] = truth.removal
            self._sights[truth.vine, last] = Sight(*sight_places(self.row, [(number, rod)]))

    def spurs(self) -> tuple[tuple[int, int], ...]:
        """Vine and number of each right cut, also of those that no frame had in view."""
        return tuple(self._wanted)

    def kind(self, spur: int) -> str:
        """Kind of the cut that belongs to a place."""
        return KINDS[spur]

    def point(self, point: m.PruningPoint) -> JudgedPoint:
        """Judge one point."""
        position, tangent = np.array(point.position), np.array(point.tangent)
        off_axis, rod = nearest_rod(self.row, position)
        kind = KINDS.index(point.kind if point.kind in KINDS else "spur cut")
        told = JudgedPoint(
            seed=self.seed,
            point_id=point.point_id,
            vine=rod.vine,
            spur=kind,
            kind=KINDS[kind],
            visibility=self.visibility(rod.vine, kind),
            right_cane=False,
            right=False,
            along_error=None,
            off_axis=off_axis,
            plane_error=None,
            nodes_left=None,
            confidence=point.confidence,
            reason=text_of(point.reason),
        )
        wanted = self._wanted.get((rod.vine, kind))
        if wanted is None or not any(rod is each for each in wanted.wood):
            return told
        cut = wanted.cut
        inside = float((position - cut.least) @ cut.tangent) >= 0.0 >= cut.past_most(position)
        return replace(
            told,
            right_cane=True,
            right=inside and off_axis < ON_AXIS,
            along_error=cut.past_best(position),
            plane_error=float(np.degrees(np.arccos(np.clip(abs(float(tangent @ cut.tangent)), 0.0, 1.0)))),
            nodes_left=int(np.sum((wanted.nodes - position) @ cut.tangent < 0.0)),
        )
