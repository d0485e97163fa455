"""What perception sees: pruning points, close-ups, crops, and what stands in the way."""

import hashlib
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

from rolling_panda.messages.types import (
    Count,
    Covariance,
    CutKind,
    Digest,
    Epoch,
    Finite,
    Fraction,
    Header,
    Message,
    Metre,
    Name,
    Need,
    NonNegative,
    Text,
    UnitVector3,
    Vector3,
    WoodClass,
)


class PruningPoint(Struct, frozen=True, forbid_unknown_fields=True):
    """Where to cut, and why.

    Attributes:
        point_id: Stable while the point is tracked from frame to frame.
        revision: Grows when what is cut changes: its kind, the nodes kept, or by more than noise its place or tangent.
        position: On the cane's axis, in odom (m).
        tangent: Unit vector along the cane, pointing away from the cordon, in odom.
        radius: Of the cane (m).
        confidence: 0…1.
        nodes_seen: Count nodes seen on the cane (the basal bud is not counted).
        nodes_kept: Count nodes that stay below the cut.
        vine: Number of the vine along the row, as perceived.
        spur: Number of the spur position on that vine, as perceived.
        reason: Why here, in one sentence a grower understands.
        kind: Shortens the cane that stays, takes the old stub off, tips the cane that will fruit, or is a person's.
        offset: Past the last kept node, along the cane (m); None where no kept node is below the cut.
        force: Predicted cutting force (N).
        wire_distance: To the surface of the nearest known wire (m); None while none is known.
        cordon_distance: The same for cordons.
        node_distance: To the nearest node that stays (m); None where none is known.
        digest: Hash of what is cut and where, as `rolling_panda.point_digest` makes it; one for each revision.
    """

    point_id: Name
    revision: Count
    position: Vector3
    tangent: UnitVector3
    radius: Annotated[float, Meta(gt=0.0, le=0.1)]
    confidence: Fraction
    nodes_seen: Annotated[int, Meta(ge=0, le=100)]
    nodes_kept: Annotated[int, Meta(ge=0, le=100)]
    vine: Annotated[int, Meta(ge=0, le=100000)]
    spur: Annotated[int, Meta(ge=0, le=100000)]
    reason: Text
    kind: CutKind = "spur cut"
    position_covariance: Covariance | None = None
    tangent_covariance: Covariance | None = None
    offset: Metre | None = None
    force: NonNegative = 0.0
    wire_distance: Finite | None = None
    cordon_distance: Finite | None = None
    node_distance: NonNegative | None = None
    digest: Digest = ""


