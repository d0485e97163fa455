"""Pruning rules: from one spur to cuts, or to the reason why there is none.

Spur pruning: the lowest cane that is thick enough, else the thickest, becomes the new spur (the keeper). It is cut
past its second count node. A renewal cut beyond the keeper removes the old stub with the other canes.

Guyot pruning: of two canes the lower one becomes the next spur, and the upper one the fruiting cane.

Nothing is extrapolated: nodes that were not seen are not counted.
"""

import math
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from perception.arrays import Array, distance
from perception.config import RuleConfig
from perception.plant.model import Cane, Node, Spur
from perception.plant.undecided_sites import NeedsAnotherLook
from perception.rules.keep_out import NO_KEEP_OUT, KeepOut
from rolling_panda.messages.types import CutKind

#: Shear stress at which a cane parts under a flat-edged blade (Pa): Sessiz, Eliçin and Bayhan, "Cutting force and
#: energy requirement of Boğazkere grape cane", Scientific Papers B, Horticulture LXIII, 2019, in the pruning season.
#: Other cultivars and seasons in these authors' papers lie between 9.6 and 22 MPa.
CUTTING_STRENGTH = 9.34e6
#: Half the length of wood around a cut that must be visible (m).
_VISIBLE_HALF_WIDTH = 0.008
#: The Guyot rule never proposes the removal of last year's cane: its head is not visible from the front.
_OLD_CANE = "last year's cane is left for a person"
_SAME_HEIGHT = "two canes leave the spur at about the same height, so which is the lower is open"


@dataclass(frozen=True)
class Cut:
    """A proposed cut.

    Attributes:
        kind: Spur cut (shortening of the keeper), renewal cut (removal of the stub beyond it), cane cut (shortening of
            the fruiting cane, Guyot), or by hand.
        position: On the axis of the wood (3, m, odom).
        tangent: Unit vector along the wood, away from the cordon (3, odom).
        radius: Of the wood (m).
        confidence: 0…1, see `cut_confidence`.
        nodes_seen: Count nodes seen on the keeper.
        nodes_kept: Count nodes left.
        reason: One sentence for a grower.
        offset: Distance past the last kept node along the wood (m); None where no node is below the cut.
        node_distance: Distance to the nearest kept node (m); None where none is known.
    """

    kind: CutKind
    position: Array
    tangent: Array
    radius: float
    confidence: float
    nodes_seen: int
    nodes_kept: int
    reason: str
    offset: float | None = None
    node_distance: float | None = None


@dataclass(frozen=True)
class Decision:
    """Cuts of one spur, and the reasons for what is left undecided."""

    cuts: tuple[Cut, ...] = ()
    undecided: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Keeper:
    cane: Cane
    reason: str
    certainty: float = 1.0


def apply_rule(
    spur: Spur, config: RuleConfig, other_canes: Array | None = None, keep_out: KeepOut = NO_KEEP_OUT
) -> Decision:
    """Apply the rule of the configured training system to one spur.

    Args:
        spur: The spur with its canes.
        config: Pruning rule.
        other_canes: Axis points of canes of other spurs, N×3 in odom (m).
        keep_out: Keep-out zones of the blades.
    """
    rule = _prune_guyot if config.system == "guyot" else _prune_spur
    return rule(spur, config, [] if other_canes is None else [other_canes], keep_out)


def cutting_force(radius: float) -> float:
    """Force (N) that parts round wood of a radius (m): strength times cross-section."""
    return CUTTING_STRENGTH * math.pi * radius**2


def _prune_spur(spur: Spur, config: RuleConfig, others: list[Array], keep_out: KeepOut) -> Decision:
    if not spur.canes:
        return Decision(undecided=(NeedsAnotherLook("no cane could be followed to this spur"),))
    if spur.incomplete:
        return Decision(undecided=(spur.incomplete,))
    keeper = choose_keeper(spur, config)
    if isinstance(keeper, str):
        return Decision(undecided=(keeper,))
    wood = [cane.axis for cane in spur.canes if cane is not keeper.cane] + others
    shorten = _shorten(keeper, wood, config, keep_out)
    if isinstance(shorten, str):
        return Decision(undecided=(shorten,))
    if len(spur.canes) == 1:
        return Decision(cuts=(shorten,))
    renew = _renew(spur, keeper, shorten, config, keep_out)
    if isinstance(renew, str):
        return Decision(cuts=(shorten,), undecided=(renew,))
    return Decision(cuts=(shorten, renew))


