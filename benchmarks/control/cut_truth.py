"""What a cut in physics did to the vine, by the simulator's truth: right, harmful, or neither."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bridge.sim.vineyard.row import Array, Row
from bridge.sim.vineyard.truth import RightCut, judge, judge_guyot
from rolling_panda.messages.types import CutKind

#: In place of a cane's number: the stub, and last year's cane of a Guyot vine.
STUB, OLD_CANE = -1, -2
#: Cane's number of wood that is no cane, by class, and what stays below its cut.
_WOOD = {"spur": STUB, "cordon": OLD_CANE}
_STAYS = {STUB: "the cane", OLD_CANE: "the head"}


@dataclass(frozen=True)
class WantedCut:
    """Wood of which something stays, and where it is cut.

    Attributes:
        vine: Vine along the row.
        spur: Spur on the vine.
        cane: Cane on the spur; `STUB` for the spur's own wood, `OLD_CANE` for last year's cane beside it.
        kind: What the cut is for.
        cut: Where it is right; None where this wood stays as it is.
        nodes: Middles of its count nodes, base first (N×3, m, world).
    """

    vine: int
    spur: int
    cane: int
    kind: CutKind
    cut: RightCut | None
    nodes: Array


@dataclass(frozen=True)
class TrueCut:
    """What bites did to the vine, in the plant's own frame: by rod and place on it, wherever odometry has it.

    Attributes:
        right: Wood was severed where it is right, and nothing that stays.
        harm: What that stays was severed; empty for nothing.
        right_cane: A cane or stub that is to be cut was cut.
        nodes_left: Count nodes left on the cane that stays, where it was cut.
        past_best: Along the wood, from where the rule puts the blades to where they cut (m).
    """

    right: bool
    harm: str
    right_cane: bool = False
    nodes_left: int | None = None
    past_best: float | None = None


def wanted_cuts(row: Row, guyot: bool = False) -> tuple[WantedCut, ...]:
    """The right cuts of a row before the first one, of spur-pruned or Guyot vines.

    A Guyot vine asks for three: one on each cane of its spur, and the removal of last year's cane.
    """
    none, out = np.zeros((0, 3)), list[WantedCut]()
    if not guyot:
        for spur in judge(row):
            place = spur.vine, spur.spur
            out.append(WantedCut(*place, spur.keeper, "spur cut", spur.cut, spur.nodes))
            out.append(WantedCut(*place, STUB, "renewal cut", spur.renewal, none))
        return tuple(out)
    for vine in judge_guyot(row):
        canes: tuple[tuple[int, CutKind, RightCut | None], ...] = (
            (vine.lower, "spur cut", vine.spur_cut),
            (vine.upper, "cane cut", vine.cane_cut),
        )
        for cane, kind, cut in canes:
            own = (rod for _, rod in row.standing() if (rod.vine, rod.spur, rod.cane) == (vine.vine, 0, cane))
            middles = [rod.at(0.5)[0] for rod in own if rod.kind == "node"][1:]
            out.append(WantedCut(vine.vine, 0, cane, kind, cut, np.array(middles).reshape(-1, 3)))
        out.append(WantedCut(vine.vine, 0, STUB, "renewal cut", None, none))
        out.append(WantedCut(vine.vine, 0, OLD_CANE, "removal", vine.removal, none))
    return tuple(out)


def true_cut(wanted: Iterable[WantedCut], pieces: Iterable[Mapping[str, Any]]) -> TrueCut:
    """Judge what one or more bites severed for a point.

    Args:
        wanted: Of the row before the first cut.
        pieces: What was severed: vine, spur, cane, kind and point of each, as in the trace.
    """
    known = {(each.vine, each.spur, each.cane): each for each in wanted}
    right, harm, cane, nodes, past = False, "", False, None, None
    for piece in pieces:
        place, number = np.array(piece["point"]), _WOOD.get(piece["kind"], piece["cane"])
        found = known.get((piece["vine"], piece["spur"], number))
        if found is None:
            continue
        stub = number == STUB
        cut, name = found.cut, f"vine {found.vine}, spur {found.spur}"
        if cut is None:
            harm = f"{name}: the {'stub below the cane that stays' if stub else 'short cane that stays'} was cut"
            continue
        cane, past = True, cut.past_best(place)
        if number >= 0:
            nodes = int(np.sum((found.nodes - place) @ cut.tangent < 0.0))
        if float((place - cut.least) @ cut.tangent) < 0.0:
            harm = f"{name}: {_STAYS.get(number, 'a node')} that stays was cut off"
        else:
            right = right or cut.past_most(place) <= 0.0
    return TrueCut(right and not harm, harm, cane, nodes, past)
