"""Retained canes: the parts of canes that stay after pruning, as obstacle capsules.

A cane with a proposed cut is retained below the cut. The other canes of a spur with a chosen keeper are removed; a
renewal cut names the keeper, too. On an undecided spur every cane may stay. Where no cut is known on a cane, it is
retained up to the longest length that the rule may leave.

A published capsule does not change until its cane is seen elsewhere, so that noise does not move it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.distance import cdist

from perception.arrays import Array, Labels, distance, interpolate
from perception.config import ObstacleConfig, RuleConfig
from perception.plant.map import KnownCane, KnownSpur
from perception.plant.numbering import SpurNumber
from perception.rules.pruning import count_nodes, miscount_reason, origin
from perception.segmentation.frame import View
from perception.tracking.presence import wood_presence
from perception.tracking.tracker import Proposal
from rolling_panda.messages.perception import Capsule
from rolling_panda.model.wire_values import vector3

#: Largest distance of a cut from the axis of its cane (m).
_ON_CANE = 0.015
#: Length below a cut that the blades occupy (m).
_BLADES = 0.010
#: Tolerances of a published position and radius (m).
_POSITION_TOLERANCE, _RADIUS_TOLERANCE = 0.008, 0.001
#: Largest distance of the axis from its capsules (m).
_MAX_DEVIATION = 0.004
#: Spacing of axis samples (m), and stride of the samples that are checked for presence.
_SPACING, _PRESENCE_STRIDE = 0.005, 4
#: A cane is gone if this fraction of its visible samples, and at least this number, is gone in this many frames.
_GONE_SHARE, _MIN_VISIBLE, _GONE_FRAMES = 0.7, 3, 3
#: Canes whose base is farther from the camera are not checked (m).
_MAX_RANGE = 1.6
#: Length of a cane that tells where its hidden rest goes, and most of that rest that is told (m).
_DIRECTION, _LONGEST_HIDDEN = 0.03, 0.06
#: Longest internode (m), for a cane whose nodes were not all seen.
_MAX_INTERNODE = 0.10
#: Canes of two spurs whose bases are farther apart than this are two (m).
_SAME_BASE = 0.03
#: Shorter remains are ignored (m).
_MIN_LENGTH = 0.02


@dataclass(eq=False)
class _Cane:
    """State of one cane.

    Attributes:
        cut: Arc length of its lowest proposed cut (m), also after the cut was made; infinite without one.
        keeper: Whether the rule chose it.
        axis: Published axis, K×3 in odom (m), `_SPACING` apart; None while it is not published.
        begin: Published place where its axis meets that of its stub (3, m, odom); None where that is not published.
        radius: Published radius (m).
        undecided: Whether it is published as one of an undecided site.
        capsules: Published capsules.
        gone: Consecutive frames that showed it gone.
        observations: Of the map.
        gone_at: Observations when it was found gone: it is published again only after more of them.
    """

    cut: float = np.inf
    keeper: bool = False
    axis: Array | None = None
    begin: Array | None = None
    radius: float = 0.0
    undecided: bool = False
    capsules: tuple[Capsule, ...] = field(default=())
    gone: int = 0
    observations: int = 0
    gone_at: int = 0

    def range(self, camera: Array) -> float:
        """Distance of its base from the camera (3, m); infinite while it is not published."""
        return np.inf if self.axis is None else distance(self.axis[0], camera)

    def withdraw(self) -> None:
        self.axis, self.capsules, self.gone = None, (), 0


class RetainedCanes:
    """Publishes the retained canes of the map."""

    def __init__(self, config: ObstacleConfig) -> None:
        """Start without canes."""
        self._config = config
        self._canes: dict[tuple[SpurNumber, int], _Cane] = {}

    def update(
        self,
        view: View,
        labels: Labels,
        spurs: Iterable[KnownSpur],
        cuts: Sequence[Proposal],
        rule: RuleConfig,
        max_capsules: int,
    ) -> tuple[Capsule, ...]:
        """Add one frame; returns the capsules.

        Args:
            view: The frame.
            labels: H×W class indices.
            spurs: Those seen in this frame.
            cuts: All proposed cuts.
            rule: Pruning rule.
            max_capsules: Largest number of capsules; the nearest canes come first.
        """
        self.select(spurs, cuts, rule)
        for cane in self._canes.values():
            if cane.range(view.t) < _MAX_RANGE:
                _check_presence(cane, view, labels)
        nearest: list[_Cane] = []
        for cane in sorted(self._distinct(), key=lambda cane: cane.range(view.t)):
            if sum(len(other.capsules) for other in nearest) + len(cane.capsules) > max_capsules:
                break
            nearest.append(cane)
        # In constant order, so that messages without news are equal.
        return tuple(c for cane in self._canes.values() if cane in nearest for c in cane.capsules)

    def _distinct(self) -> list[_Cane]:
        """The published canes; of those that run along each other on two spurs, the one that was seen more often."""
        known = [(number, cane, cane.axis) for (number, _), cane in self._canes.items() if cane.axis is not None]
        bases = np.array([axis[0] for _, _, axis in known]).reshape(-1, 3)
        twice: set[int] = set()
        for i, j in np.argwhere(np.triu(cdist(bases, bases) < _SAME_BASE, 1)).tolist():
            (spur, cane, axis), (other_spur, other, other_axis) = known[i], known[j]
            short, long = sorted((axis, other_axis), key=len)
            if spur != other_spur and cdist(short, long).min(axis=1).max() < _POSITION_TOLERANCE:
                twice.add(j if cane.observations >= other.observations else i)
        return [cane for k, (_, cane, _) in enumerate(known) if k not in twice]

    def select(self, spurs: Iterable[KnownSpur], cuts: Sequence[Proposal], rule: RuleConfig) -> None:
        """Select the retained canes of some spurs again; arguments as of `update`."""
        for spur in spurs:
            here = [each.cut for each in cuts if each.number == spur.number and each.cut.kind != "removal"]
            canes = [self._canes.setdefault((spur.number, k), _Cane()) for k in range(len(spur.canes))]
            arcs: dict[int, float] = {}
            chosen: set[int] = set()
            stub = spur.stub if any(cut.kind == "renewal cut" for cut in here) else None
            for cut in here:
                k, gap, arc = spur.nearest_cane(cut.position)
                if cut.kind == "renewal cut":
                    # It is on the stub, and names the cane that stays on it.
                    chosen.add(cut.cane)
                elif gap < _ON_CANE:
                    arcs[k] = min(arc, arcs.get(k, np.inf))
                    canes[k].keeper = canes[k].keeper or cut.kind == "spur cut"
            for k, known in enumerate(spur.canes):
                if k in arcs:
                    canes[k].cut = arcs[k]
                elif np.isinf(known.cut_at):
                    # Without a proposal, and the cut was not made.
                    canes[k].cut, canes[k].keeper = np.inf, k in chosen
            # A Guyot spur keeps two canes.
            decided = rule.system == "spur" and any(cane.keeper for cane in canes)
            for cane, known in zip(canes, spur.canes, strict=True):
                cane.observations = known.base.count
                removed = decided and np.isinf(cane.cut) and not cane.keeper
                seen_often = cane.keeper or 2 * cane.observations >= spur.position.count
                confirmed = seen_often and cane.observations >= self._config.min_hits + cane.gone_at
                if removed or not confirmed:
                    cane.withdraw()
                else:
                    undecided = rule.system == "spur" and not decided
                    begin = None if stub is None or known.number not in chosen else _begin(known, stub)
                    _publish(cane, known, begin, _retained_length(cane, known, rule), spur.number, undecided)


def _check_presence(cane: _Cane, view: View, labels: Labels) -> None:
    assert cane.axis is not None
    samples = wood_presence(view, labels, cane.axis[2::_PRESENCE_STRIDE])
    gone, visible = samples.count("gone"), len(samples) - samples.count("not visible")
    if visible == 0 or visible < min(_MIN_VISIBLE, len(samples)):
        return
    cane.gone = cane.gone + 1 if gone >= _GONE_SHARE * visible else 0
    if cane.gone >= _GONE_FRAMES:
        cane.withdraw()
        cane.gone_at = cane.observations


def _retained_length(cane: _Cane, known: KnownCane, rule: RuleConfig) -> float:
    """Arc length of the end of the retained part (m)."""
    if np.isfinite(cane.cut):
        return cane.cut - _BLADES
    kept = rule.fruiting_nodes if rule.system == "guyot" else rule.nodes_kept
    nodes = count_nodes(known.as_cane(), rule)
    if len(nodes) >= kept and (rule.system == "guyot" or miscount_reason(known.as_cane(), nodes, rule) is None):
        return nodes[kept - 1].arc + rule.offset - _BLADES
    return rule.basal_bud_distance + kept * _MAX_INTERNODE


def _begin(known: KnownCane, stub: Array) -> Array:
    """Where the axis of a cane meets that of its stub (3, m); the stub hides the cane up to its bark or farther."""
    along = (stub[1] - stub[0]) / max(distance(stub[1], stub[0]), 1e-9)
    out: Array = stub[0] + origin(known.as_cane(), stub[0], along)[0] * along
    return out


def _publish(
    cane: _Cane, known: KnownCane, begin: Array | None, end: float, number: SpurNumber, undecided: bool
) -> None:
    """Replace the capsules of a cane where they differ by more than the tolerances."""
    axis, radius = _sampled(known, end), float(known.radius.mean[0])
    if distance(axis[-1], axis[0]) < _MIN_LENGTH:
        cane.withdraw()
        return
    if (
        cane.axis is not None
        and cane.undecided == undecided
        and _near(begin, cane.begin)
        and abs(radius - cane.radius) < _RADIUS_TOLERANCE
        and _hausdorff(axis, cane.axis) < _POSITION_TOLERANCE
    ):
        return
    cane.axis, cane.begin, cane.radius, cane.undecided = axis, begin, radius, undecided
    corners = _simplify(axis)
    pieces = [(start, stop, undecided) for start, stop in zip(corners, corners[1:], strict=False)]
    if begin is not None:
        # The stub hides it there, and shears that cut the stub must not close on it.
        pieces.insert(0, (begin, axis[0], True))
    # What hides the end of a cane does not end it; where it goes is not sure.
    rest = min(end - known.best.length, _LONGEST_HIDDEN)
    if rest > 0.0 and known.best.end == "hidden" and np.isinf(known.cut_at):
        along = axis[-1] - known.best.at(known.best.length - _DIRECTION)
        pieces.append((axis[-1], axis[-1] + rest * along / max(float(np.linalg.norm(along)), 1e-9), True))
    cane.capsules = tuple(
        Capsule("cane", vector3(start), vector3(stop), radius, radius, number.vine, number.spur, unsure, known.number)
        for start, stop, unsure in pieces
    )


def _near(one: Array | None, other: Array | None) -> bool:
    if one is None or other is None:
        return one is other
    return distance(one, other) < _POSITION_TOLERANCE


def _sampled(known: KnownCane, end: float) -> Array:
    """The axis up to an arc length (K×3, m)."""
    best = known.best
    start = float(best.arc[0])
    end = min(max(end, start), best.length)
    arcs = np.linspace(start, end, max(2, round((end - start) / _SPACING) + 1))
    return interpolate(arcs, best.arc, best.axis)


def _hausdorff(first: Array, second: Array) -> float:
    """Hausdorff distance of two axes (m)."""
    gaps = cdist(first, second)
    return float(max(gaps.min(axis=0).max(), gaps.min(axis=1).max()))


def _simplify(axis: Array) -> list[Array]:
    """Corners of a polyline within `_MAX_DEVIATION` of the axis (Douglas and Peucker, 1973)."""
    start, chord = axis[0], axis[-1] - axis[0]
    length = max(float(np.linalg.norm(chord)), 1e-9)
    away = np.linalg.norm(np.cross(axis - start, chord / length), axis=1)
    k = int(np.argmax(away))
    if away[k] <= _MAX_DEVIATION or len(axis) <= 2:
        return [axis[0], axis[-1]]
    return [*_simplify(axis[: k + 1])[:-1], *_simplify(axis[k:])]
