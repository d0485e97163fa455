"""The spur-pruning rule: from one spur as perceived to cuts, or to the reason why there is none.

For each spur: choose the cane that becomes the new spur (the lowest one thick enough, else the thickest), keep its
basal bud and its next two nodes, and cut a little past the second; then take the old stub with its other canes off
in one cut beyond the keeper. Nothing is extrapolated: what was not seen is not counted.
"""

from dataclasses import dataclass, field

import numpy as np

from perception.config import RuleConfig
from perception.plant.model import Array, Cane, Node, Spur
from perception.plant.undecided_sites import MoreToSee
from perception.rules.keep_out import ANYWHERE, KeepOut
from rolling_panda.messages.types import CutKind


@dataclass(frozen=True)
class Cut:
    """One proposed cut.

    Attributes:
        kind: Shortening of the keeper, removal of the stub beyond it, tipping of the cane that will fruit
            (Guyot), or what a person asked for.
        position: On the axis of the wood (3, m, odom).
        tangent: Unit vector along the wood, away from the cordon (3, odom).
        radius: Of the wood (m).
        confidence: 0…1, the product of the shares explained in `cut_confidence`.
        nodes_seen: Count nodes seen on the keeper.
        nodes_kept: Count nodes that stay.
        reason: One sentence for a grower.
        offset: Past the last kept node, along the wood (m); None where none is below the cut.
        node_distance: To the nearest node that stays (m); None where none is known.
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
    """What the rule says about one spur: cuts, and for what it leaves alone the reasons."""

    cuts: tuple[Cut, ...] = ()
    abstained: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Keeper:
    cane: Cane
    why: str
    certainty: float = 1.0
    doubts: tuple[str, ...] = field(default=())


def decide(spur: Spur, config: RuleConfig, beside: Array | None = None, keep_out: KeepOut = ANYWHERE) -> Decision:
    """Apply the rule to one spur.

    Args:
        spur: With the canes that were followed to it.
        config: The rule's numbers.
        beside: Axis points of cane that is not this spur's, N×3 in odom (m).
        keep_out: Where the blades must not go.
    """
    if not spur.canes:
        return Decision(abstained=(MoreToSee("no cane could be followed to this spur"),))
    if spur.doubt:
        return Decision(abstained=(spur.doubt,))
    keeper = choose_keeper(spur, config)
    if isinstance(keeper, str):
        return Decision(abstained=(keeper,))
    other_wood = [cane.axis for cane in spur.canes if cane is not keeper.cane]
    if beside is not None:
        other_wood.append(beside)
    shorten = _shorten(keeper, other_wood, config, keep_out)
    if isinstance(shorten, str):
        return Decision(abstained=(shorten,))
    if len(spur.canes) == 1:
        return Decision(cuts=(shorten,))
    renew = _renew(spur, keeper, shorten, config, keep_out)
    if isinstance(renew, str):
        return Decision(cuts=(shorten,), abstained=(renew,))
    return Decision(cuts=(shorten, renew))


def _nearest(axes: list[Array], place: Array) -> float:
    """Distance (m) of the nearest of all points from `place`; infinite without any."""
    return min((float(np.linalg.norm(axis - place, axis=1).min()) for axis in axes if len(axis)), default=np.inf)


def choose_keeper(spur: Spur, config: RuleConfig) -> _Keeper | str:
    """The cane that becomes the new spur, or why none can be chosen.

    Args:
        spur: At least one cane.
        config: Least diameter and the margins inside which a choice is a guess.
    """
    canes = sorted(spur.canes, key=lambda cane: (float(cane.base[2]), -cane.radius))
    if len(canes) == 1:
        return _Keeper(canes[0], "the only cane on this spur")
    # A choice that turns on less than the error of a diameter is none.
    margin = config.diameter_doubt / np.sqrt(min(config.steadiest, *(cane.looks for cane in canes)))
    keeper = _pick(canes, config.keeper_diameter)
    for limit in (config.keeper_diameter - margin, config.keeper_diameter + margin):
        if _pick(canes, limit) is not keeper:
            return "a low cane is too near the least thickness to tell which cane should stay"
    thick = [cane for cane in canes if 2 * cane.radius >= config.keeper_diameter]
    if keeper not in thick:
        rival = max(cane.radius for cane in canes if cane is not keeper)
        if 2 * (keeper.radius - rival) < margin:
            return "all canes are thin and about equally thick, so which should stay is open"
        return _Keeper(keeper, f"the thickest of {len(canes)} thin canes ({2000 * keeper.radius:.0f} mm)")
    above = [float(cane.base[2] - keeper.base[2]) for cane in thick if cane is not keeper]
    if above and min(above) < config.height_doubt:
        return "two canes leave the spur at about the same height, so which is the lower is open"
    clear = min(above) if above else 1.0
    why = f"the lowest of {len(canes)} canes that is thick enough ({2000 * keeper.radius:.0f} mm)"
    return _Keeper(keeper, why, float(np.clip(clear / (3 * config.height_doubt), 0.5, 1.0)))


def _pick(canes: list[Cane], diameter: float) -> Cane:
    """The first of `canes` (lowest first) at least as thick as `diameter`, else the thickest."""
    thick = [cane for cane in canes if 2 * cane.radius >= diameter]
    return thick[0] if thick else max(canes, key=lambda cane: cane.radius)


def count_nodes(cane: Cane, config: RuleConfig) -> tuple[Node, ...]:
    """Nodes of a cane that count: all seen but the basal bud, which stands within `basal_reach` of the base."""
    return tuple(node for node in cane.nodes if node.arc > config.basal_reach)


def cut_arc(cane: Cane, config: RuleConfig) -> float | str:
    """Arc length of the cut on a cane (m), or why it cannot be placed."""
    kept = config.nodes_kept
    if cane.base_gap > config.base_doubt:
        return MoreToSee("the base of the cane to keep is hidden, so its nodes cannot be counted from the first")
    nodes = count_nodes(cane, config)
    if len(nodes) < kept:
        return MoreToSee(f"only {len(nodes)} of {kept} nodes seen on the cane to keep; never guessed")
    last = nodes[kept - 1]
    following = nodes[kept].arc - last.arc if len(nodes) > kept else None
    beyond = max(0.0, cane.length - last.arc)
    if following is None and cane.end == "free" and beyond < config.pruned:
        return f"the cane ends {1000 * beyond:.0f} mm past node {kept}: it is pruned already"
    if following is None and beyond < config.clear_beyond:
        return MoreToSee(f"what lies beyond node {kept} is not in view")
    if doubt := _doubtful_count(cane, nodes, config):
        return doubt
    short = following is not None and following < config.short_internode
    arc = last.arc + (float(following) / 2 if short and following is not None else config.offset)
    seen = [0.0, *(node.arc for node in cane.nodes)]
    for span in cane.hidden:
        if span.meets(arc - 0.008, arc + 0.008):
            return MoreToSee("the place of the cut is hidden")
        first, second = max(span.start, config.basal_reach), min(span.end, last.arc)
        # A hidden stretch matters where a node could sit in it without crowding those that were seen.
        if second > first and _far_from(first, second, seen) > config.node_room:
            return MoreToSee("a stretch of the cane to keep is hidden where another node may be")
    return arc


def _doubtful_count(cane: Cane, nodes: tuple[Node, ...], config: RuleConfig) -> str:
    """Why the nodes up to the cut may not be what was counted; empty where nothing speaks for that."""
    places = [node.arc for node in nodes[: config.nodes_kept + 1]]
    gaps = [second - first for first, second in zip(places, places[1:], strict=False)]
    if any(gap < config.crowded for gap in gaps) or any(
        gap < config.shortest_internode for gap in gaps[: config.nodes_kept - 1]
    ):
        return "two nodes seem to sit side by side, so one may belong to another cane"
    # The basal bud may be out of sight; from the base to the first node is no farther than past a basal bud at its end.
    below = [node.arc for node in cane.nodes if node.arc <= config.basal_reach]
    first = places[0] - (below[-1] if below else config.basal_reach)
    if any(gap > config.longest_internode for gap in (first, *gaps[: config.nodes_kept - 1])):
        return MoreToSee("two nodes are so far apart that one between them may not have been seen")
    return ""


def _far_from(start: float, end: float, taken: list[float]) -> float:
    """Largest distance that a place inside start…end can have from everything in `taken`."""
    places = np.linspace(start, end, 9)
    return float(np.min(np.abs(places[:, None] - np.array(taken)[None]), axis=1).max())


def clear_arc(cane: Cane, arc: float, others: list[Array], config: RuleConfig, keep_out: KeepOut) -> float | str:
    """Arc length nearest to a cut's (m) where nothing else is between the open blades, or why there is none.

    One beside a wire is taken only where no other will do.

    Args:
        cane: That is cut.
        arc: Of the cut at its best (m).
        others: Axes of other canes, each N×3 in odom (m).
        config: How near is too near, and how far the cut may move.
        keep_out: Where the blades must not go.
    """
    why, tight = "", None
    for share in (0.0, 0.5, -0.5, 1.0, -1.0):
        place = arc + share * config.shift
        if any(abs(node.arc - place) < config.node_distance for node in cane.nodes):
            continue
        if _nearest(others, cane.at(place)) < config.crossing:
            reason = "another cane passes so close to the cut that the shears would take it too"
        else:
            reason = keep_out.reason(cane.at(place))
        if not reason and keep_out.fits(cane.at(place), cane.tangent(place)):
            return place
        tight = place if tight is None and not reason else tight
        why = why or reason
    return tight or why or "no place for the blades between two nodes"


def _shorten(keeper: _Keeper, others: list[Array], config: RuleConfig, keep_out: KeepOut) -> Cut | str:
    cane = keeper.cane
    best = cut_arc(cane, config)
    if isinstance(best, str):
        return best
    arc = clear_arc(cane, best, others, config, keep_out)
    if isinstance(arc, str):
        return arc
    if 2 * cane.radius > config.largest_diameter:
        return f"the cane is {2000 * cane.radius:.0f} mm thick, more than the shears may cut"
    nodes = count_nodes(cane, config)
    kept = config.nodes_kept
    past = arc - nodes[kept - 1].arc
    midway = best - nodes[kept - 1].arc < config.offset - 1e-9
    where = f"midway to the next node, {1000 * past:.0f} mm" if midway else f"{1000 * past:.0f} mm"
    return Cut(
        kind="spur cut",
        position=cane.at(arc),
        tangent=cane.tangent(arc),
        radius=cane.radius,
        confidence=cut_confidence(cane, arc, keeper.certainty, config),
        nodes_seen=len(nodes),
        nodes_kept=kept,
        reason=f"Spur cut on {keeper.why}: {where} past node {kept}, so that {kept} nodes and the basal bud stay.",
        offset=past,
        node_distance=nearest_node(cane, nodes[:kept], cane.at(arc)),
    )


def nearest_node(cane: Cane, nodes: tuple[Node, ...], place: Array) -> float | None:
    """Distance (m) of the nearest of a cane's nodes from a place (3, m, odom); None without any."""
    return min((float(np.linalg.norm(cane.at(node.arc) - place)) for node in nodes), default=None)


