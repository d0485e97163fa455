"""Pruning points as perception would show them."""

from typing import Any

import msgspec

from rolling_panda import messages as m


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
        reason="test",
    )
    return msgspec.structs.replace(usual, **changes)
