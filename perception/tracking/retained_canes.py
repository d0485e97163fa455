"""What will still stand of the canes once the row is pruned: wood that the robot keeps away from, as capsules.

Of a cane with a proposed cut that is what lies below it, of the other canes on a spur whose keeper is chosen nothing,
since they go. Where the choice is left to a person any cane may be the one that stays: each counts as far as the rule
would leave it at most.

A capsule that was told stays as it is until the cane is seen somewhere else, so that noise moves nothing.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from perception.config import ObstacleConfig, RuleConfig
from perception.plant.map import KnownCane, KnownSpur
from perception.plant.model import Array
from perception.plant.numbering import SpurNumber
from perception.rules.spur import count_nodes
from perception.segmentation.frame import View
from perception.tracking.tracker import Proposal
from perception.tracking.wood_check import glances
from rolling_panda.messages.perception import Capsule

#: A cut this near to an axis is on this cane (m).
_ON_CANE = 0.015
#: The wood's end at a cut is the blades' (m).
_BELOW = 0.010
#: A cane seen nearer than this to where it was told stands there still (m); the same for its radius.
_MOVED, _THICKER = 0.008, 0.001
#: The axis may be this far beside its capsules (m).
_STRAIGHT = 0.004
#: Samples of an axis are so far apart (m); every so many are looked at for whether they still stand.
_SAMPLE, _GLANCE_EVERY = 0.005, 4
#: Share of the samples seen that must be gone, so many samples at least, and frames that must agree.
_SHARE_GONE, _LEAST_SEEN, _FRAMES_GONE = 0.7, 3, 3
#: Canes whose base is farther from the camera are not looked at (m).
_FAR = 1.6
#: Longest internode (m): what a cane whose nodes were not all seen keeps at most.
_INTERNODE = 0.10
#: Shorter remains are nothing to keep away from (m).
_SHORTEST = 0.02


@dataclass(eq=False)
class _Cane:
    """One cane: where it will be cut, what was told of it, and how often it was found gone.

    Attributes:
        cut: Arc length of the lowest cut proposed on it (m), also after it was made; infinite without one.
        keeper: Whether the rule chose it.
        axis: As told, K×3 in odom (m), `_SAMPLE` apart; None while nothing is told.
        radius: As told (m).
        capsules: As told.
        gone: Frames in a row that showed it gone.
        looks: That showed it.
        doubted: The same when it was found gone: it counts again only after more of them.
    """

    cut: float = np.inf
    keeper: bool = False
    axis: Array | None = None
    radius: float = 0.0
    capsules: tuple[Capsule, ...] = field(default=())
    gone: int = 0
    looks: int = 0
    doubted: int = 0

    def away(self, place: Array) -> float:
        """Distance of its base from a place (3, m); infinite while nothing is told."""
        return np.inf if self.axis is None else float(np.linalg.norm(self.axis[0] - place))

    def withdraw(self) -> None:
        self.axis, self.capsules, self.gone = None, (), 0


class RetainedCanes:
    """Remembers which canes stay. One frame at a time, no clock."""

    def __init__(self, config: ObstacleConfig) -> None:
        """Nothing is known yet."""
        self._config = config
        self._canes: dict[tuple[SpurNumber, int], _Cane] = {}

    def update(
        self,
        view: View,
        labels: NDArray[np.uint8],
        spurs: Iterable[KnownSpur],
        cuts: Sequence[Proposal],
        rule: RuleConfig,
        most: int,
    ) -> tuple[Capsule, ...]:
        """Take one frame in; what is known to stay now.

        Args:
            view: The frame.
            labels: Its classes, H×W.
            spurs: Those whose canes may have been seen anew.
            cuts: All that are proposed.
            rule: What it leaves.
            most: Capsules at most, of the canes nearest to the camera.
        """
        self.choose(spurs, cuts, rule)
        for cane in self._canes.values():
            if cane.away(view.t) < _FAR:
                self._glance(cane, view, labels)
        # In the same order every time, so that a message where nothing is new equals the one before.
        standing = sorted(self._canes.values(), key=lambda cane: cane.away(view.t))
        nearest: list[_Cane] = []
        for cane in standing:
            if sum(len(other.capsules) for other in nearest) + len(cane.capsules) > most:
                break
            nearest.append(cane)
        return tuple(c for cane in self._canes.values() if cane in nearest for c in cane.capsules)

    def choose(self, spurs: Iterable[KnownSpur], cuts: Sequence[Proposal], rule: RuleConfig) -> None:
        """Judge the canes of some spurs anew; see `update`."""
        for spur in spurs:
            here = [proposal.cut for proposal in cuts if proposal.number == spur.number]
            canes = [self._canes.setdefault((spur.number, k), _Cane()) for k in range(len(spur.canes))]
            places: dict[int, list[float]] = {}
            for cut in here:
                k, arc, gap = _nearest(spur, cut.position)
                # A renewal cut is on the stub, near which all of its canes begin.
                if gap < _ON_CANE and cut.kind != "renewal cut":
                    places.setdefault(k, []).append(arc)
                    canes[k].keeper = canes[k].keeper or cut.kind == "spur cut"
            for k, known in enumerate(spur.canes):
                if k in places:
                    canes[k].cut = min(places[k])
                elif np.isinf(known.cut_at):
                    # Proposed no more, and not made.
                    canes[k].cut, canes[k].keeper = np.inf, False
            # A Guyot spur keeps two canes, one cut or not.
            decided = rule.system == "spur" and any(cane.keeper for cane in canes)
            for cane, known in zip(canes, spur.canes, strict=True):
                cane.looks = known.base.looks
                goes = decided and np.isinf(cane.cut)
                often = 2 * cane.looks >= spur.position.looks and cane.looks >= self._config.hits + cane.doubted
                if goes or not often:
                    cane.withdraw()
                else:
                    open_choice = rule.system == "spur" and not decided
                    _tell(cane, known, _end(cane, known, rule), spur.number, open_choice)

    def _glance(self, cane: _Cane, view: View, labels: NDArray[np.uint8]) -> None:
        assert cane.axis is not None
        said = glances(view, labels, cane.axis[2::_GLANCE_EVERY])
        gone, seen = said.count("gone"), len(said) - said.count("unseen")
        if seen < min(_LEAST_SEEN, len(said)) or seen == 0:
            return
        cane.gone = cane.gone + 1 if gone >= _SHARE_GONE * seen else 0
        if cane.gone >= _FRAMES_GONE:
            cane.withdraw()
            cane.doubted = cane.looks


def _end(cane: _Cane, known: KnownCane, rule: RuleConfig) -> float:
    """Arc length at which what stays ends (m)."""
    if np.isfinite(cane.cut):
        return cane.cut - _BELOW
    kept = rule.fruiting_nodes if rule.system == "guyot" else rule.nodes_kept
    nodes = count_nodes(known.as_cane(), rule)
    if len(nodes) >= kept:
        return nodes[kept - 1].arc + rule.offset - _BELOW
    return rule.basal_reach + kept * _INTERNODE


def _tell(cane: _Cane, known: KnownCane, end: float, number: SpurNumber, undecided: bool) -> None:
    """Put what is known now in place of what was told, where it is something else."""
    axis, radius = _sampled(known, end), float(known.radius.mean[0])
    if float(np.linalg.norm(axis[-1] - axis[0])) < _SHORTEST:
        cane.withdraw()
        return
    same = cane.axis is not None and cane.capsules[0].undecided == undecided and abs(radius - cane.radius) < _THICKER
    if same and cane.axis is not None and _apart(axis, cane.axis) < _MOVED:
        return
    cane.axis, cane.radius = axis, radius
    corners = _corners(axis)
    cane.capsules = tuple(
        Capsule("cane", _vector(start), _vector(stop), radius, radius, number.vine, number.spur, undecided)
        for start, stop in zip(corners, corners[1:], strict=False)
    )


def _sampled(known: KnownCane, end: float) -> Array:
    """The axis up to an arc length (K×3, m)."""
    best = known.best
    start = float(best.arc[0])
    end = min(max(end, start), best.length)
    arcs = np.linspace(start, end, max(2, round((end - start) / _SAMPLE) + 1))
    return np.stack([np.interp(arcs, best.arc, best.axis[:, i]) for i in range(3)], axis=1)


def _apart(first: Array, second: Array) -> float:
    """How far the farthest sample of either axis is from the other one (m)."""
    gaps = cdist(first, second)
    return float(max(gaps.min(axis=0).max(), gaps.min(axis=1).max()))


def _corners(axis: Array) -> list[Array]:
    """Corners of the line that is nowhere farther than `_STRAIGHT` from the axis (Douglas and Peucker, 1973)."""
    start, chord = axis[0], axis[-1] - axis[0]
    length = max(float(np.linalg.norm(chord)), 1e-9)
    away = np.linalg.norm(np.cross(axis - start, chord / length), axis=1)
    k = int(np.argmax(away))
    if away[k] <= _STRAIGHT or len(axis) <= 2:
        return [axis[0], axis[-1]]
    return [*_corners(axis[: k + 1])[:-1], *_corners(axis[k:])]


def _nearest(spur: KnownSpur, place: Array) -> tuple[int, float, float]:
    """Index of the cane nearest to a place, the arc length there and the distance (m)."""
    best = 0, 0.0, np.inf
    for index, cane in enumerate(spur.canes):
        gaps = np.linalg.norm(cane.best.axis - place, axis=1)
        k = int(np.argmin(gaps))
        if gaps[k] < best[2]:
            best = index, float(cane.best.arc[k]), float(gaps[k])
    return best


def _vector(point: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in point)
    return x, y, z
