"""Request and response bodies of the REST interface: strict types, bounds, no unknown fields, no NaN."""

import json
from typing import Annotated, Any, Literal

from fastapi import Path
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, field_validator, model_validator

from rolling_panda.messages.commands import SURE
from rolling_panda.messages.types import Role

#: As `rolling_panda.messages.Name`.
POINT_ID: Any = Path(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_.:\-]+$")
#: Leaves room for the user's name in a log line of 500 characters.
STOP_REASON_LENGTH = 400
#: Larger integers are not exact in every JSON parser.
_MAX_INTEGER = 2**53
_Text = Annotated[str, Field(max_length=500)]
_Metre = Annotated[float, Field(ge=-1e4, le=1e4)]
_Unit = Annotated[float, Field(ge=-1.001, le=1.001)]


def _as_integer(value: Any) -> Any:
    # JSON has one kind of number: 2.0 is an integer too.
    return int(value) if isinstance(value, float) and value.is_integer() else value


_INTEGER = BeforeValidator(_as_integer)


class _Body(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)


class _JsonTuples(_Body):
    """JSON has no tuples: these fields take lists of the same length."""

    @field_validator("*", mode="before")
    @classmethod
    def _tuples(cls, value: Any) -> Any:
        return tuple(value) if isinstance(value, list) else value


