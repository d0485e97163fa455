"""What the robot is told and what it tells: motion, cuts, stops, joints, odometry, camera frames."""

import hashlib
from typing import Annotated, Literal

from msgspec import Meta, Struct

from rolling_panda.messages.types import (
    Actuated,
    ActuatedVelocity,
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
    Speed,
    Text,
)


class TokenRequest(Message, frozen=True, kw_only=True):
    """Controller → bridge: give me the fencing token, let me keep it, or take it back.

    Repeated by the holder of the token too. Nobody else is given one before the holder releases it, or is silent for a
    second; `BridgeState` says whose it is, and under which epoch.

    Attributes:
        token: Random part of the token, drawn by who asks and told to nobody but the bridge.
        echo: `sequence` of the newest `JointState`; judged as that of a motion command.
        mode: Of the controller that asks; of no account where it releases the token.
        releases: The controller gives its token up: the next one who asks is given one.
    """

    token: Annotated[str, Meta(min_length=1, max_length=32)]
    echo: Count = 0
    mode: Mode = "IDLE"
    releases: bool = False


def fingerprint(token: str) -> str:
    """What may be told of a token: who has drawn it knows it again, and nobody else can use it."""
    return hashlib.sha256(token.encode()).hexdigest()[:16]


class MotionCommand(Message, frozen=True, kw_only=True):
    """Controller → bridge: the velocity of every actuator, newest wins.

    Attributes:
        epoch: Of the token, as the bridge has given it out; any other one is refused.
        sequence: Strictly increasing within an epoch.
        echo: `sequence` of the newest `JointState` the command was computed from. The bridge knows when it sent that
            state, so it judges the command's age on its own clock.
        xi: [θ̇_l, θ̇_r, q̇₁…q̇₇] in rad/s.
        token: Random part of the token; any other one is refused.
    """

    epoch: Epoch
    sequence: Count
    echo: Count
    xi: ActuatedVelocity
    token: Annotated[str, Meta(max_length=32)] = ""


class CutCommand(Message, frozen=True, kw_only=True):
    """Controller → bridge: close the blades once. Repeated until seen; the bridge acts on a `cut_id` once.

    `epoch`, `token` and `echo` are judged as those of a motion command, and the robot has to be at rest.
    """

    epoch: Epoch
    cut_id: Name
    point_id: Name
    echo: Count = 0
    token: Annotated[str, Meta(max_length=32)] = ""


class StopRequest(Message, frozen=True, kw_only=True):
    """Anyone → bridge and controller: the software stop, latched by both. Sent several times with one `stop_id`."""

    stop_id: Name
    source: Name
    user: Text
    reason: Text


class JointState(Message, frozen=True, kw_only=True):
    """Bridge → all: measured actuated coordinates, [θ_l, θ_r, q₁…q₇] (rad, rad/s), as sensor_msgs/JointState."""

    header: Header
    sequence: Count
    position: Actuated
    velocity: ActuatedVelocity


class Odometry(Message, frozen=True, kw_only=True):
    """Bridge → all: the base from its wheels.

    Attributes:
        header: `frame_id` is odom.
        sequence: Strictly increasing.
        pose: base_link in odom.
        linear: Forward velocity of the axle centre (m/s).
        angular: Yaw rate (rad/s).
    """

    header: Header
    sequence: Count
    pose: PlanarPose
    linear: Speed
    angular: Speed


class RejectionCount(Struct, frozen=True, forbid_unknown_fields=True):
    """How many messages of a topic were refused for one reason."""

    topic: Text
    reason: Text
    count: Count


class BridgeState(Message, frozen=True, kw_only=True):
    """Bridge → all: its own latch, watchdog and cutter; the controller cannot overrule any of them.

    Attributes:
        kind: `sim`, `real`, or `fakes`: the real robot's drivers with fakes in place of the devices.
        epoch: Of the newest token given out; 0 before the first.
        holder: First 16 hexadecimal digits of the SHA-256 of its random part; empty when nobody holds it.
        sequence: Of the command that the robot follows, or followed last.
        moving: Whether what is sent to the actuators is anything but zero.
        watchdog: True while no valid setpoint has come for the deadline: base 0, arm holds, cutter inhibited.
        stop_id: The latched software stop, empty when none.
        stopped_by: User and reason of that stop.
        cutter: What the blades do.
        cut_id: The last cut asked for, empty when none.
        outcome: How that cut ended, empty while it goes on.
        real_time_factor: Simulated seconds a second; 1 on a real robot.
        round_trip_s: From a joint state to the command that answers it, median over the last second; 0 without any.
        round_trip_worst_s: The longest of them.
        rejections: Messages refused since the start, by reason.
        battery: Charge of the base; None where nobody tells, as in the simulation.
        relaxed_limits: Safety limits that its configuration sets less strictly than usual, within their hard bounds.
    """

    header: Header
    kind: BridgeKind
    epoch: Epoch
    watchdog: bool
    stop_id: Annotated[str, Meta(max_length=64)]
    stopped_by: Text
    cutter: Literal["open", "closing", "opening", "jammed"]
    cut_id: Annotated[str, Meta(max_length=64)]
    outcome: Outcome
    real_time_factor: NonNegative
    round_trip_s: NonNegative = 0.0
    round_trip_worst_s: NonNegative = 0.0
    rejections: tuple[RejectionCount, ...] = ()
    battery: Fraction | None = None
    relaxed_limits: tuple[Text, ...] = ()
    holder: Annotated[str, Meta(max_length=16)] = ""
    sequence: Count = 0
    moving: bool = False


class ReleaseStop(Message, frozen=True, kw_only=True):
    """Controller → bridge: release the latched stop `stop_id`. Moves nothing; any other id is refused."""

    stop_id: Name
    user: Text
    reason: Annotated[str, Meta(min_length=1, max_length=500)]


class Intrinsics(Struct, frozen=True, forbid_unknown_fields=True):
    """Pinhole camera: image size (px), focal lengths and principal point (px)."""

    width: Annotated[int, Meta(ge=1, le=4096)]
    height: Annotated[int, Meta(ge=1, le=4096)]
    fx: NonNegative
    fy: NonNegative
    cx: Finite
    cy: Finite


class CameraFrame(Message, frozen=True, kw_only=True):
    """Bridge → perception and server: one RGB-D frame with the robot's measured posture when it was taken.

    Attributes:
        header: `frame_id` is camera: z forward, x right, y down.
        sequence: Strictly increasing.
        intrinsics: Of all images in the frame.
        base: Measured base_link in odom at exposure.
        position: Measured actuated coordinates at exposure (rad).
        color_jpeg: H×W×3, JPEG.
        depth_zlib: H×W uint16 little-endian, row-major, zlib; in units of `depth_unit`; 0 = no return.
        depth_unit: Metres a count.
        labels_zlib: H×W uint8 class indices (`WOOD_CLASSES`), zlib. Empty without a label camera (a real robot).
        point_id: Point of the requested close-up; empty in other pictures.
        number: Of the request.
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