def cut_confidence(cane: Cane, arc: float, choice: float, config: RuleConfig) -> float:
    """Share of the way to the cut that was seen × how large the kept nodes were seen × how clear the choice was."""
    hidden = sum(max(0.0, min(span.end, arc) - span.start) for span in cane.hidden) + cane.base_gap
    seen = float(np.clip(1.0 - hidden / arc, 0.0, 1.0))
    pixels = min(node.pixels for node in count_nodes(cane, config)[: config.nodes_kept])
    return float(np.clip(seen * min(1.0, 0.6 + pixels / 50.0) * choice, 0.0, 1.0))


def _renew(spur: Spur, keeper: _Keeper, shorten: Cut, config: RuleConfig, keep_out: KeepOut) -> Cut | str:
    others = [cane for cane in spur.canes if cane is not keeper.cane]
    rest = f"the {len(others)} other cane{'s' if len(others) > 1 else ''} of this spur left for a person: "
    if spur.axis is None or spur.radius <= 0.0:
        return MoreToSee(rest + "the old stub is not seen clearly")
    root, tip = spur.axis
    length = float(np.linalg.norm(tip - root))
    along = (tip - root) / length
    stands = float((keeper.cane.base - root) @ along)
    nearest = min(float((cane.base - root) @ along) for cane in others)
    if nearest < stands:
        return rest + "one of them grows below the cane that stays"
    room = min(nearest, length) - stands
    if room < config.stub_room:
        return rest + f"the stub is free over {1000 * max(room, 0.0):.0f} mm only"
    position = root + (stands + room / 2) * along
    if float(np.linalg.norm(keeper.cane.axis - position, axis=1).min()) < config.shears_room:
        return rest + "the shears would touch the cane that stays"
    if kept_out := keep_out.reason(position):
        return rest + kept_out
    if 2 * spur.radius > config.largest_diameter:
        return rest + f"the stub is {2000 * spur.radius:.0f} mm thick, more than the shears may cut"
    return Cut(
        kind="renewal cut",
        position=position,
        tangent=along,
        radius=spur.radius,
        confidence=0.8 * shorten.confidence,
        nodes_seen=shorten.nodes_seen,
        nodes_kept=shorten.nodes_kept,
        reason=f"Renewal cut: takes the old stub off with {len(others)} other cane(s), just past the cane that stays.",
        node_distance=nearest_node(keeper.cane, keeper.cane.nodes, position),
    )
