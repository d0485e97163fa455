"""What an operator may ask of perception: another pruning rule, or a point where they put it."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

from rolling_panda.messages import Count, Text, UnitVector3, Vector3


class PlantRequest(Struct, frozen=True, kw_only=True, tag=True, forbid_unknown_fields=True):
    """Root of what an operator may ask of perception. `user` is who asks."""

    user: Text


class SetRule(PlantRequest, frozen=True, kw_only=True):
    """Prune by these numbers from now on; points of all that was seen change at once.

    Attributes:
        system: How the vines are trained.
        nodes_kept: Count nodes that stay on a spur.
        fruiting_nodes: Count nodes that stay on a Guyot vine's new cane.
        keeper_diameter: The lowest cane at least this thick becomes the new spur (m).
        offset: Cut so far past the last kept node (m).
    """

    system: Literal["spur", "guyot"] = "spur"
    nodes_kept: Annotated[int, Meta(ge=1, le=5)] = 2
    fruiting_nodes: Annotated[int, Meta(ge=3, le=20)] = 8
    keeper_diameter: Annotated[float, Meta(ge=0.003, le=0.015)] = 0.006
    offset: Annotated[float, Meta(ge=0.005, le=0.05)] = 0.020


class AddPoint(PlantRequest, frozen=True, kw_only=True):
    """Add a point on the known cane that a line of sight passes nearest, as from a click into the 3-D view.

    Attributes:
        origin: Where the line begins, in odom (m).
        direction: Along it, in odom.
    """

    origin: Vector3
    direction: UnitVector3


class AddPointInImage(PlantRequest, frozen=True, kw_only=True):
    """Add a point on the known cane under a pixel of a camera image.

    Attributes:
        sequence: Of the frame that was clicked; one of the newest few that perception has worked on.
        u: Column, as a share of the width.
        v: Row, as a share of the height.
    """

    sequence: Count
    u: Annotated[float, Meta(ge=0.0, le=1.0)]
    v: Annotated[float, Meta(ge=0.0, le=1.0)]


AnyPlantRequest = SetRule | AddPoint | AddPointInImage
