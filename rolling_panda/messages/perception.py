"""Messages of perception: pruning points, pictures of spurs, close-ups and obstacles."""

import hashlib
from typing import Annotated, Final, Literal

import msgspec
from msgspec import Meta, Struct

from rolling_panda.messages.robot import NO_OFFSETS, ArmCalibration, BaseCalibration, FrameTiming, JointOffsets
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
    Pose,
    QuatXyzw,
    Reason,
    Text,
    UnitVector3,
    Vector3,
    WallTime,
    WoodClass,
)


class PruningPoint(Struct, frozen=True, forbid_unknown_fields=True):
    """A proposed cut: place, direction, reason and uncertainty.

    Attributes:
        point_id: Stable while the point is tracked from frame to frame.
        revision: Increases when the cut changes: its kind, the nodes kept, or its place or tangent by more than noise.
        position: Position on the cane's axis, in map (m).
        tangent: Unit vector along the cane in map, pointing away from the cordon.
        radius: Radius of the cane (m).
        confidence: 0 … 1.
        nodes_seen: Number of count nodes seen on the cane, without the basal bud.
        nodes_kept: Number of count nodes that stay below the cut.
        vine: Number of the vine along the row, as perceived.
        spur: Number of the spur position on that vine, as perceived.
        cane: Number of the cane on that spur, as perceived; of a renewal cut that of the cane that stays. It names the
            same cane for as long as perception runs; -1 if unknown.
        reason: Explanation of the cut for a grower.
        kind: `spur cut` shortens the cane that stays, `renewal cut` removes the old stub, `cane cut` shortens the
            fruiting cane, `removal` takes last year's cane of a Guyot vine off its head, `by hand` was placed by a
            person.
        position_covariance: Covariance of the position (m²): xx, xy, xz, yy, yz, zz.
        tangent_covariance: Covariance of the tangent in the same order.
        offset: Distance past the last kept node along the cane (m); None without a kept node below the cut.
        force: Predicted cutting force (N).
        wire_distance: Distance to the surface of the nearest known wire (m); None if none is known.
        cordon_distance: The same for cordons.
        node_distance: Distance to the nearest node that stays (m); None if none is known.
        digest: Hash of the revision's place and kind, see `point_digest`.
        inward: By how much nearer to the cordon the same cut may be made, where it has no room (m): on the same wood,
            with the same nodes left.
        outward: The same farther from the cordon.
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
    reason: Reason
    kind: CutKind = "spur cut"
    position_covariance: Covariance | None = None
    tangent_covariance: Covariance | None = None
    offset: Metre | None = None
    force: NonNegative = 0.0
    wire_distance: Finite | None = None
    cordon_distance: Finite | None = None
    node_distance: NonNegative | None = None
    digest: Digest = ""
    cane: Annotated[int, Meta(ge=-1, le=100000)] = -1
    inward: NonNegative = 0.0
    outward: NonNegative = 0.0


class PruningRule(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Numbers from which the cuts follow.

    Attributes:
        system: Training system.
        nodes_kept: Nodes kept on a spur.
        fruiting_nodes: Nodes kept on the new cane of a Guyot vine.
        preferred_diameter: Smallest diameter of a cane that is preferred to stay (m).
        offset: Distance of the cut past the last kept node (m).
    """

    system: Literal["spur", "guyot"] = "spur"
    nodes_kept: Annotated[int, Meta(ge=1, le=5)] = 2
    fruiting_nodes: Annotated[int, Meta(ge=3, le=20)] = 8
    preferred_diameter: Annotated[float, Meta(ge=0.003, le=0.015)] = 0.006
    offset: Annotated[float, Meta(ge=0.005, le=0.05)] = 0.020


class UndecidedSite(Struct, frozen=True, forbid_unknown_fields=True):
    """A spur without a pruning point.

    Attributes:
        reason: Reason.
        needs: Another look by the camera, or a decision by the operator; nothing where one has left it as it is.
        vine: Number of the vine; 0 for no particular spur.
        spur: Number of the spur on that vine; 0 for no particular spur.
        position: Position of the spur in map (m), if known.
    """

    reason: Reason
    needs: Need
    vine: Annotated[int, Meta(ge=0, le=100000)] = 0
    spur: Annotated[int, Meta(ge=0, le=100000)] = 0
    position: Vector3 | None = None


