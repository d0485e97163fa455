"""What an operator may ask of perception: another pruning rule, or a point where they put it."""

from typing import Annotated

from msgspec import Meta, Struct

from rolling_panda.messages import Count, Name, PruningRule, Text, UnitVector3, Vector3


class PlantRequest(Struct, frozen=True, kw_only=True, tag=True, forbid_unknown_fields=True):
    """Root of what an operator may ask of perception. `user` is who asks."""

    user: Text


class SetRule(PlantRequest, frozen=True, kw_only=True):
    """Prune by these numbers from now on; points of all that was seen change at once."""

    rule: PruningRule = PruningRule()


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


class MovePoint(PlantRequest, frozen=True, kw_only=True):
    """Move a point along its cane; it is judged anew, and from now on it is where a person wants it.

    Attributes:
        point_id: Of the point.
        along: So far (m), away from the cordon; negative towards it.
    """

    point_id: Name
    along: Annotated[float, Meta(ge=-0.1, le=0.1)]


AnyPlantRequest = SetRule | AddPoint | AddPointInImage | MovePoint
