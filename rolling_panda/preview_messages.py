"""The preview on the wire: the motion that the robot would make now, and whether a person has approved it."""

from typing import Literal

from msgspec import Struct

from rolling_panda.messages import (
    Actuated,
    Count,
    Digest,
    Finite,
    Header,
    Message,
    Name,
    NonNegative,
    PlanarPose,
    Text,
    Vector3,
)

PreviewPhase = Literal["none", "waiting", "rolling", "ready", "approved", "expired"]


class PreviewedCut(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One point of a preview, with the way to it and the way out again.

    Attributes:
        point_id: Of the point.
        revision: That is accepted, and that is previewed.
        begins_s: When the way to it begins (s from the start).
        cut_s: When the blades close (s from the start); None where they do not.
        ends_s: When the way to the next point begins, or the work ends (s from the start).
        result: How it ends, in words: cut, or why not.
        clearance: Least distance meanwhile between the robot's parts, and from them to ground and obstacles (m).
        between: Between what that is.
        manipulability: Least ω of the arm meanwhile.
        joint_margin: Least distance of an arm joint to its limit meanwhile (rad).
    """

    point_id: Name
    revision: Count
    begins_s: NonNegative
    cut_s: NonNegative | None
    ends_s: NonNegative
    result: Text
    clearance: Finite
    between: tuple[Text, Text]
    manipulability: NonNegative
    joint_margin: Finite


class PreviewState(Message, frozen=True, kw_only=True):
    """Controller → all: whether there is a preview, whether it still describes what would happen, and who approved it.

    Attributes:
        header: `frame_id` is odom.
        required: True while no cut begins that nobody has approved the preview of.
        phase: `waiting` for the robot to rest and the plan to be made, `rolling` while it is computed; `ready` to be
            approved; `expired` once something has changed.
        reason: What has changed, or what is waited for.
        preview_hash: SHA-256 of all that it was made from and of all that is in it; empty when there is none.
        approved_by: Who has approved it; empty when nobody has.
        start: Where the base begins.
        position: Actuated coordinates at the start (rad).
        duration_s: Of all of it (s).
        cuts: Points in their order.
        left: Accepted points that come after those, and are not in it.
    """

    header: Header
    required: bool
    phase: PreviewPhase
    reason: Text = ""
    preview_hash: Digest = ""
    approved_by: Text = ""
    start: PlanarPose | None = None
    position: Actuated | None = None
    duration_s: NonNegative = 0.0
    cuts: tuple[PreviewedCut, ...] = ()
    left: Count = 0


class PreviewRow(Struct, frozen=True, forbid_unknown_fields=True):
    """A moment of a preview: `time` from the start (s), base in odom, actuated coordinates (rad), tool in odom (m)."""

    time: NonNegative
    base: PlanarPose
    position: Actuated
    tool: Vector3


class PreviewMotion(Message, frozen=True, kw_only=True):
    """Controller → server: the motion of a preview, for the ghost in the 3-D view."""

    header: Header
    preview_hash: Digest
    rows: tuple[PreviewRow, ...] = ()