def _prune_guyot(spur: Spur, config: RuleConfig, others: list[Array], keep_out: KeepOut) -> Decision:
    if spur.incomplete:
        return Decision(undecided=(spur.incomplete,))
    if len(spur.canes) != 2:
        reason = f"{len(spur.canes)} canes seen on the spur, and the Guyot rule is about two: left for a person"
        return Decision(undecided=(reason,))
    lower, upper = sorted(spur.canes, key=lambda cane: float(cane.base[2]))
    if float(upper.base[2] - lower.base[2]) < config.height_error:
        return Decision(undecided=(_SAME_HEIGHT,))
    fruiting = replace(config, nodes_kept=config.fruiting_nodes)
    results = (
        _shorten(_Keeper(lower, "the lower of two canes, the next spur"), [upper.axis, *others], config, keep_out),
        _shorten(
            _Keeper(upper, "the upper of two canes, which will fruit"), [lower.axis, *others], fruiting, keep_out, True
        ),
    )
    cuts = tuple(result for result in results if isinstance(result, Cut))
    return Decision(cuts, (_OLD_CANE, *(result for result in results if isinstance(result, str))))


def choose_keeper(spur: Spur, config: RuleConfig) -> _Keeper | str:
    """The cane that becomes the new spur, or the reason why none can be chosen.

    Args:
        spur: At least one cane.
        config: Smallest diameter and measurement errors.
    """
    canes = sorted(spur.canes, key=lambda cane: (float(cane.base[2]), -cane.radius))
    if len(canes) == 1:
        return _Keeper(canes[0], "the only cane on this spur")
    margin = config.diameter_error / np.sqrt(min(config.max_averaged, *(cane.observations for cane in canes)))
    keeper = _pick(canes, config.preferred_diameter)
    for limit in (config.preferred_diameter - margin, config.preferred_diameter + margin):
        if _pick(canes, limit) is not keeper:
            return "a low cane is too near the least thickness to tell which cane should stay"
    thick = [cane for cane in canes if 2 * cane.radius >= config.preferred_diameter]
    if keeper not in thick:
        rival = max(cane.radius for cane in canes if cane is not keeper)
        if 2 * (keeper.radius - rival) < margin:
            return "all canes are thin and about equally thick, so which should stay is open"
        return _Keeper(keeper, f"the thickest of {len(canes)} thin canes ({2000 * keeper.radius:.0f} mm)")
    clear = min((float(cane.base[2] - keeper.base[2]) for cane in thick if cane is not keeper), default=1.0)
    if clear < config.height_error:
        return _SAME_HEIGHT
    reason = f"the lowest of {len(canes)} canes that is thick enough ({2000 * keeper.radius:.0f} mm)"
    return _Keeper(keeper, reason, float(np.clip(clear / (3 * config.height_error), 0.5, 1.0)))


def _pick(canes: list[Cane], diameter: float) -> Cane:
    """The first of `canes` (lowest first) at least as thick as `diameter`, else the thickest."""
    thick = [cane for cane in canes if 2 * cane.radius >= diameter]
    return thick[0] if thick else max(canes, key=lambda cane: cane.radius)


def count_nodes(cane: Cane, config: RuleConfig) -> tuple[Node, ...]:
    """The count nodes of a cane: all seen nodes but the basal bud."""
    return tuple(node for node in cane.nodes if node.arc > config.basal_bud_distance)


