"""Shared types of the messages: bounded numbers, names, headers and poses."""

from typing import Annotated, Final, Literal, get_args

from msgspec import Meta, Struct

SCHEMA_VERSION = 3
Finite = Annotated[float, Meta(ge=-1e9, le=1e9)]
Metre = Annotated[float, Meta(ge=-1e4, le=1e4)]
Unit = Annotated[float, Meta(ge=-1.001, le=1.001)]
NonNegative = Annotated[float, Meta(ge=0.0, le=1e9)]
Fraction = Annotated[float, Meta(ge=0.0, le=1.0)]
Angle = Annotated[float, Meta(ge=-1e6, le=1e6)]
#: A base that stood more steeply would fall over (rad).
MOST_TILT: Final = 0.5
Tilt = Annotated[float, Meta(ge=-MOST_TILT, le=MOST_TILT)]
Speed = Annotated[float, Meta(ge=-100.0, le=100.0)]
Count = Annotated[int, Meta(ge=0, le=2**62)]
#: The epoch increases by one with each fencing token that the bridge issues. At one a second this lasts for 30 years.
MOST_EPOCHS: Final = 10**9
Epoch = Annotated[int, Meta(ge=0, le=MOST_EPOCHS)]
#: Without the last part of the pattern a newline at the end would pass: "$" also matches before it.
Name = Annotated[str, Meta(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_.:\-]+(?!\n)$")]
Text = Annotated[str, Meta(max_length=500)]
Vector3 = tuple[Metre, Metre, Metre]
UnitVector3 = tuple[Unit, Unit, Unit]
QuatXyzw = tuple[Unit, Unit, Unit, Unit]
#: θ_l, θ_r, q₁…q₇ (rad): the actuated coordinates ξ.
Actuated = tuple[Angle, Angle, Angle, Angle, Angle, Angle, Angle, Angle, Angle]
#: Velocities of ξ (rad/s).
ActuatedVelocity = tuple[Speed, Speed, Speed, Speed, Speed, Speed, Speed, Speed, Speed]
Torque = Annotated[float, Meta(ge=-1000.0, le=1000.0)]
#: Torques of q₁…q₇ (N·m).
ArmTorques = tuple[Torque, Torque, Torque, Torque, Torque, Torque, Torque]
#: Wall clock, seconds since 1970.
WallTime = Annotated[float, Meta(ge=0.0, le=1e11)]
Role = Literal["viewer", "operator", "supervisor"]
Process = Literal["bridge", "controller", "perception", "server"]
PROCESSES: tuple[Process, ...] = ("bridge", "controller", "perception", "server")
Mode = Literal["IDLE", "READY", "TELEOP", "AUTO", "PAUSED", "PROTECTIVE_STOP", "FAULT", "ESTOP_LATCHED"]
#: Activity that a pause or a protective stop has interrupted and that nobody has resumed.
Interrupted = Literal["", "work", "survey", "teleoperation"]
Phase = Literal["", "APPROACH", "CLOSE_UP", "ADVANCE", "CUT", "RETREAT", "SURVEY", "CALIBRATION"]
#: UNREACHABLE: accepted, but refused by the current plan; ACCEPTED again once a plan reaches it.
PointState = Literal["PROPOSED", "ACCEPTED", "UNREACHABLE", "CUTTING", "DONE", "FAILED_NOT_CUT", "UNKNOWN", "REJECTED"]
Severity = Literal["info", "warning", "error"]
Outcome = Literal["", "DONE", "FAILED_NOT_CUT", "UNKNOWN"]
Need = Literal["another look", "operator", "nothing"]
WoodClass = Literal[
    "background", "ground", "post", "trunk", "cordon", "spur", "cane", "node", "wire", "hose", "old cut"
]
#: Index = value in a label image.
WOOD_CLASSES: tuple[WoodClass, ...] = get_args(WoodClass)
BridgeKind = Literal["sim", "real", "fakes"]
CutKind = Literal["spur cut", "renewal cut", "cane cut", "removal", "by hand"]
Digest = Annotated[str, Meta(max_length=64, pattern=r"^[0-9a-f]*(?!\n)$")]
Covariance = tuple[Finite, Finite, Finite, Finite, Finite, Finite]


class Message(Struct, frozen=True, kw_only=True, tag=True, forbid_unknown_fields=True):
    """Base of the wire messages: a map with a `type` tag; unknown fields are refused."""


class Header(Struct, frozen=True, forbid_unknown_fields=True):
    """Time and frame of a message.

    Attributes:
        stamp: The sender's monotonic clock (s), for differences only.
        frame_id: Frame of the poses and positions in the message.
    """

    stamp: Finite = 0.0
    frame_id: Annotated[str, Meta(max_length=64)] = ""


class Pose(Struct, frozen=True, forbid_unknown_fields=True):
    """Pose of a frame in another frame; the field that contains it names both.

    Attributes:
        position: Origin (m).
        quat_xyzw: Rotation, unit quaternion x, y, z, w.
    """

    position: Vector3
    quat_xyzw: QuatXyzw


class PlanarPose(Struct, frozen=True, forbid_unknown_fields=True):
    """Pose of base_link on the ground plane; the field that contains it names the frame.

    Attributes:
        x: Forward (m).
        y: Left (m).
        phi: Heading, counter-clockwise from x (rad).
    """

    x: Metre = 0.0
    y: Metre = 0.0
    phi: Angle = 0.0


class BaseAttitude(Struct, frozen=True, forbid_unknown_fields=True):
    """How base_link stands on uneven ground, beyond its pose on the plane: T_odom_base = plane pose · attitude.

    The plane is that of the ground where the robot was switched on. Signs are those of REP-103. The poses that the
    controller tells of the tool are of a base that stands level.

    Attributes:
        height: Above the plane (m).
        roll: About the x axis, left side up (rad).
        pitch: About the y axis, nose down (rad).
        measured: Whether the sensors tell it now; else it is what it was, and the heading is that of the wheels.
    """

    height: Metre = 0.0
    roll: Tilt = 0.0
    pitch: Tilt = 0.0
    measured: bool = True


class Heartbeat(Message, frozen=True, kw_only=True):
    """The loop of a process runs.

    Attributes:
        process: The sender.
        sequence: Number of loop iterations. It stops growing when the loop hangs, even if sending continues.
    """

    process: Process
    sequence: Count


class Program(Message, frozen=True, kw_only=True):
    """The program that a process runs.

    Attributes:
        process: The sender.
        version: Version of Rolling Panda.
        began_at: Start of the process (s since 1970).
    """

    process: Process
    version: Annotated[str, Meta(max_length=64)]
    began_at: WallTime


class LogEvent(Message, frozen=True, kw_only=True):
    """A line of the log: an event, or a refusal with its reason.

    Attributes:
        header: Time of the event.
        process: The sender.
        reason: What has happened; the catalogue has its severity and its text.
    """

    header: Header
    process: Process
    reason: "Reason"


class RuleEffect(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Effect that another pruning rule would have on the current points. Nothing has changed yet.

    Attributes:
        changed: Points whose cut would get another place, kind or number of kept nodes.
        removed: Points that would go.
        added: Number of points that would be new.
    """

    changed: tuple[Name, ...] = ()
    removed: tuple[Name, ...] = ()
    added: Count = 0


class Reason(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A reason as data; `rolling_panda/reasons.py` has the text of each code.

    Attributes:
        code: The code.
        values: Name and value of each value in the text. A value that is a reason is the cause of this one.
    """

    code: Name
    values: "tuple[tuple[Name, Text | Finite | Reason], ...]" = ()


class Answer(Message, frozen=True, kw_only=True):
    """Reply of every service.

    Attributes:
        ok: Whether the request was executed.
        reason: Reason of a refusal, or what was done; None where there is nothing to tell.
        effect: Answer to `EvaluateRule`.
    """

    ok: bool
    reason: Reason | None = None
    effect: RuleEffect | None = None
