"""Messages to and from the robot: motion, cuts, stops, joints, odometry, camera frames."""

import hashlib
from typing import Annotated, Final, Literal

from msgspec import Meta, Struct

from rolling_panda.messages.types import (
    Actuated,
    ActuatedVelocity,
    ArmTorques,
    BaseAttitude,
    BridgeKind,
    Count,
    Epoch,
    Finite,
    Fraction,
    Header,
    Message,
    Mode,
    Name,
    NonNegative,
    Outcome,
    PlanarPose,
    Reason,
    Speed,
    Text,
    WallTime,
)


class TokenRequest(Message, frozen=True, kw_only=True):
    """Controller → bridge: request, keep or release the fencing token.

    The holder repeats the request to keep its token. Another controller gets a token when the holder releases it, or is
    silent for a second. `BridgeState` reports the holder and the epoch.

    Attributes:
        token: Random part of the token, drawn by the requesting controller and sent to the bridge only.
        echo: `sequence` of the newest `JointState`; its age is checked as in `MotionCommand`.
        mode: Mode of the requesting controller; ignored in a release.
        releases: The controller releases its token. The next one that requests a token gets it.
    """

    token: Annotated[str, Meta(min_length=1, max_length=32)]
    echo: Count = 0
    mode: Mode = "IDLE"
    releases: bool = False


def fingerprint(token: str) -> str:
    """Public digest of a token. Its holder recognises it; nobody can command the robot with it."""
    return hashlib.sha256(token.encode()).hexdigest()[:16]


class MotionCommand(Message, frozen=True, kw_only=True):
    """Controller → bridge: the velocity of every actuator; newest wins.

    Attributes:
        epoch: Epoch of the token that the bridge has issued; any other is refused.
        sequence: Strictly increasing within an epoch.
        echo: `sequence` of the newest `JointState` the command was computed from. The bridge knows when it sent that
            state, so it judges the command's age on its own clock.
        xi: [θ̇_l, θ̇_r, q̇₁…q̇₇] in rad/s.
        token: Random part of the token; any other is refused.
    """

    epoch: Epoch
    sequence: Count
    echo: Count
    xi: ActuatedVelocity
    token: Annotated[str, Meta(max_length=32)] = ""


class CutCommand(Message, frozen=True, kw_only=True):
    """Controller → bridge: close the blades once.

    It is repeated until the bridge reports the cut. The robot has to be at rest.

    Attributes:
        epoch: As in `MotionCommand`.
        cut_id: Identifies the cut. The bridge executes it once.
        point_id: The point, for the record.
        echo: As in `MotionCommand`.
        token: As in `MotionCommand`.
    """

    epoch: Epoch
    cut_id: Name
    point_id: Name
    echo: Count = 0
    token: Annotated[str, Meta(max_length=32)] = ""


class StopRequest(Message, frozen=True, kw_only=True):
    """Any process → bridge and controller: the software stop, latched by both. Sent several times with one `stop_id`.

    Attributes:
        stop_id: Identifies the stop, also in the reset.
        source: Process or input that it came from.
        user: Who pressed; empty for a stop by a program.
        reason: Cause.
    """

    stop_id: Name
    source: Name
    user: Text
    reason: Reason


class JointState(Message, frozen=True, kw_only=True):
    """Bridge → all: measured actuated coordinates, like sensor_msgs/JointState.

    Attributes:
        header: Time of measurement.
        sequence: Strictly increasing.
        position: [θ_l, θ_r, q₁…q₇] (rad).
        velocity: Their velocities (rad/s).
        external_torque: Torques of q₁…q₇ by what touches the arm (N·m), as the arm estimates them: with offsets, and
            with the base's acceleration and tilt, of which it knows nothing. None if the robot has no estimate.
    """

    header: Header
    sequence: Count
    position: Actuated
    velocity: ActuatedVelocity
    external_torque: ArmTorques | None = None


class Odometry(Message, frozen=True, kw_only=True):
    """Bridge → all: odometry of the base, from the wheels and, where they are used, the camera's inertial sensors.

    Attributes:
        header: `frame_id` is odom.
        sequence: Strictly increasing.
        pose: base_link in odom, on the plane.
        linear: Forward velocity of the axle centre (m/s).
        angular: Yaw rate (rad/s).
        attitude: How the base stands on the ground; None without inertial sensors.
    """

    header: Header
    sequence: Count
    pose: PlanarPose
    linear: Speed
    angular: Speed
    attitude: BaseAttitude | None = None


