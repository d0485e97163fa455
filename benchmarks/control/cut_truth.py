"""What a cut in physics did to the vine, by the simulator's truth: right, harmful, or neither."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bridge.sim.vineyard.truth import SpurTruth


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


def true_cut(truths: Iterable[SpurTruth], pieces: Iterable[Mapping[str, Any]]) -> TrueCut:
    """Judge what one or more bites severed for a point.

    Args:
        truths: Of the row before the first cut.
        pieces: What was severed: vine, spur, cane, kind and point of each, as in the trace.
    """
    known = {(truth.vine, truth.spur): truth for truth in truths}
    right, harm, cane, nodes, past = False, "", False, None, None
    for piece in pieces:
        truth, place = known.get((piece["vine"], piece["spur"])), np.array(piece["point"])
        if truth is None:
            continue
        stub = piece["kind"] == "spur"
        if not stub and piece["cane"] != truth.keeper:
            continue
        cut = truth.renewal if stub else truth.cut
        if cut is not None:
            cane, past = True, cut.past_best(place)
            if not stub:
                nodes = int(np.sum((truth.nodes - place) @ cut.tangent < 0.0))
        name = f"vine {truth.vine}, spur {truth.spur}"
        if cut is None:
            harm = f"{name}: the {'stub below the cane that stays' if stub else 'short cane that stays'} was cut"
        elif float((place - cut.least) @ cut.tangent) < 0.0:
            harm = f"{name}: {'the cane' if stub else 'a node'} that stays was cut off"
        else:
            right = right or cut.past_most(place) <= 0.0
    return TrueCut(right and not harm, harm, cane, nodes, past)
