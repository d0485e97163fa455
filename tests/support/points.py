"""Pruning points as perception would show them."""

from typing import Any

import msgspec

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import PreviewedCut


def point(
    point_id: str, position: m.Vector3, tangent: m.UnitVector3 = (0.0, 0.0, 1.0), **changes: Any
) -> m.PruningPoint:
    """A cut of a cane that is 8 mm thick, upright where no `tangent` is given; `changes` are other fields."""
    usual = m.PruningPoint(
        point_id=point_id,
        revision=1,
        position=position,
        tangent=tangent,
        radius=0.004,
        confidence=0.9,
        nodes_seen=5,
        nodes_kept=2,
        vine=0,
        spur=0,
        reason=reasons.said("test"),
    )
    return msgspec.structs.replace(usual, **changes)


def rolled_out(point_id: str, revision: int = 1, **changes: Any) -> PreviewedCut:
    """Figures of a cut that takes 5 s from the start of the work; `changes` are other fields."""
    usual = PreviewedCut(
        point_id=point_id,
        revision=revision,
        begins_s=0.0,
        cut_s=3.0,
        ends_s=5.0,
        reason=None,
        clearance=0.06,
        between=("link5", "camera"),
        manipulability=0.067,
        joint_margin=0.6,
    )
    return msgspec.structs.replace(usual, **changes)
