"""The Guyot rule: of a spur's two canes the lower one becomes the next spur, the upper one the cane that will fruit."""

from msgspec.structs import replace

from perception.config import RuleConfig
from perception.plant.model import Array, Cane, Spur
from perception.rules.keep_out import ANYWHERE, KeepOut
from perception.rules.spur import Cut, Decision, clear_arc, count_nodes, cut_arc, cut_confidence, nearest_node

#: What the rule never proposes: last year's cane cannot be followed to its head from the front.
_OLD_CANE = "last year's cane is left for a person"


def decide_guyot(spur: Spur, config: RuleConfig, beside: Array | None = None, keep_out: KeepOut = ANYWHERE) -> Decision:
    """Apply the rule to one spur.

    Args:
        spur: With the canes that were followed to it.
        config: The rule's numbers.
        beside: Axis points of cane that is not this spur's, N×3 in odom (m).
        keep_out: Where the blades must not go.
    """
    if spur.doubt:
        return Decision(abstained=(spur.doubt,))
    if len(spur.canes) != 2:
        return Decision(
            abstained=(f"{len(spur.canes)} canes seen on the spur, and the Guyot rule is about two: left for a person",)
        )
    lower, upper = sorted(spur.canes, key=lambda cane: float(cane.base[2]))
    if float(upper.base[2] - lower.base[2]) < config.height_doubt:
        return Decision(abstained=("two canes leave the spur at about the same height, so which is the lower is open",))
    cuts, abstained = [], [_OLD_CANE]
    for cane, other, kept, kind in (
        (lower, upper, config.nodes_kept, "spur cut"),
        (upper, lower, config.fruiting_nodes, "cane cut"),
    ):
        result = _cut(cane, kept, kind, [other.axis, beside if beside is not None else other.axis], config, keep_out)
        if isinstance(result, Cut):
            cuts.append(result)
        else:
            abstained.append(result)
    return Decision(tuple(cuts), tuple(abstained))


def _cut(cane: Cane, kept: int, kind: str, others: list[Array], config: RuleConfig, keep_out: KeepOut) -> Cut | str:
    rule = replace(config, nodes_kept=kept)
    best = cut_arc(cane, rule)
    arc = best if isinstance(best, str) else clear_arc(cane, best, others, rule, keep_out)
    if isinstance(arc, str):
        return arc
    if 2 * cane.radius > config.largest_diameter:
        return f"the cane is {2000 * cane.radius:.0f} mm thick, more than the shears may cut"
    nodes = count_nodes(cane, config)
    past = arc - nodes[kept - 1].arc
    lower = kind == "spur cut"
    becomes = "the lower of two canes, the next spur" if lower else "the upper of two canes, which will fruit"
    return Cut(
        kind="spur cut" if lower else "cane cut",
        position=cane.at(arc),
        tangent=cane.tangent(arc),
        radius=cane.radius,
        confidence=cut_confidence(cane, arc, 1.0, rule),
        nodes_seen=len(nodes),
        nodes_kept=kept,
        reason=f"Guyot, on {becomes}: {1000 * past:.0f} mm past node {kept}.",
        offset=past,
        node_distance=nearest_node(cane, nodes[:kept], cane.at(arc)),
    )