class PruningPoints(Message, frozen=True, kw_only=True):
    """Perception → all: all current pruning points.

    Attributes:
        header: `frame_id` is map.
        segmenter: Name of the segmenter.
        frames: Number of camera frames used so far.
        points: All current points.
        undecided_sites: Spurs seen without a point, over all frames.
        canes: Axis of each perceived cane, a polyline in map (m).
        rule: Current pruning rule; None if unknown.
    """

    header: Header
    segmenter: Text
    frames: Count
    points: tuple[PruningPoint, ...]
    undecided_sites: tuple[UndecidedSite, ...] = ()
    canes: tuple[tuple[Vector3, ...], ...] = ()
    rule: PruningRule | None = None


#: Size limit of a picture (bytes).
PICTURE_BYTES = 61440
#: A place in a picture, from its top left corner (px): column, row.
Pixel = tuple[Finite, Finite]
#: The same on wood that is cut, with the arc length from the cut (m): negative on the part that stays.
AxisPixel = tuple[Finite, Finite, Metre]


class DrawnCut(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A cut as it is drawn on a picture.

    Attributes:
        point_id: The point.
        revision: Revision that is drawn.
        position: The cut.
        axis: Axis of the wood that is cut, from its base outwards. What is beyond the cut falls.
        nodes: Nodes seen on that wood.
        falls: Axes of other wood that falls with it: the canes on a stub that is removed.
        thickness: Diameter of the wood at the cut (px).
    """

    point_id: Name
    revision: Count
    position: Pixel
    axis: tuple[AxisPixel, ...]
    nodes: tuple[AxisPixel, ...] = ()
    falls: tuple[tuple[Pixel, ...], ...] = ()
    thickness: NonNegative = 0.0


class SpurDrawing(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What is drawn on the picture of a spur.

    Attributes:
        vine: Number of the vine.
        spur: Number of the spur on that vine.
        image: Hash of the picture that this is drawn on.
        sequence: `sequence` of the camera frame that the picture is a part of.
        frame: Width and height of that frame (px).
        window: Left, top, width and height of the part (px of the frame). The picture may have fewer pixels.
        size: Width and height of the picture (px).
        canes: Axes of the spur's known canes.
        cuts: The spur's points that the picture shows.
    """

    vine: Annotated[int, Meta(ge=0, le=100000)]
    spur: Annotated[int, Meta(ge=0, le=100000)]
    image: Digest
    sequence: Count
    frame: tuple[Count, Count]
    window: tuple[Count, Count, Count, Count]
    size: tuple[Count, Count]
    canes: tuple[tuple[Pixel, ...], ...] = ()
    cuts: tuple[DrawnCut, ...] = ()


class SpurPicture(Message, frozen=True, kw_only=True):
    """Perception → server: camera image of a spur with a point, or of an undecided one.

    Attributes:
        drawing: What is drawn on it.
        jpeg: The image.
    """

    drawing: SpurDrawing
    jpeg: Annotated[bytes, Meta(max_length=PICTURE_BYTES)]


#: `seen`: the cane stands and matches; `changed`: it stands but differs from the accepted one; `severed`: the wood
#: beyond the cut is gone; `unseen`: the picture is not conclusive.
Finding = Literal["seen", "changed", "severed", "unseen"]


class CloseUpRequest(Message, frozen=True, kw_only=True):
    """Controller → bridge: take a close-up of a point now.

    It is repeated until the result is there. The bridge executes a `number` once.

    Attributes:
        epoch: As in `MotionCommand`.
        number: Strictly increasing within an epoch.
        point_id: The point; it is copied into the camera frame.
    """

    epoch: Epoch
    number: Count
    point_id: Name


class CloseUpResult(Message, frozen=True, kw_only=True):
    """Perception → controller: result of a close-up.

    Attributes:
        header: Stamp of the camera frame; `frame_id` is odom.
        point_id: The point.
        number: `number` of the request.
        finding: State of the cane.
        reason: Reason for `unseen` or `changed`, or a remark on `seen`; None without one.
        position: Position of the cut by this picture in odom (m); None unless `seen`.
        tangent: Unit tangent of the cane there in odom; None unless `seen`.
        distance: Distance of the camera from the point (m).
        nodes: Positions of the nodes seen along the cane (m beyond the cut, negative before it).
    """

    header: Header
    point_id: Name
    number: Count
    finding: Finding
    reason: Reason | None = None
    position: Vector3 | None = None
    tangent: UnitVector3 | None = None
    distance: NonNegative = 0.0
    nodes: tuple[Finite, ...] = ()


#: `point_id` of a picture on the way to a cut is this with the id of the point.
ON_THE_WAY: Final = "way:"


class CutSight(Message, frozen=True, kw_only=True):
    """Perception → controller: where the cut is in a picture that was taken on the last way to it.

    Attributes:
        header: Stamp of the camera frame; `frame_id` is odom.
        point_id: The point.
        number: `number` of the request.
        reason: Why the picture does not tell; None where it does.
        position: Where the cane crosses the plane square to it in which the close-up saw the cut, in odom (m); None
            where the picture does not tell. It says nothing about the place along the cane.
        covariance: Of the position (m²): xx, xy, xz, yy, yz, zz; without what is wrong in all pictures alike.
    """

    header: Header
    point_id: Name
    number: Count
    reason: Reason | None = None
    position: Vector3 | None = None
    covariance: Covariance | None = None


class Localisation(Message, frozen=True, kw_only=True):
    """Perception → controller: where the robot is in the row.

    The wood stands still in map: points, obstacles and plans are in it. The robot's motion is in odom, which drifts
    against it. The transform may jump.

    Attributes:
        header: Stamp of the newest frame; `frame_id` is map.
        state: `off`: not estimated, map and odom are one; `odometry`: no wood was recognised yet; `located`; `lost`.
        T_map_odom: Pose of odom in map, in use.
        covariance: Of x, y (m) and the heading (rad) of the base relative to the wood nearby.
        way: Way since wood was last recognised (m).
        bodies: Number of canes, posts and trunks that were recognised then.
        reason: Why the robot is lost; None otherwise.
    """

    header: Header
    state: Literal["off", "odometry", "located", "lost"]
    T_map_odom: Pose
    covariance: Covariance
    way: NonNegative = 0.0
    bodies: Count = 0
    reason: Reason | None = None


#: Number of a vine or a spur; -1 for none.
Number = Annotated[int, Meta(ge=-1, le=10**6)]


class Capsule(Struct, frozen=True, forbid_unknown_fields=True):
    """A capsule, in the frame of its message.

    Attributes:
        kind: Class of the wood or object.
        start: First end of the axis (m).
        end: Second end of the axis (m).
        start_radius: Radius at `start` (m).
        end_radius: Radius at `end` (m).
        vine: Number of the vine, as in pruning points; -1 for none.
        spur: Number of the spur that it grows from; -1 for none.
        undecided: True for canes of an undecided site, which may be cut later, and for the hidden rest of any cane.
        cane: Number of the cane on that spur, as in pruning points; -1 if unknown.
    """

    kind: WoodClass
    start: Vector3
    end: Vector3
    start_radius: NonNegative
    end_radius: NonNegative
    vine: Number = -1
    spur: Number = -1
    undecided: bool = False
    cane: Number = -1


#: `point_id` of a picture of the board is this with its number, from 1.
CALIBRATION: Final = "calibration:"
#: The same of a picture of the row from another pose, to check the calibration by.
CHECK: Final = "check:"
#: The same of a picture of the board between the drives of the base's calibration.
BASE: Final = "base:"
#: The same of a picture of the board for the calibration of the arm's joints.
ARM: Final = "arm:"


class CameraMount(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Calibration of the camera on the hand.

    Attributes:
        position: Origin of the camera in the frame of the arm's flange, panda_link8 (m).
        quat_xyzw: Its rotation there.
        focal: Focal length as a multiple of the one that the camera reports.
        source: `board`, or `work`: from wood that was seen from several places.
        made_at: Time of the calibration.
        views: Number of pictures, or of observations of wood.
        pixels: Root mean square of the reprojection error (px); 0 for `work`.
        angle_sd: Standard deviation of the direction in which it looks (rad).
        shift_sd: Standard deviation of the position along each axis (m).
        joint_offsets: Offsets of the arm's joints that it was made with (rad); with others it does not fit.
    """

    position: Vector3
    quat_xyzw: QuatXyzw
    focal: Annotated[float, Meta(ge=0.9, le=1.1)] = 1.0
    source: Literal["board", "work"] = "board"
    made_at: WallTime = 0.0
    views: Count = 0
    pixels: NonNegative = 0.0
    angle_sd: NonNegative = 0.0
    shift_sd: NonNegative = 0.0
    joint_offsets: JointOffsets = NO_OFFSETS


class CameraState(Message, frozen=True, kw_only=True):
    """Perception → server: the camera's calibration, and the monitor's estimate of its error.

    Attributes:
        header: Stamp of the newest frame.
        mount: The calibration in use; None while the camera is taken to be where it is drawn.
        views: Pictures of the board since the last calibration began.
        offer: A better calibration, which `UseCamera` takes; None without one.
        refused: Why the last calibration gave no offer; None if it gave one, or before the first.
        turned: Rotation of the camera against its calibration by ordinary work (rad, about its axes x right, y down, z
            forward); None before enough was seen.
        turned_sd: Standard deviation of that about each axis (rad).
        observations: Pictures that it is from.
        time_offset: By how much pictures are exposed later than the joint states that come with them, by ordinary work
            (s); None before enough was seen in motion.
        time_offset_sd: Standard deviation of that (s).
        warning: What is wrong with the calibration; None if nothing is known.
    """

    header: Header
    mount: CameraMount | None = None
    views: Count = 0
    offer: CameraMount | None = None
    refused: Reason | None = None
    turned: Vector3 | None = None
    turned_sd: Vector3 | None = None
    observations: Count = 0
    time_offset: Finite | None = None
    time_offset_sd: NonNegative | None = None
    warning: Reason | None = None


class RobotCalibration(Message, frozen=True, kw_only=True):
    """Perception → controller and server: what pictures tell of the robot itself.

    Attributes:
        header: Stamp of the newest picture of the board; 0 before the first.
        base_views: Pictures of the board since the last calibration of the base began.
        base: A new calibration of the base, which `UseBase` takes; None without one.
        base_refused: Why the last calibration of the base gave none; None if it gave one, or before the first.
        arm_views: Pictures of the board since the last calibration of the arm began.
        arm: A new calibration of the arm, which `UseArm` takes; None without one.
        arm_refused: Why the last calibration of the arm gave none; None if it gave one, or before the first.
        timing: A new calibration of the camera's clock, by ordinary work, which `UseTiming` takes; None without one.
    """

    header: Header
    base_views: Count = 0
    base: BaseCalibration | None = None
    base_refused: Reason | None = None
    arm_views: Count = 0
    arm: ArmCalibration | None = None
    arm_refused: Reason | None = None
    timing: FrameTiming | None = None


class Scenery(Message, frozen=True, kw_only=True):
    """Simulated bridge → server: the simulated row, for display only. Perception and control never subscribe to it.

    Attributes:
        header: `frame_id` is map.
        revision: Increases when something is severed.
        capsules: All parts of the row, and the severed wood on the ground.
    """

    header: Header
    revision: Count
    capsules: tuple[Capsule, ...]


class MovedCapsule(Struct, frozen=True, forbid_unknown_fields=True):
    """Where a capsule of the simulated row is now.

    Attributes:
        index: Of the capsule in `Scenery`.
        start: First end of the axis (m).
        end: Second end of the axis (m).
    """

    index: Count
    start: Vector3
    end: Vector3


class SceneryMotion(Message, frozen=True, kw_only=True):
    """Simulated bridge → server: canes near the tool that wind and arm have displaced, for display only.

    Each message has all of them: capsules that it does not name are at rest, as `Scenery` has them. It is sent when one
    has moved by 3 mm, and never in a world without wind and elastic canes.

    Attributes:
        header: `frame_id` is map.
        revision: That of the `Scenery` with these capsules.
        moved: The displaced capsules.
    """

    header: Header
    revision: Count
    moved: tuple[MovedCapsule, ...]


class Obstacles(Message, frozen=True, kw_only=True):
    """Perception → controller: obstacles for base and arm, as far as seen.

    Attributes:
        header: `frame_id` is map.
        capsules: Posts, trunks, cordons, wires and retained canes. Wood that will be cut off is not an obstacle: it
            gives way.
    """

    header: Header
    capsules: tuple[Capsule, ...]


def identity(point: PruningPoint) -> tuple[str | int, ...]:
    """What a cut is, wherever it is seen: its kind, the nodes kept, and vine, spur and cane.

    The internode follows from the nodes kept. Equal only within one run of perception, which numbers spurs and canes.
    """
    return point.kind, point.nodes_kept, point.vine, point.spur, point.cane


def point_digest(point: PruningPoint) -> str:
    """Hash of a point's place and kind of cut: 32 hexadecimal digits.

    It is the first half of the SHA-256 of the MessagePack array [point_id, revision, kind, position, tangent,
    nodes_kept, vine, spur], with position and tangent as 64-bit floats. Values that change without changing the cut
    (radius, confidence, distances) are left out, so that a revision has one hash.
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