def cut_arc(cane: Cane, config: RuleConfig) -> float | str:
    """Arc length of the cut on a cane (m), or the reason why it cannot be placed."""
    kept = config.nodes_kept
    if cane.base_gap > config.max_base_gap:
        return NeedsAnotherLook("the base of the cane to keep is hidden, so its nodes cannot be counted from the first")
    nodes = count_nodes(cane, config)
    if len(nodes) < kept:
        return NeedsAnotherLook(f"only {len(nodes)} of {kept} nodes seen on the cane to keep; never guessed")
    last = nodes[kept - 1]
    internode = nodes[kept].arc - last.arc if len(nodes) > kept else None
    if internode is None:
        beyond = max(0.0, cane.length - last.arc)
        if cane.end == "free" and beyond < config.pruned_length:
            return f"the cane ends {1000 * beyond:.0f} mm past node {kept}: it is pruned already"
        if beyond < config.visible_beyond:
            return NeedsAnotherLook(f"what lies beyond node {kept} is not in view")
    if reason := _miscount_reason(cane, nodes, config):
        return reason
    midway = internode is not None and internode < config.short_internode
    arc = last.arc + (internode / 2 if midway and internode is not None else config.offset)
    seen = [0.0, *(node.arc for node in cane.nodes)]
    for span in cane.hidden:
        if span.overlaps(arc - _VISIBLE_HALF_WIDTH, arc + _VISIBLE_HALF_WIDTH):
            return NeedsAnotherLook("the place of the cut is hidden")
        start, end = max(span.start, config.basal_bud_distance), min(span.end, last.arc)
        # A hidden stretch matters only where a node could be at a distance from those that were seen.
        if end > start and _largest_distance(start, end, seen) > config.hidden_node_distance:
            return NeedsAnotherLook("a stretch of the cane to keep is hidden where another node may be")
    return arc


def _miscount_reason(cane: Cane, nodes: tuple[Node, ...], config: RuleConfig) -> str:
    """Why the count of nodes up to the cut is unreliable; empty if it is not."""
    arcs = [node.arc for node in nodes[: config.nodes_kept + 1]]
    gaps = np.diff(arcs)
    kept_gaps = gaps[: config.nodes_kept - 1]
    if np.any(gaps < config.min_node_distance) or np.any(kept_gaps < config.min_internode):
        return "two nodes seem to sit side by side, so one may belong to another cane"
    # The basal bud may be out of sight: it is then assumed at the end of its range.
    basal = max((node.arc for node in cane.nodes if node.arc <= config.basal_bud_distance), default=None)
    first = arcs[0] - (config.basal_bud_distance if basal is None else basal)
    if max([first, *kept_gaps]) > config.max_internode:
        return NeedsAnotherLook("two nodes are so far apart that one between them may not have been seen")
    return ""


def _largest_distance(start: float, end: float, seen: list[float]) -> float:
    """Largest distance that a place in start…end can have from all of `seen`."""
    places = np.linspace(start, end, 9)
    return float(np.min(np.abs(places[:, None] - np.array(seen)[None]), axis=1).max())


def clear_arc(cane: Cane, arc: float, others: list[Array], config: RuleConfig, keep_out: KeepOut) -> float | str:
    """Arc length nearest to that of a cut (m) where nothing else is between the open blades, or the reason.

    A place beside a wire is used only where there is no other.

    Args:
        cane: The cane to cut.
        arc: Preferred arc length (m).
        others: Axes of other canes, each N×3 in odom (m).
        config: Clearances and largest shift.
        keep_out: Keep-out zones of the blades.
    """
    first_reason, tight = "", None
    for fraction in (0.0, 0.5, -0.5, 1.0, -1.0):
        place = arc + fraction * config.max_shift
        position = cane.at(place)
        if any(abs(node.arc - place) < config.node_distance for node in cane.nodes):
            continue
        if any(
            len(axis) and np.linalg.norm(axis - position, axis=1).min() < config.crossing_distance for axis in others
        ):
            reason = "another cane passes so close to the cut that the shears would take it too"
        else:
            reason = keep_out.reason(position)
        if not reason and keep_out.fits(position, cane.tangent(place)):
            return place
        tight = place if tight is None and not reason else tight
        first_reason = first_reason or reason
    return tight or first_reason or "no place for the blades between two nodes"


def thickness_reason(name: str, radius: float, config: RuleConfig) -> str:
    """Why wood of a radius (m) cannot be cut; empty if it can."""
    if 2 * radius <= config.max_diameter:
        return ""
    return f"the {name} is {2000 * radius:.0f} mm thick, more than the shears may cut"