class SignIn(_Body):
    """Name and password, or the token of a sign-in link."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [
                {
                    "required": ["token"],
                    "properties": {"token": {"type": "string"}, "user": {"type": "null"}, "password": {"type": "null"}},
                },
                {
                    "required": ["user", "password"],
                    "properties": {
                        "token": {"type": "null"},
                        "user": {"type": "string"},
                        "password": {"type": "string"},
                    },
                },
            ]
        }
    )

    token: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    user: Annotated[str, Field(min_length=1, max_length=40)] | None = None
    password: Annotated[str, Field(min_length=1, max_length=200)] | None = None

    @model_validator(mode="after")
    def _is_one_of_both(self) -> "SignIn":
        if (self.token is None) == (self.user is None) or (self.user is None) != (self.password is None):
            raise ValueError("give a token, or user and password")
        return self


class SignInMethod(BaseModel):
    """How to sign in to this server: with a password, or with a single-use link."""

    password: bool


class AcceptPoint(_Body):
    """The revision that the operator saw; an older one is refused. With `digest`, changed content is refused too."""

    revision: Annotated[int, Field(ge=0, le=_MAX_INTEGER), _INTEGER]
    digest: Annotated[str, Field(max_length=64, pattern=r"^[0-9a-f]*$")] = ""


class RejectPoint(_Body):
    """The reason."""

    reason: _Text = ""


class ResolvePoint(_Body):
    """How an UNKNOWN cut ended, and how that was established."""

    outcome: Literal["DONE", "FAILED_NOT_CUT"]
    reason: Annotated[str, Field(min_length=1, max_length=400)]


class Survey(_Body):
    """Distance along the row (m)."""

    distance: Annotated[float, Field(ge=0.1, le=500.0)] = 4.0


class MoveInQueue(_Body):
    """The point to go before; empty for the end. `revision` is that of the order in `GET /api/state`."""

    before: Annotated[str, Field(max_length=64)] = ""
    revision: Annotated[int, Field(ge=0, le=_MAX_INTEGER), _INTEGER]


class SetApproach(_Body):
    """Angle of the approach about the cane (rad); null leaves it to the search."""

    azimuth: Annotated[float, Field(ge=-3.2, le=3.2)] | None = None


class ResetOrder(_Body):
    """The revision of the order in `GET /api/state`."""

    revision: Annotated[int, Field(ge=0, le=_MAX_INTEGER), _INTEGER]


class Place(_Body):
    """A site without a decision."""

    vine: Annotated[int, Field(ge=1, le=100000), _INTEGER]
    spur: Annotated[int, Field(ge=0, le=100000), _INTEGER]


class RequestPreview(_Body):
    """The point to preview; empty for all accepted ones in their order."""

    point_id: Annotated[str, Field(max_length=64)] = ""


class ApprovePreview(_Body):
    """The hash of the preview that the operator saw."""

    preview_hash: Annotated[str, Field(max_length=64, pattern=r"^[0-9a-f]*$")]


class RequirePreview(_Body):
    """Whether each cut needs an approved preview."""

    required: bool


class AcceptAll(_Body):
    """Least confidence, 0…1; points below it stay proposed."""

    confidence: Annotated[float, Field(ge=0.0, le=1.0)] = SURE


class Stop(_Body):
    """The reason, for the log. It cannot fail the stop: it is cut where too long, and ignored where unreadable."""

    reason: str = "software stop"

    @classmethod
    def read(cls, content: bytes) -> "Stop":
        """The stop of a request body, whatever it contains."""
        try:
            reason = json.loads(content)["reason"]
        except (ValueError, RecursionError, LookupError, TypeError):
            return cls()
        # A lone surrogate is valid JSON, but cannot be encoded as UTF-8.
        text = reason.encode(errors="replace").decode() if isinstance(reason, str) else ""
        return cls(reason=text[:STOP_REASON_LENGTH]) if text else cls()


class TakeControl(_Body):
    """`confirm` takes control from its holder."""

    confirm: bool = False


class Reset(_Body):
    """Why it is safe again; with `stop_id`, stops that came after that one stay latched."""

    reason: Annotated[str, Field(min_length=1, max_length=500)]
    stop_id: Annotated[str, Field(max_length=64)] = ""


class Target(_JsonTuples):
    """T_odom_tool: position in m and unit quaternion x, y, z, w."""

    position: tuple[_Metre, _Metre, _Metre]
    quat_xyzw: tuple[_Unit, _Unit, _Unit, _Unit]

    @property
    def refused(self) -> str:
        """Why the quaternion is invalid; empty where it is valid. JSON Schema cannot express this."""
        length = sum(part * part for part in self.quat_xyzw) ** 0.5
        return "" if abs(length - 1.0) <= 1e-2 else f"a quaternion has length 1, this one has {length:.3f}"


class BaseVelocity(_Body):
    """Forward velocity (m/s) and yaw rate (rad/s)."""

    linear: Annotated[float, Field(ge=-2.0, le=2.0)]
    angular: Annotated[float, Field(ge=-4.0, le=4.0)]


_JointVelocity = Annotated[float, Field(ge=-10.0, le=10.0)]


class Teleop(_JsonTuples):
    """Hold the robot to a command; with none of the three the last one stays.

    `target`: the tool goes there; its quaternion has length 1. With `base` too: the tool keeps to it while the base
    moves. `base` alone: the base drives, the arm stands. `joints` alone (rad/s): joints turn, the base stands.
    `speed_scale` scales the speed.
    """

    model_config = ConfigDict(
        json_schema_extra={
            "anyOf": [
                {"properties": {"joints": {"type": "null"}}},
                {"properties": {"target": {"type": "null"}, "base": {"type": "null"}}},
            ]
        }
    )

    hold: bool
    speed_scale: Annotated[float, Field(ge=0.05, le=1.0)] = 1.0
    target: Target | None = None
    base: BaseVelocity | None = None
    joints: (
        tuple[
            _JointVelocity,
            _JointVelocity,
            _JointVelocity,
            _JointVelocity,
            _JointVelocity,
            _JointVelocity,
            _JointVelocity,
        ]
        | None
    ) = None

    @model_validator(mode="after")
    def _fits(self) -> "Teleop":
        if self.joints is not None and (self.target is not None or self.base is not None):
            raise ValueError("joints are turned alone: leave out target and base")
        return self


class Invite(_Body):
    """The invited user."""

    user: Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9_.\- ]+$")]
    role: Role


class Outcome(BaseModel):
    """Success, and a message."""

    ok: bool
    reason: str


class Invited(Outcome):
    """Success, and the sign-in link."""

    link: str


class Me(BaseModel):
    """The signed-in user."""

    user: str
    role: Role


class Rule(_Body):
    """Parameters of the pruning rule; omitted ones take their defaults. Lengths in metres."""

    system: Literal["spur", "guyot"] = "spur"
    nodes_kept: Annotated[int, Field(ge=1, le=5), _INTEGER] = 2
    fruiting_nodes: Annotated[int, Field(ge=3, le=20), _INTEGER] = 8
    preferred_diameter: Annotated[float, Field(ge=0.003, le=0.015)] = 0.006
    offset: Annotated[float, Field(ge=0.005, le=0.05)] = 0.020


class RuleOutcome(Outcome):
    """How many points a rule would move, remove and add, and how many acceptances it would void."""

    changed: int = 0
    removed: int = 0
    added: int = 0
    voided: int = 0


class Move(_Body):
    """Distance along the cane (m), positive away from the cordon."""

    along: Annotated[float, Field(ge=-0.1, le=0.1)]


class Seek(_Body):
    """Position in a recording (s from its start; the present one when omitted), and whether it plays."""

    position_s: Annotated[float, Field(ge=0.0, le=1e9)] | None = None
    playing: bool = True


class Ray(_JsonTuples):
    """A ray in odom (m): the point is placed on the known cane nearest to it."""

    origin: tuple[_Metre, _Metre, _Metre]
    direction: tuple[_Unit, _Unit, _Unit]


class Pixel(_Body):
    """A pixel of a camera image, as fractions of its width and height; `sequence` is that of the frame."""

    sequence: Annotated[int, Field(ge=0, le=_MAX_INTEGER), _INTEGER]
    u: Annotated[float, Field(ge=0.0, le=1.0)]
    v: Annotated[float, Field(ge=0.0, le=1.0)]