class PruningRule(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Nodes kept on a spur, and on a Guyot vine's new cane; least diameter preferred (m); past the last node (m)."""

    system: Literal["spur", "guyot"] = "spur"
    nodes_kept: Annotated[int, Meta(ge=1, le=5)] = 2
    fruiting_nodes: Annotated[int, Meta(ge=3, le=20)] = 8
    preferred_diameter: Annotated[float, Meta(ge=0.003, le=0.015)] = 0.006
    offset: Annotated[float, Meta(ge=0.005, le=0.05)] = 0.020


class UndecidedSite(Struct, frozen=True, forbid_unknown_fields=True):
    """A place without a point: why, and what it needs. Without vine and spur (0) it is about no spur in particular.

    `position` is where the spur was seen (m, odom).
    """

    reason: Text
    needs: Need
    vine: Annotated[int, Meta(ge=0, le=100000)] = 0
    spur: Annotated[int, Meta(ge=0, le=100000)] = 0
    position: Vector3 | None = None


class PruningPoints(Message, frozen=True, kw_only=True):
    """Perception → all: every point it holds true now.

    Attributes:
        header: `frame_id` is odom.
        segmenter: Name of the segmenter behind it.
        frames: Camera frames used so far.
        points: All points.
        undecided_sites: Places seen without a point, over all frames.
        canes: Axis of each cane as perceived: polylines in odom (m).
        rule: In force; None where nobody says.
    """

    header: Header
    segmenter: Text
    frames: Count
    points: tuple[PruningPoint, ...]
    undecided_sites: tuple[UndecidedSite, ...] = ()
    canes: tuple[tuple[Vector3, ...], ...] = ()
    rule: PruningRule | None = None


#: Largest picture (bytes).
CROP_BYTES = 8192


class PointCrop(Message, frozen=True, kw_only=True):
    """Perception → server: what the camera saw of a point's spur, the cut in the middle.

    Attributes:
        point_id: Of the point.
        revision: That it shows.
        sequence: Of the camera frame that it was taken from.
        jpeg: The picture; black where the frame ended.
    """

    point_id: Name
    revision: Count
    sequence: Count
    jpeg: Annotated[bytes, Meta(max_length=CROP_BYTES)]


#: `seen`: the cane stands and fits; `changed`: it stands but is not what was accepted; `severed`: the wood beyond the
#: cut is gone; `unseen`: the picture does not tell.
Finding = Literal["seen", "changed", "severed", "unseen"]


class CloseUpRequest(Message, frozen=True, kw_only=True):
    """Controller → bridge: take a close-up of a point now. Repeated until seen; the bridge acts on a `number` once.

    Attributes:
        epoch: As in `MotionCommand`.
        number: Strictly increasing within an epoch.
        point_id: The point; the frame carries it.
    """

    epoch: Epoch
    number: Count
    point_id: Name


class CloseUpResult(Message, frozen=True, kw_only=True):
    """Perception → controller: what a requested close-up shows of its point.

    Attributes:
        header: Stamp of the picture; `frame_id` is odom.
        point_id: The point.
        number: Of the request.
        finding: What it shows.
        reason: Why it is unseen or has changed, in words.
        position: Where its cut belongs as seen now (m, odom); None unless `seen`.
        tangent: Of the cane there; None unless `seen`.
        distance: Of the camera from the point (m).
        nodes: Places along the cane where nodes were seen (m beyond the cut, negative before it).
    """

    header: Header
    point_id: Name
    number: Count
    finding: Finding
    reason: Text = ""
    position: Vector3 | None = None
    tangent: UnitVector3 | None = None
    distance: NonNegative = 0.0
    nodes: tuple[Finite, ...] = ()


#: Number of a vine or a spur, -1 for none.
Number = Annotated[int, Meta(ge=-1, le=10**6)]


class Capsule(Struct, frozen=True, forbid_unknown_fields=True):
    """A rod with round ends: axis from `start` to `end` (m), radii at both (m).

    `vine` and `spur`, numbers as pruning points have them, are of the spur that it grows from; -1 where there is none.
    `undecided` wood may yet be cut off: which cane of that spur stays was left to a person.
    """

    kind: WoodClass
    start: Vector3
    end: Vector3
    start_radius: NonNegative
    end_radius: NonNegative
    vine: Number = -1
    spur: Number = -1
    undecided: bool = False


class Scenery(Message, frozen=True, kw_only=True):
    """Simulated bridge → server: the row as it stands, for display only. Perception and control never subscribe.

    `revision` grows whenever something was severed.
    """

    header: Header
    revision: Count
    capsules: tuple[Capsule, ...]


class Obstacles(Message, frozen=True, kw_only=True):
    """Perception → controller: what stands in the way of base and arm, as far as it was seen.

    Attributes:
        header: `frame_id` is odom.
        capsules: Posts, trunks, cordons, wires, and of the canes what stays once the row is pruned, each with its vine
            and spur. What is to be cut off is not among them: it gives way.
    """

    header: Header
    capsules: tuple[Capsule, ...]


def point_digest(point: PruningPoint) -> str:
    """What is cut and where, as 32 hexadecimal digits.

    They are the first half of SHA-256 over the MessagePack array [point_id, revision, kind, position, tangent,
    nodes_kept, vine, spur] with numbers of position and tangent as 64-bit floats. What perception goes on measuring
    without changing the cut (radius, confidence, distances) is left out, so that a revision has one hash.
    """
    content = (
        point.point_id,
        point.revision,
        point.kind,
        tuple(float(value) for value in point.position),
        tuple(float(value) for value in point.tangent),
        point.nodes_kept,
        point.vine,
        point.spur,
    )
    return hashlib.sha256(msgspec.msgpack.encode(content)).hexdigest()[:32]
