"""Pruning rules: from one spur to cuts, or to the reason why there is none.

Spur pruning: the lowest cane that is thick enough, else the thickest, becomes the new spur (the keeper). It is cut
past its second count node. A renewal cut beyond the keeper removes the old stub with the other canes.

Guyot pruning: of two canes the lower one becomes the next spur, and the upper one the fruiting cane. Last year's cane
is cut off beside the head.

Nothing is extrapolated: nodes that were not seen are not counted.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Literal

import numpy as np
from msgspec.structs import replace

from perception.arrays import Array, distance
from perception.config import RuleConfig
from perception.plant.model import Cane, Node, Spur
from perception.rules.keep_out import APPROACH, NO_KEEP_OUT, KeepOut
from rolling_panda import reasons
from rolling_panda.commands import SURE
from rolling_panda.messages.types import CutKind, Reason

#: Shear stress at which a cane parts under a flat-edged blade (Pa): Sessiz, Eliçin and Bayhan, "Cutting force and
#: energy requirement of Boğazkere grape cane", Scientific Papers B, Horticulture LXIII, 2019, in the pruning season.
#: Other cultivars and seasons in these authors' papers lie between 9.6 and 22 MPa.
CUTTING_STRENGTH = 9.34e6
#: Half the length of wood around a cut that must be visible (m).
_VISIBLE_HALF_WIDTH = 0.008
#: Confidence of a renewal cut beside a cane whose own cut is undecided: never one that is accepted unseen.
_DOUBTFUL = 0.5
#: Largest shift of a cut from its best place towards the last kept node, and away from it (m), where the blades have no
#: room. With an offset of 20 mm the cut stays 10 to 30 mm past the node, also if its place is off by 3 mm.
INWARD, OUTWARD = 0.005, 0.007
#: A fruiting cane may be cut up to so near to the node past those that it keeps (m).
_BEFORE_NEXT = 0.022
#: Spacing of places that are looked at for that (m).
_PLACE_STEP = 0.001
#: Turns, tilts and leans of the blades in a renewal cut, as shares of the largest.
_SHARES = (0.0, 0.5, -0.5, 1.0, -1.0)
#: Places of a renewal cut between the cane that stays and the next one, by shares of the way, in order of preference.
_STUB_SHARES = (0.5, 0.65, 0.8)
#: Length of a cane that gives its direction at the base (m), least sine of its angle to the stub, and most that the
#: stub hides of its axis (m).
_BASE, _LEAST_SINE, _THICK = 0.025, 0.2, 0.015
#: Reasons against a cut that other pictures propose: they see its nodes or canes otherwise. All others only tell that a
#: picture shows too little.
_AGAINST = {"nodes_side_by_side", "nodes_far_apart", "cane_below_keeper", "keeper_close"}
#: Last year's cane is cut so far from its trunk, and farther out where there is no room, up to here, in steps
#: (m). A stump of twice its diameter or more dries, and the head stays sound.
_STUMP, _LONGEST_STUMP, _SEARCH_STEP = 0.04, 0.12, 0.01
#: By so much nearer to the trunk it may be cut (m).
_SHORTER_STUMP = 0.01


@dataclass(frozen=True)
class Cut:
    """A proposed cut.

    Attributes:
        kind: Spur cut (shortening of the keeper), renewal cut (removal of the stub beyond it), cane cut (shortening of
            the fruiting cane, Guyot), removal (of last year's cane, Guyot), or by hand.
        position: On the axis of the wood (3, m, odom).
        tangent: Unit vector along the wood, away from the cordon (3, odom).
        radius: Of the wood (m).
        confidence: 0…1, see `cut_confidence`.
        nodes_seen: Count nodes seen on the keeper.
        nodes_kept: Count nodes left.
        reason: Explanation for a grower.
        offset: Distance past the last kept node along the wood (m); None where no node is below the cut.
        node_distance: Distance to the nearest kept node (m); None where none is known.
        cane: Number of the cane on its spur, of a renewal cut that of the cane that stays; -1 where it has none.
        inward: By how much nearer to the cordon the cut may be made, where the blades have no room (m).
        outward: The same farther from the cordon.
    """

    kind: CutKind
    position: Array
    tangent: Array
    radius: float
    confidence: float
    nodes_seen: int
    nodes_kept: int
    reason: Reason
    offset: float | None = None
    node_distance: float | None = None
    cane: int = -1
    inward: float = 0.0
    outward: float = 0.0


@dataclass(frozen=True)
class Decision:
    """Cuts of one spur, the reasons that are told, and for each kind of cut without a proposal the reason."""

    cuts: tuple[Cut, ...] = ()
    undecided: tuple[Reason, ...] = ()
    refused: tuple[tuple[CutKind, Reason], ...] = ()

    @property
    def contradicted(self) -> frozenset[CutKind]:
        """The kinds of cut that it speaks against."""
        return frozenset(kind for kind, why in self.refused if _speaks_against(why))

    def about(self, reason: Reason) -> frozenset[CutKind]:
        """The kinds of cut that a reason is against; none where it is about the whole spur."""
        return frozenset(kind for kind, why in self.refused if why == reason)

    @classmethod
    def of(cls, results: dict[CutKind, Cut | Reason], undecided: tuple[Reason, ...]) -> "Decision":
        """From a cut of each kind or the reason why there is none, and the reasons that are told."""
        cuts = tuple(result for result in results.values() if isinstance(result, Cut))
        refused = tuple((kind, result) for kind, result in results.items() if isinstance(result, Reason))
        return cls(cuts, undecided, refused)


def _speaks_against(reason: Reason) -> bool:
    parts = (value for _, value in reason.values if isinstance(value, Reason))
    return reason.code in _AGAINST or any(_speaks_against(part) for part in parts)


@dataclass(frozen=True)
class _Keeper:
    """The cane that stays, why it does, and the number of canes on the spur.

    `turns_on` is the least change of one diameter with which another one would stay (m), where that makes it unsure.
    """

    cane: Cane
    chosen: Literal["only", "lowest", "thickest", "lower", "upper"]
    canes: int
    certainty: float = 1.0
    turns_on: float | None = None

    def explained(self, cut: Reason) -> Reason:
        """The reason of a cut, with what its choice turns on."""
        return cut if self.turns_on is None else reasons.close_choice(cut, 1000 * self.turns_on)


def apply_rule(
    spur: Spur,
    config: RuleConfig,
    other_canes: Array | None = None,
    keep_out: KeepOut = NO_KEEP_OUT,
    old_cane: Cane | None = None,
) -> Decision:
    """Apply the rule of the configured training system to one spur.

    Args:
        spur: The spur with its canes.
        config: Pruning rule.
        other_canes: Axis points of canes of other spurs, N×3 in odom (m).
        keep_out: Keep-out zones of the blades.
        old_cane: Last year's cane beside the spur of a Guyot vine.
    """
    others = [] if other_canes is None else [other_canes]
    if config.system == "guyot":
        return _prune_guyot(spur, config, others, keep_out, old_cane)
    return _prune_spur(spur, config, others, keep_out)


def cutting_force(radius: float) -> float:
    """Force (N) that parts round wood of a radius (m): strength times cross-section."""
    return CUTTING_STRENGTH * math.pi * radius**2


def _prune_spur(spur: Spur, config: RuleConfig, others: list[Array], keep_out: KeepOut) -> Decision:
    if not spur.canes:
        return Decision(undecided=(reasons.no_cane_followed(),))
    if spur.incomplete is not None:
        return Decision(undecided=(spur.incomplete,))
    keeper = choose_keeper(spur, config)
    if isinstance(keeper, Reason):
        return Decision(undecided=(keeper,))
    if any(keeper.cane is cane for cane in spur.hidden):
        return Decision(undecided=(reasons.cane_base_hidden(),))
    wood = [cane.axis for cane in spur.canes if cane is not keeper.cane] + others
    shorten = _shorten(keeper, wood, config, keep_out)
    results: dict[CutKind, Cut | Reason] = {"spur cut": shorten}
    if len(spur.canes) > 1:
        # Which cane stays is known, wherever it will be cut: it may be pruned already, or hide a node.
        results["renewal cut"] = _renew(spur, keeper, shorten, config, keep_out)
    return Decision.of(results, _refusals(results)[:1])


def _prune_guyot(
    spur: Spur, config: RuleConfig, others: list[Array], keep_out: KeepOut, old_cane: Cane | None
) -> Decision:
    own = [cane.axis for cane in spur.canes]
    results: dict[CutKind, Cut | Reason] = {"removal": _remove(old_cane, [*own, *others], config, keep_out)}
    canes = _two_canes(spur, config)
    if isinstance(canes, Reason):
        undecided = canes, *_refusals(results)
        return Decision.of({**results, "spur cut": canes, "cane cut": canes}, undecided)
    lower, upper = canes
    fruiting = replace(config, nodes_kept=config.fruiting_nodes)
    results["spur cut"] = _shorten(_Keeper(lower, "lower", 2), [upper.axis, *others], config, keep_out)
    results["cane cut"] = _shorten(_Keeper(upper, "upper", 2), [lower.axis, *others], fruiting, keep_out, True)
    return Decision.of(results, _refusals(results))


def _two_canes(spur: Spur, config: RuleConfig) -> tuple[Cane, Cane] | Reason:
    """The lower and the upper cane of a Guyot vine's spur, or the reason why they cannot be told."""
    if spur.incomplete is not None:
        return spur.incomplete
    if len(spur.canes) != 2:
        return reasons.not_two_canes(len(spur.canes))
    lower, upper = sorted(spur.canes, key=lambda cane: float(cane.origin[2]))
    if float(upper.origin[2] - lower.origin[2]) < config.height_error:
        return reasons.canes_at_same_height()
    return lower, upper


def _remove(old: Cane | None, others: list[Array], config: RuleConfig, keep_out: KeepOut) -> Cut | Reason:
    """The cut that takes last year's cane off its head, at the first place from the trunk on where there is room."""
    if old is None:
        return reasons.old_cane_unseen()
    if too_thick(old.radius, config):
        return reasons.cane_beyond_shears(2000 * old.radius)

    def refused(arc: float) -> Reason | None:
        start, end = arc - _VISIBLE_HALF_WIDTH, arc + _VISIBLE_HALF_WIDTH
        if not old.arc[0] <= start < end <= old.length or any(span.overlaps(start, end) for span in old.hidden):
            return reasons.cut_place_hidden()
        return _obstructed(old.at(arc), others, config, keep_out)

    places = np.arange(_STUMP, _LONGEST_STUMP + _SEARCH_STEP / 2, _SEARCH_STEP).tolist()
    arc = next((place for place in places if refused(place) is None), None)
    if arc is None:
        return refused(_STUMP) or reasons.cut_place_hidden()
    hidden = sum(max(0.0, min(span.end, _LONGEST_STUMP) - span.start) for span in old.hidden) + old.base_gap
    return Cut(
        kind="removal",
        position=old.at(arc),
        tangent=old.tangent(arc),
        radius=old.radius,
        confidence=float(np.clip(1.0 - hidden / _LONGEST_STUMP, 0.0, 1.0)),
        nodes_seen=0,
        nodes_kept=0,
        reason=reasons.old_cane_removed(1000 * arc),
        inward=_free(arc - (_STUMP - _SHORTER_STUMP), lambda shift: refused(arc - shift) is None),
        outward=_free(_LONGEST_STUMP - arc, lambda shift: refused(arc + shift) is None),
    )


def _refusals(results: dict[CutKind, Cut | Reason]) -> tuple[Reason, ...]:
    return tuple(result for result in results.values() if isinstance(result, Reason))


def choose_keeper(spur: Spur, config: RuleConfig) -> _Keeper | Reason:
    """The cane that becomes the new spur, or the reason why none can be chosen.

    Args:
        spur: At least one cane.
        config: Smallest diameter and measurement errors.
    """
    canes = sorted((*spur.canes, *spur.hidden), key=lambda cane: (float(cane.origin[2]), -cane.radius))
    if len(canes) == 1:
        return _Keeper(canes[0], "only", 1)
    margin = config.diameter_error / np.sqrt(min(config.max_averaged, *(cane.observations for cane in canes)))
    keeper = _pick(canes, config.preferred_diameter)
    for limit in (config.preferred_diameter - margin, config.preferred_diameter + margin):
        if _pick(canes, limit) is not keeper:
            return reasons.low_cane_near_limit()
    turns_on = _turns_on(canes, keeper, config.preferred_diameter)
    spread = math.hypot(margin, config.shared_diameter_error)
    certainty = 0.5 * (1.0 + math.erf(turns_on / spread / math.sqrt(2.0)))
    close = turns_on if certainty < SURE else None
    thick = [cane for cane in canes if 2 * cane.radius >= config.preferred_diameter]
    if keeper not in thick:
        rival = max(cane.radius for cane in canes if cane is not keeper)
        if 2 * (keeper.radius - rival) < margin:
            return reasons.canes_equally_thin()
        return _Keeper(keeper, "thickest", len(canes), certainty, close)
    clear = min((float(cane.origin[2] - keeper.origin[2]) for cane in thick if cane is not keeper), default=1.0)
    if clear < config.height_error:
        return reasons.canes_at_same_height()
    ordered = float(np.clip(clear / (3 * config.height_error), 0.5, 1.0))
    return _Keeper(keeper, "lowest", len(canes), ordered * certainty, close)


def _turns_on(canes: list[Cane], keeper: Cane, least: float) -> float:
    """Least change of one diameter (m) with which another of `canes` (lowest first) than the keeper would stay."""
    lower = canes[: next(number for number, cane in enumerate(canes) if cane is keeper)]
    rival = max(2 * cane.radius for cane in canes if cane is not keeper)
    return min(2 * keeper.radius - min(least, rival), *(least - 2 * cane.radius for cane in lower), math.inf)


def _pick(canes: list[Cane], diameter: float) -> Cane:
    """The first of `canes` (lowest first) at least as thick as `diameter`, else the thickest."""
    thick = [cane for cane in canes if 2 * cane.radius >= diameter]
    return thick[0] if thick else max(canes, key=lambda cane: cane.radius)


def count_nodes(cane: Cane, config: RuleConfig) -> tuple[Node, ...]:
    """The count nodes of a cane: all seen nodes but the basal bud."""
    return tuple(node for node in cane.nodes if node.arc > config.basal_bud_distance)


def cut_arc(cane: Cane, config: RuleConfig) -> float | Reason:
    """Arc length of the cut on a cane (m), or the reason why it cannot be placed."""
    kept = config.nodes_kept
    if cane.base_gap > config.max_base_gap:
        return reasons.cane_base_hidden()
    nodes = count_nodes(cane, config)
    if len(nodes) < kept:
        return reasons.nodes_lacking(len(nodes), kept)
    last = nodes[kept - 1]
    internode = nodes[kept].arc - last.arc if len(nodes) > kept else None
    if internode is None:
        beyond = max(0.0, cane.length - last.arc)
        if cane.end == "free" and beyond < config.pruned_length:
            return reasons.pruned_already(1000 * beyond, kept)
        if beyond < config.visible_beyond:
            return reasons.beyond_node_hidden(kept)
    if (reason := miscount_reason(cane, nodes, config)) is not None:
        return reason
    midway = internode is not None and internode < config.short_internode
    arc = last.arc + (internode / 2 if midway and internode is not None else config.offset)
    seen = [0.0, *(node.arc for node in cane.nodes)]
    for span in cane.hidden:
        if span.overlaps(arc - _VISIBLE_HALF_WIDTH, arc + _VISIBLE_HALF_WIDTH):
            return reasons.cut_place_hidden()
        start, end = max(span.start, config.basal_bud_distance), min(span.end, last.arc)
        # A hidden stretch matters only where a node could be at a distance from those that were seen.
        if end > start and _largest_distance(start, end, seen) > config.hidden_node_distance:
            return reasons.node_may_be_hidden()
    return arc


def miscount_reason(cane: Cane, nodes: tuple[Node, ...], config: RuleConfig) -> Reason | None:
    """Why the count of nodes up to the cut is unreliable; None if it is not."""
    arcs = [node.arc for node in nodes[: config.nodes_kept + 1]]
    gaps = np.diff(arcs)
    kept_gaps = gaps[: config.nodes_kept - 1]
    if np.any(gaps < config.min_node_distance) or np.any(kept_gaps < config.min_internode):
        return reasons.nodes_side_by_side()
    # The basal bud may be out of sight: it is then assumed at the end of its range.
    basal = max((node.arc for node in cane.nodes if node.arc <= config.basal_bud_distance), default=None)
    first = arcs[0] - (config.basal_bud_distance if basal is None else basal)
    if max([first, *kept_gaps]) > config.max_internode:
        return reasons.nodes_far_apart()
    return None


def _largest_distance(start: float, end: float, seen: list[float]) -> float:
    """Largest distance that a place in start…end can have from all of `seen`."""
    places = np.linspace(start, end, 9)
    return float(np.min(np.abs(places[:, None] - np.array(seen)[None]), axis=1).max())


def clear_arc(cane: Cane, arc: float, others: list[Array], config: RuleConfig, keep_out: KeepOut) -> float | Reason:
    """Arc length nearest to that of a cut (m) where nothing else is between the open blades, or the reason.

    A place beside a wire is used only where there is no other.

    Args:
        cane: The cane to cut.
        arc: Preferred arc length (m).
        others: Axes of other canes, each N×3 in odom (m).
        config: Clearances and largest shift.
        keep_out: Keep-out zones of the blades.
    """
    first_reason: Reason | None = None
    tight = None
    for fraction in (0.0, 0.5, -0.5, 1.0, -1.0):
        place = arc + fraction * config.max_shift
        position = cane.at(place)
        if _beside_node(cane, place, config):
            continue
        reason = _obstructed(position, others, config, keep_out)
        if reason is None and keep_out.fits(position, cane.tangent(place)):
            return place
        tight = place if tight is None and reason is None else tight
        first_reason = first_reason or reason
    return tight or first_reason or reasons.blades_without_place()


def _beside_node(cane: Cane, arc: float, config: RuleConfig) -> bool:
    return any(abs(node.arc - arc) < config.node_distance for node in cane.nodes)


def _obstructed(position: Array, others: list[Array], config: RuleConfig, keep_out: KeepOut) -> Reason | None:
    """Why no cut is made at a position (3, m, odom): another cane or a keep-out zone; None where it may be."""
    if any(len(axis) and np.linalg.norm(axis - position, axis=1).min() < config.crossing_distance for axis in others):
        return reasons.cane_crosses_cut()
    return keep_out.reason(position)


def _free(most: float, allowed: Callable[[float], bool]) -> float:
    """How far a cut may be shifted, up to `most` (m), over places that are all `allowed`."""
    shifts = np.arange(1, max(round(most / _PLACE_STEP), 0) + 1) * _PLACE_STEP
    return next((shift - _PLACE_STEP for shift in shifts.tolist() if not allowed(shift)), max(most, 0.0))


def too_thick(radius: float, config: RuleConfig) -> bool:
    """Whether a cane of a radius (m) cannot be cut."""
    return 2 * radius > config.max_diameter


def _shorten(
    keeper: _Keeper, others: list[Array], config: RuleConfig, keep_out: KeepOut, fruiting: bool = False
) -> Cut | Reason:
    cane, kept = keeper.cane, config.nodes_kept
    best = cut_arc(cane, config)
    if isinstance(best, Reason):
        return best
    nodes = count_nodes(cane, config)
    last = nodes[kept - 1].arc
    # A fruiting cane is tied along the wire: the stub past its last node may be as long as the internode.
    farthest = max(nodes[kept].arc - _BEFORE_NEXT - best, OUTWARD) if fruiting and len(nodes) > kept else OUTWARD
    places = [best, *(np.arange(best + _SEARCH_STEP, best + farthest, _SEARCH_STEP).tolist() if fruiting else ())]
    found = [clear_arc(cane, place, others, config, keep_out) for place in places]
    arc = next((each for each in found if not isinstance(each, Reason)), found[0])
    if isinstance(arc, Reason):
        return arc
    if too_thick(cane.radius, config):
        return reasons.cane_beyond_shears(2000 * cane.radius)

    def allowed(place: float) -> bool:
        hidden = any(span.overlaps(place - _VISIBLE_HALF_WIDTH, place + _VISIBLE_HALF_WIDTH) for span in cane.hidden)
        beyond_end = not last < place < cane.length - _VISIBLE_HALF_WIDTH
        if hidden or beyond_end or _beside_node(cane, place, config):
            return False
        return _obstructed(cane.at(place), others, config, keep_out) is None

    return Cut(
        kind="cane cut" if fruiting else "spur cut",
        position=cane.at(arc),
        tangent=cane.tangent(arc),
        radius=cane.radius,
        confidence=cut_confidence(cane, arc, keeper.certainty, config),
        nodes_seen=len(nodes),
        nodes_kept=kept,
        reason=keeper.explained(_explanation(keeper, 1000 * (arc - last), kept, best - last < config.offset - 1e-9)),
        offset=arc - last,
        node_distance=node_distance(cane, nodes[:kept], cane.at(arc)),
        cane=cane.number,
        inward=_free(arc - (best - INWARD), lambda shift: allowed(arc - shift)),
        outward=_free(best + farthest - arc, lambda shift: allowed(arc + shift)),
    )


def _explanation(keeper: _Keeper, distance_mm: float, kept: int, midway: bool) -> Reason:
    if keeper.chosen == "lower":
        return reasons.guyot_cut_lower(distance_mm, kept)
    if keeper.chosen == "upper":
        return reasons.guyot_cut_upper(distance_mm, kept)
    place = reasons.midway_past_node(distance_mm, kept) if midway else reasons.past_node(distance_mm, kept)
    if keeper.chosen == "only":
        return reasons.spur_cut_only(place)
    made = reasons.spur_cut_lowest if keeper.chosen == "lowest" else reasons.spur_cut_thickest
    return made(keeper.canes, 2000 * keeper.cane.radius, place)


def node_distance(cane: Cane, nodes: tuple[Node, ...], position: Array) -> float | None:
    """Distance (m) from a position (3, m, odom) to the nearest of a cane's nodes; None without nodes."""
    return min((distance(cane.at(node.arc), position) for node in nodes), default=None)


def cut_confidence(cane: Cane, arc: float, choice: float, config: RuleConfig) -> float:
    """Visible fraction of the cane up to the cut × size of the kept nodes in the image × certainty of the choice."""
    hidden = sum(max(0.0, min(span.end, arc) - span.start) for span in cane.hidden) + cane.base_gap
    seen = float(np.clip(1.0 - hidden / arc, 0.0, 1.0))
    pixels = min(node.pixels for node in count_nodes(cane, config)[: config.nodes_kept])
    return float(np.clip(seen * min(1.0, 0.6 + pixels / 50.0) * choice, 0.0, 1.0))


def _renew(spur: Spur, keeper: _Keeper, shorten: Cut | Reason, config: RuleConfig, keep_out: KeepOut) -> Cut | Reason:
    others = [cane for cane in spur.canes if cane is not keeper.cane]

    def left(why: Reason) -> Reason:
        return reasons.other_cane_left(why) if len(others) == 1 else reasons.other_canes_left(len(others), why)

    # It takes the other canes for good; a spur cut leaves them to a second look.
    if keeper.turns_on is not None:
        return left(reasons.keeper_close(1000 * keeper.turns_on))
    if keeper.cane.base_gap > config.max_base_gap:
        return left(reasons.cane_base_hidden())
    if spur.axis is None or spur.radius <= 0.0:
        return left(reasons.stub_unclear())
    root, tip = spur.axis
    length = distance(tip, root)
    along = (tip - root) / length
    keeper_at, keeper_seen = origin(keeper.cane, root, along)
    found = [origin(cane, root, along) for cane in others]
    nearest, nearest_seen = (min(values) for values in zip(*found, strict=True))
    if nearest < keeper_at or nearest_seen < keeper_seen:
        return left(reasons.cane_below_keeper())
    # The topmost cane grows from below the end of the stub; one that goes on along it is seen from the end on.
    end = length - spur.radius
    room = min(nearest, end) - keeper_at
    shortest = min(room, min(nearest_seen, length) - keeper_seen)
    if shortest < config.min_stub:
        return left(reasons.stub_too_short(1000 * max(shortest, 0.0)))
    places = [root + (keeper_at + share * room) * along for share in _STUB_SHARES]
    hidden = np.linspace(root + keeper_at * along, keeper.cane.base, 5)
    axis = np.concatenate([hidden, keeper.cane.axis])
    lean = config.blade_lean
    # A lean alone is within reach most often.
    tries = product(((0.0, 0.0, lean), (config.blade_turn, config.blade_tilt, lean)), places)
    position = next((place for angles, place in tries if _blades_pass(axis, place, along, angles, config)), None)
    if position is None:
        return left(reasons.shears_touch_keeper())
    if (reason := keep_out.reason(position)) is not None:
        return left(reason)
    farthest = keeper_at + _STUB_SHARES[-1] * room - float((position - root) @ along)
    if 2 * spur.radius > config.max_stub_diameter:
        return left(reasons.stub_beyond_shears(2000 * spur.radius))
    return Cut(
        kind="renewal cut",
        position=position,
        tangent=along,
        radius=spur.radius,
        confidence=0.8 * shorten.confidence if isinstance(shorten, Cut) else _DOUBTFUL * keeper.certainty,
        nodes_seen=len(count_nodes(keeper.cane, config)),
        nodes_kept=config.nodes_kept,
        reason=reasons.renewal_cut(len(others)),
        node_distance=node_distance(keeper.cane, keeper.cane.nodes, position),
        cane=keeper.cane.number,
        outward=_free(farthest, lambda shift: keep_out.reason(position + shift * along) is None),
    )


def origin(cane: Cane, root: Array, along: Array) -> tuple[float, float]:
    """Where the axis of a cane comes out of that of its stub, and where it begins to be seen, from the stub's root (m).

    That is where all pictures begin to see it, in the median. What is seen of a cane begins at the bark of the stub:
    where it leaves at an angle, farther out than its axis.

    Args:
        cane: The cane.
        root: Of the stub (3, m, odom).
        along: Unit vector along the stub (3, odom).
    """
    off = cane.origin - root
    seen = float(off @ along)
    direction = cane.at(float(cane.arc[0]) + _BASE) - cane.base
    forward = float(direction @ along)
    across = direction - forward * along
    square = float(across @ across)
    if square < (_LEAST_SINE * np.linalg.norm(direction)) ** 2:
        return seen, seen
    # Back along the cane until it is nearest to the axis of the stub.
    back = max(float((off - seen * along) @ across) / square, 0.0)
    return seen - min(back * forward, _THICK), seen


def _blades_pass(
    keeper: Array, position: Array, along: Array, angles: tuple[float, float, float], config: RuleConfig
) -> bool:
    """Whether the blades, turned, tilted and leaned within limits, pass the cane that stays beside a cut of its stub.

    Args:
        keeper: Axis of the cane that stays, from that of the stub (N×3, m, odom).
        position: Of the cut (3, m, odom).
        along: Unit vector along the stub (3, odom).
        angles: Largest turn, tilt and lean (rad).
        config: Clearances.
    """
    depth = APPROACH - float(APPROACH @ along) * along
    depth = depth / max(float(np.linalg.norm(depth)), 1e-9)
    square = np.stack([np.cross(along, depth), along, depth])
    off = (keeper - position) @ square.T
    off = off[np.linalg.norm(off, axis=1) < 2.0 * config.shears_clearance]
    room = np.array([config.shears_clearance, config.blade_half, config.shears_clearance])
    between = np.all(np.abs(np.einsum("nij,pj->npi", _blade_axes(*angles), off)) < room, axis=2)
    return not between.any(axis=1).all()


@cache
def _blade_axes(turn: float, tilt: float, lean: float) -> Array:
    """Axes of the blades (N×3×3: beside, normal, depth) in those of blades square to the wood, by largest angles."""
    out = []
    angles = ([share * largest for share in _SHARES] if largest else [0.0] for largest in (turn, tilt, lean))
    for about_wood, about_side, about_depth in product(*angles):
        c, s = math.cos(about_wood), math.sin(about_wood)
        axes = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
        c, s = math.cos(about_side), math.sin(about_side)
        axes = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]]) @ axes
        c, s = math.cos(about_depth), math.sin(about_depth)
        out.append(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ axes)
    return np.array(out)