class RejectionCount(Struct, frozen=True, forbid_unknown_fields=True):
    """Messages of a topic that were refused for one reason.

    Attributes:
        topic: The topic.
        reason: Reason for the refusal.
        count: Number of messages since the start of the bridge.
    """

    topic: Text
    reason: Reason
    count: Count


#: 5 % about the radius and the track as drawn (m).
Radius = Annotated[float, Meta(ge=0.127, le=0.141)]
Track = Annotated[float, Meta(ge=0.48, le=0.535)]


class BaseCalibration(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Calibration of the base's wheels.

    Attributes:
        left: Rolling radius of the left wheel (m).
        right: Rolling radius of the right wheel (m).
        track: Distance between the wheels' contacts (m).
        made_at: Time of the calibration.
        views: Number of pictures of the board.
        radius_sd: Standard deviation of the radii, as a share of them.
        apart_sd: The same of the difference between right and left.
        track_sd: The same of the track.
        slip: By how much the base went otherwise than its wheels, as a share of the way (root mean square).
    """

    left: Radius
    right: Radius
    track: Track
    made_at: WallTime = 0.0
    views: Count = 0
    radius_sd: NonNegative = 0.0
    apart_sd: NonNegative = 0.0
    track_sd: NonNegative = 0.0
    slip: NonNegative = 0.0


#: The most by which the encoder of a joint may be off (rad): 2°.
LARGEST_OFFSET: Final = 0.035
Offset = Annotated[float, Meta(ge=-LARGEST_OFFSET, le=LARGEST_OFFSET)]
JointOffsets = tuple[Offset, Offset, Offset, Offset, Offset, Offset, Offset]
NO_OFFSETS: Final[JointOffsets] = (0.0,) * 7


class ArmCalibration(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Calibration of the zeros of the arm's joints.

    Attributes:
        offsets: Angle of each joint by its encoder less its angle as drawn (rad). Those of joints 1 and 7 are 0: the
            pictures cannot tell them from the place of the board, and of the camera.
        made_at: Time of the calibration.
        views: Number of pictures of the board.
        pixels: Root mean square of the reprojection error (px).
        offset_sd: Standard deviation of the most uncertain of the measured offsets (rad).
    """

    offsets: JointOffsets
    made_at: WallTime = 0.0
    views: Count = 0
    pixels: NonNegative = 0.0
    offset_sd: NonNegative = 0.0


#: The most by which pictures may be exposed later than their times tell, or earlier (s).
LARGEST_DELAY: Final = 0.2
Delay = Annotated[float, Meta(ge=-LARGEST_DELAY, le=LARGEST_DELAY)]


class FrameTiming(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Calibration of the camera's clock.

    Attributes:
        delay: By how much pictures are exposed later than their times tell (s).
        made_at: Time of the calibration.
        views: Number of pictures in motion that it is from.
        delay_sd: Standard deviation of the delay (s).
    """

    delay: Delay
    made_at: WallTime = 0.0
    views: Count = 0
    delay_sd: NonNegative = 0.0


#: A calibration of the robot itself, which the bridge uses.
AnyCalibration = BaseCalibration | ArmCalibration | FrameTiming


class UseCalibration(Message, frozen=True, kw_only=True):
    """Controller → bridge: use a calibration from now on, and after a restart. It moves nothing.

    Attributes:
        user: Who wants it.
        base: Of the base; None if it is of something else.
        arm: Of the arm; None if it is of something else.
        timing: Of the camera's clock; None if it is of something else.
    """

    user: Text
    base: BaseCalibration | None = None
    arm: ArmCalibration | None = None
    timing: FrameTiming | None = None


class BridgeState(Message, frozen=True, kw_only=True):
    """Bridge → all: stop latch, watchdog and cutter of the bridge. The controller can override none of them.

    Attributes:
        header: Time of the state.
        kind: `sim`, `real`, or `fakes` (the drivers of the real robot on fake devices).
        epoch: Epoch of the newest token; 0 before the first.
        holder: First 16 hexadecimal digits of the SHA-256 of the token's random part; empty without a holder.
        sequence: `sequence` of the motion command that the robot follows, or followed last.
        moving: Whether any actuator is sent a velocity other than zero.
        watchdog: True while no valid setpoint has arrived within the deadline: base 0, arm holds, cutter inhibited.
        stop_id: The latched software stop; empty without one.
        stopped_by: Who stopped and why; None without a stop.
        cutter: State of the blades.
        cut_id: The last requested cut; empty before the first.
        outcome: Outcome of that cut; empty during the cut.
        real_time_factor: Simulated time per real time; 1 on a real robot.
        round_trip_s: Time from a joint state to the command that answers it, median of the last second (s); 0 without
            commands.
        round_trip_worst_s: The longest of them (s).
        rejections: Messages refused since the start, by reason.
        battery: Charge of the base, 0 … 1; None if unknown, as in simulation.
        arm_success: Fraction of the arm's last 100 commands that arrived in time; None if unknown, as in simulation.
        relaxed_limits: Safety limits that its configuration sets less strictly than usual, within their hard bounds.
        base: Calibration of the wheels in use; None while they are taken to be as drawn.
        arm: Calibration of the joints' zeros in use; None while they are taken to be as drawn.
        timing: Calibration of the camera's clock in use; None while its delay is as configured.
        calibration_warnings: Which of these calibrations are old.
    """

    header: Header
    kind: BridgeKind
    epoch: Epoch
    watchdog: bool
    stop_id: Annotated[str, Meta(max_length=64)]
    stopped_by: Reason | None
    cutter: Literal["open", "closing", "opening", "jammed"]
    cut_id: Annotated[str, Meta(max_length=64)]
    outcome: Outcome
    real_time_factor: NonNegative
    round_trip_s: NonNegative = 0.0
    round_trip_worst_s: NonNegative = 0.0
    rejections: tuple[RejectionCount, ...] = ()
    battery: Fraction | None = None
    arm_success: Fraction | None = None
    relaxed_limits: tuple[Reason, ...] = ()
    holder: Annotated[str, Meta(max_length=16)] = ""
    sequence: Count = 0
    moving: bool = False
    base: BaseCalibration | None = None
    arm: ArmCalibration | None = None
    timing: FrameTiming | None = None
    calibration_warnings: tuple[Reason, ...] = ()


class ReleaseStop(Message, frozen=True, kw_only=True):
    """Controller → bridge: release a latched stop. It moves nothing.

    Attributes:
        stop_id: The latched stop; any other id is refused.
        user: Who resets it.
        reason: Reason for the reset, as text.
    """

    stop_id: Name
    user: Text
    reason: Annotated[str, Meta(min_length=1, max_length=500)]


class Intrinsics(Struct, frozen=True, forbid_unknown_fields=True):
    """Pinhole camera model.

    Attributes:
        width: Columns of the image (px).
        height: Rows of the image (px).
        fx: Focal length along a row (px).
        fy: Focal length along a column (px).
        cx: Column of the principal point (px).
        cy: Row of the principal point (px).
    """

    width: Annotated[int, Meta(ge=1, le=4096)]
    height: Annotated[int, Meta(ge=1, le=4096)]
    fx: NonNegative
    fy: NonNegative
    cx: Finite
    cy: Finite


class CameraFrame(Message, frozen=True, kw_only=True):
    """Bridge → perception and server: one RGB-D frame with the robot's measured posture at exposure.

    Attributes:
        header: `frame_id` is camera: z forward, x right, y down.
        sequence: Strictly increasing.
        intrinsics: Camera model of all images in the frame.
        base: Measured pose of base_link in odom at exposure.
        position: Measured actuated coordinates at exposure (rad).
        color_jpeg: H×W×3, JPEG.
        depth_zlib: H×W uint16 little-endian, row-major, zlib; in units of `depth_unit`; 0 = no return.
        depth_unit: Depth of one count (m).
        labels_zlib: H×W uint8 class indices (`WOOD_CLASSES`), zlib. Empty without a label camera (a real robot).
        point_id: Point of the requested close-up; empty in other frames.
        number: `number` of the close-up request.
        wheels: Sizes of the wheels by which `base` and the wheels' `position` were computed: left and right radius and
            track (m). None for those drawn.
        joint_offsets: Offsets of the arm's joints that were taken from what its encoders told (rad).
        velocity: Measured actuated velocities at exposure (rad/s); None in recordings of earlier versions.
        attitude: How the base stood on the ground at exposure; None without inertial sensors.
        delay: By how much the bridge took the picture to be exposed later than its time tells (s).
    """

    header: Header
    sequence: Count
    intrinsics: Intrinsics
    base: PlanarPose
    position: Actuated
    color_jpeg: bytes
    depth_zlib: bytes
    depth_unit: Annotated[float, Meta(gt=0.0, le=0.01)]
    labels_zlib: bytes = b""
    point_id: Annotated[str, Meta(max_length=64)] = ""
    number: Count = 0
    wheels: tuple[Radius, Radius, Track] | None = None
    joint_offsets: JointOffsets = NO_OFFSETS
    velocity: ActuatedVelocity | None = None
    attitude: BaseAttitude | None = None
    delay: Delay = 0.0
