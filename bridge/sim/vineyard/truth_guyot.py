"""Where a grower would cut a Guyot vine: the judge for tests and benchmarks, never an input of perception.

Three cuts renew the vine: the lower cane of the spur is cut back to two nodes and becomes the next spur, the upper one
is tipped after the nodes that will fruit, and last year's cane goes in one cut beyond the head, with all its shoots.
"""

from dataclasses import dataclass

import numpy as np

from bridge.sim.vineyard.row import Rod, Row
from bridge.sim.vineyard.truth import KEPT_NODES, RightCut, shortening, stretch

#: Nodes on the cane that will fruit.
FRUITING_NODES = 8
#: Old cane left at the head, and kept free before its first shoot (m).
_STUMP, _BEFORE_SHOOT = 0.03, 0.02


@dataclass(frozen=True)
class GuyotTruth:
    """What is right for one vine.

    Attributes:
        vine: Vine along the row.
        lower: The spur's cane that becomes the next spur.
        upper: The spur's cane that becomes the next fruiting cane.
        spur_cut: On the lower one; None where it has too few nodes.
        cane_cut: On the upper one; the same.
        removal: Of last year's cane.
    """

    vine: int
    lower: int
    upper: int
    spur_cut: RightCut | None
    cane_cut: RightCut | None
    removal: RightCut


def judge_guyot(row: Row) -> tuple[GuyotTruth, ...]:
    """The truth for every Guyot vine, in order; `row` has not been cut yet."""
    chains: dict[int, dict[int, list[tuple[int, Rod]]]] = {}
    arms: dict[int, tuple[int, Rod]] = {}
    for index, rod in row.standing():
        if rod.cane >= 0 and rod.spur == 0:
            chains.setdefault(rod.vine, {}).setdefault(rod.cane, []).append((index, rod))
        elif rod.kind == "cordon":
            arms.setdefault(rod.vine, (index, rod))
    out = []
    for vine in sorted(chains):
        lower, upper = sorted(chains[vine], key=lambda cane: float(chains[vine][cane][0][1].start[2]))
        index, arm = arms[vine]
        length = float(np.linalg.norm(arm.end - arm.start))
        out.append(
            GuyotTruth(
                vine=vine,
                lower=lower,
                upper=upper,
                spur_cut=shortening(chains[vine][lower], KEPT_NODES),
                cane_cut=shortening(chains[vine][upper], FRUITING_NODES),
                removal=stretch(index, arm, _STUMP, _STUMP + 0.02, length - _BEFORE_SHOOT),
            )
        )
    return tuple(out)
