"""Types that the messages share: bounded numbers, names, headers and poses."""

from typing import Annotated, Final, Literal, get_args

from msgspec import Meta, Struct

SCHEMA_VERSION = 2
Finite = Annotated[float, Meta(ge=-1e9, le=1e9)]
Metre = Annotated[float, Meta(ge=-1e4, le=1e4)]
Unit = Annotated[float, Meta(ge=-1.001, le=1.001)]
NonNegative = Annotated[float, Meta(ge=0.0, le=1e9)]
Fraction = Annotated[float, Meta(ge=0.0, le=1.0)]
Angle = Annotated[float, Meta(ge=-1e6, le=1e6)]
Speed = Annotated[float, Meta(ge=-100.0, le=100.0)]
Count = Annotated[int, Meta(ge=0, le=2**62)]
#: Grows by one with each fencing token that the bridge gives out: at one a second this lasts for 30 years.
MOST_EPOCHS: Final = 10**9
Epoch = Annotated[int, Meta(ge=0, le=MOST_EPOCHS)]
#: Without the last part of the pattern a newline at the end would pass: "$" also matches before it.
Name = Annotated[str, Meta(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_.:\-]+(?!\n)$")]
Text = Annotated[str, Meta(max_length=500)]
Vector3 = tuple[Metre, Metre, Metre]
UnitVector3 = tuple[Unit, Unit, Unit]
QuatXyzw = tuple[Unit, Unit, Unit, Unit]
ArmVector = tuple[Angle, Angle, Angle, Angle, Angle, Angle, Angle]
#: θ_l, θ_r, q₁…q₇ (rad): the actuated coordinates ξ.
Actuated = tuple[Angle, Angle, Angle, Angle, Angle, Angle, Angle, Angle, Angle]
#: Velocities of ξ (rad/s).
ActuatedVelocity = tuple[Speed, Speed, Speed, Speed, Speed, Speed, Speed, Speed, Speed]
Role = Literal["viewer", "operator", "supervisor"]
Process = Literal["bridge", "controller", "perception", "server"]
PROCESSES: tuple[Process, ...] = ("bridge", "controller", "perception", "server")
Mode = Literal["IDLE", "READY", "TELEOP", "AUTO", "PAUSED", "PROTECTIVE_STOP", "FAULT", "ESTOP_LATCHED"]
#: What a pause or a protective stop has ended, and nobody has begun again.
Interrupted = Literal["", "work", "survey", "teleoperation"]
Phase = Literal["", "APPROACH", "CLOSE_UP", "ADVANCE", "CUT", "RETREAT", "SURVEY"]
#: UNREACHABLE: accepted by somebody, refused by the plan that holds; ACCEPTED again once a plan can reach it.
PointState = Literal["PROPOSED", "ACCEPTED", "UNREACHABLE", "CUTTING", "DONE", "FAILED_NOT_CUT", "UNKNOWN", "REJECTED"]
Severity = Literal["info", "warning", "error"]
Outcome = Literal["", "DONE", "FAILED_NOT_CUT", "UNKNOWN"]
Need = Literal["another look", "operator"]
WoodClass = Literal[
    "background", "ground", "post", "trunk", "cordon", "spur", "cane", "node", "wire", "hose", "old cut"
]
#: Index = value in a label image.
WOOD_CLASSES: tuple[WoodClass, ...] = get_args(WoodClass)
BridgeKind = Literal["sim", "real", "fakes"]
CutKind = Literal["spur cut", "renewal cut", "cane cut", "by hand"]
Digest = Annotated[str, Meta(max_length=64, pattern=r"^[0-9a-f]*(?!\n)$")]
Covariance = tuple[Finite, Finite, Finite, Finite, Finite, Finite]


class Message(Struct, frozen=True, kw_only=True, tag=True, forbid_unknown_fields=True):
    """Root of the wire messages: a map with a `type` tag; unknown fields are refused."""


class Header(Struct, frozen=True, forbid_unknown_fields=True):
    """Who measured when: `stamp` is the sender's monotonic clock (s), for differences only, in frame `frame_id`."""

    stamp: Finite = 0.0
    frame_id: Annotated[str, Meta(max_length=64)] = ""


class Pose(Struct, frozen=True, forbid_unknown_fields=True):
    """A rigid placement: `position` (m) and `quat_xyzw` (unit) of a child frame in the frame that the owner names."""

    position: Vector3
    quat_xyzw: QuatXyzw


class PlanarPose(Struct, frozen=True, forbid_unknown_fields=True):
    """The base on the ground: `x`, `y` (m) and heading `phi` (rad) of base_link in odom."""

    x: Metre = 0.0
    y: Metre = 0.0
    phi: Angle = 0.0


class Heartbeat(Message, frozen=True, kw_only=True):
    """A process's loop is turning: `sequence` grows with each turn, not with each send."""

    process: Process
    sequence: Count
    status: Text = ""


class LogEvent(Message, frozen=True, kw_only=True):
    """Something a person should be able to read later: what happened, or why something was refused."""

    header: Header
    process: Process
    severity: Severity
    text: Text


class RuleEffect(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What another pruning rule would make of the points that are shown: nothing has changed yet.

    Attributes:
        changed: Points whose cut would be at another place, of another kind, or with other nodes kept.
        removed: Points that it would not ask for.
        added: How many others it would ask for.
    """

    changed: tuple[Name, ...] = ()
    removed: tuple[Name, ...] = ()
    added: Count = 0


class Answer(Message, frozen=True, kw_only=True):
    """Reply of every service: done or not, and the reason in words; with the effect, where that was the question."""

    ok: bool
    reason: Text = ""
    effect: RuleEffect | None = None