def _shorten(
    keeper: _Keeper, others: list[Array], config: RuleConfig, keep_out: KeepOut, fruiting: bool = False
) -> Cut | str:
    cane, kept = keeper.cane, config.nodes_kept
    best = cut_arc(cane, config)
    if isinstance(best, str):
        return best
    arc = clear_arc(cane, best, others, config, keep_out)
    if isinstance(arc, str):
        return arc
    if reason := thickness_reason("cane", cane.radius, config):
        return reason
    nodes = count_nodes(cane, config)
    last = nodes[kept - 1].arc
    where = f"{1000 * (arc - last):.0f} mm past node {kept}"
    if config.system == "guyot":
        reason = f"Guyot, on {keeper.reason}: {where}."
    else:
        midway = "midway to the next node, " if best - last < config.offset - 1e-9 else ""
        reason = f"Spur cut on {keeper.reason}: {midway}{where}, so that {kept} nodes and the basal bud stay."
    return Cut(
        kind="cane cut" if fruiting else "spur cut",
        position=cane.at(arc),
        tangent=cane.tangent(arc),
        radius=cane.radius,
        confidence=cut_confidence(cane, arc, keeper.certainty, config),
        nodes_seen=len(nodes),
        nodes_kept=kept,
        reason=reason,
        offset=arc - last,
        node_distance=node_distance(cane, nodes[:kept], cane.at(arc)),
    )


def node_distance(cane: Cane, nodes: tuple[Node, ...], position: Array) -> float | None:
    """Distance (m) from a position (3, m, odom) to the nearest of a cane's nodes; None without nodes."""
    return min((distance(cane.at(node.arc), position) for node in nodes), default=None)


def cut_confidence(cane: Cane, arc: float, choice: float, config: RuleConfig) -> float:
    """Visible fraction of the cane up to the cut × size of the kept nodes in the image × certainty of the choice."""
    hidden = sum(max(0.0, min(span.end, arc) - span.start) for span in cane.hidden) + cane.base_gap
    seen = float(np.clip(1.0 - hidden / arc, 0.0, 1.0))
    pixels = min(node.pixels for node in count_nodes(cane, config)[: config.nodes_kept])
    return float(np.clip(seen * min(1.0, 0.6 + pixels / 50.0) * choice, 0.0, 1.0))


def _renew(spur: Spur, keeper: _Keeper, shorten: Cut, config: RuleConfig, keep_out: KeepOut) -> Cut | str:
    others = [cane for cane in spur.canes if cane is not keeper.cane]
    rest = f"the {len(others)} other cane{'s' if len(others) > 1 else ''} of this spur left for a person: "
    if spur.axis is None or spur.radius <= 0.0:
        return NeedsAnotherLook(rest + "the old stub is not seen clearly")
    root, tip = spur.axis
    length = distance(tip, root)
    along = (tip - root) / length
    keeper_at = float((keeper.cane.base - root) @ along)
    nearest = min(float((cane.base - root) @ along) for cane in others)
    if nearest < keeper_at:
        return rest + "one of them grows below the cane that stays"
    room = min(nearest, length) - keeper_at
    if room < config.min_stub:
        return rest + f"the stub is free over {1000 * max(room, 0.0):.0f} mm only"
    position = root + (keeper_at + room / 2) * along
    if float(np.linalg.norm(keeper.cane.axis - position, axis=1).min()) < config.shears_clearance:
        return rest + "the shears would touch the cane that stays"
    if reason := keep_out.reason(position) or thickness_reason("stub", spur.radius, config):
        return rest + reason
    return Cut(
        kind="renewal cut",
        position=position,
        tangent=along,
        radius=spur.radius,
        confidence=0.8 * shorten.confidence,
        nodes_seen=shorten.nodes_seen,
        nodes_kept=shorten.nodes_kept,
        reason=f"Renewal cut: takes the old stub off with {len(others)} other cane(s), just past the cane that stays.",
        node_distance=node_distance(keeper.cane, keeper.cane.nodes, position),
    )
