"""Bodies of the REST requests: strict, bounded, no unknown field, no NaN."""

import json
from typing import Annotated, Any, Literal

from fastapi import Path
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, field_validator, model_validator

from rolling_panda.messages.commands import SURE
from rolling_panda.messages.types import Role

#: As `rolling_panda.messages.Name`.
POINT_ID: Any = Path(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_.:\-]+$")
#: Leaves room for who stopped the robot in a log line of 500 characters.
STOP_REASON_LENGTH = 400
#: Whole numbers above it are not exact in every JSON reader.
_MOST = 2**53
_Text = Annotated[str, Field(max_length=500)]
_Metre = Annotated[float, Field(ge=-1e4, le=1e4)]
_Unit = Annotated[float, Field(ge=-1.001, le=1.001)]


def _as_whole(value: Any) -> Any:
    # JSON knows one kind of number: 2.0 is a whole one too.
    return int(value) if isinstance(value, float) and value.is_integer() else value


_WHOLE = BeforeValidator(_as_whole)


class _Body(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)


class _JsonTuples(_Body):
    """JSON has no tuples, so these fields take lists of the same length."""

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


class SignInWay(BaseModel):
    """How people sign in to this server: with a password, or with a link that works once."""

    password: bool


class AcceptPoint(_Body):
    """The revision that the operator saw; an older one is refused. With the point's hash another content is too."""

    revision: Annotated[int, Field(ge=0, le=_MOST), _WHOLE]
    digest: Annotated[str, Field(max_length=64, pattern=r"^[0-9a-f]*$")] = ""


class RejectPoint(_Body):
    """Why."""

    reason: _Text = ""


class ResolvePoint(_Body):
    """How an UNKNOWN cut ended, and how that was found out."""

    outcome: Literal["DONE", "FAILED_NOT_CUT"]
    reason: Annotated[str, Field(min_length=1, max_length=400)]


class Survey(_Body):
    """How far ahead along the row (m)."""

    distance: Annotated[float, Field(ge=0.1, le=500.0)] = 4.0


class MoveInQueue(_Body):
    """Before which point; empty for the end. With the revision of the order that was seen, from `GET /api/state`."""

    before: Annotated[str, Field(max_length=64)] = ""
    revision: Annotated[int, Field(ge=0, le=_MOST), _WHOLE]


class TurnApproach(_Body):
    """Turn of the approach about the cane (rad); null leaves it to the search."""

    azimuth: Annotated[float, Field(ge=-3.2, le=3.2)] | None = None


class PlannersOrder(_Body):
    """The revision of the order that was seen."""

    revision: Annotated[int, Field(ge=0, le=_MOST), _WHOLE]


class Place(_Body):
    """A place that was left open."""

    vine: Annotated[int, Field(ge=1, le=100000), _WHOLE]
    spur: Annotated[int, Field(ge=0, le=100000), _WHOLE]


class AskPreview(_Body):
    """Of which point alone; empty for all accepted ones in their order."""

    point_id: Annotated[str, Field(max_length=64)] = ""


class ApprovePreview(_Body):
    """The hash of the preview that was looked at."""

    preview_hash: Annotated[str, Field(max_length=64, pattern=r"^[0-9a-f]*$")]


class RequirePreview(_Body):
    """Whether a cut begins only with its preview approved."""

    required: bool


class AcceptAll(_Body):
    """Least confidence, 0…1; what is below it waits to be decided one by one."""

    confidence: Annotated[float, Field(ge=0.0, le=1.0)] = SURE


class Stop(_Body):
    """Why, for the log. The stop never fails over it: what is too long is cut, what cannot be read is left out."""

    reason: str = "software stop"

    @classmethod
    def read(cls, content: bytes) -> "Stop":
        """The stop that a body asks for, whatever it holds."""
        try:
            told = json.loads(content)["reason"]
        except (ValueError, RecursionError, LookupError, TypeError):
            return cls()
        # A lone surrogate is JSON, but no text that could be sent on.
        text = told.encode(errors="replace").decode() if isinstance(told, str) else ""
        return cls(reason=text[:STOP_REASON_LENGTH]) if text else cls()


class TakeControl(_Body):
    """`confirm` that control is to be taken from who holds it."""

    confirm: bool = False


class Reset(_Body):
    """Why it is safe again; with `stop_id`, a stop that was pressed after that one is not reset with it."""

    reason: Annotated[str, Field(min_length=1, max_length=500)]
    stop_id: Annotated[str, Field(max_length=64)] = ""


class Target(_JsonTuples):
    """T_odom_tool: position in m and unit quaternion x, y, z, w."""

    position: tuple[_Metre, _Metre, _Metre]
    quat_xyzw: tuple[_Unit, _Unit, _Unit, _Unit]

    @property
    def refused(self) -> str:
        """Why this is no place for the tool; empty when it is. No description of a request can say so much."""
        length = sum(part * part for part in self.quat_xyzw) ** 0.5
        return "" if abs(length - 1.0) <= 1e-2 else f"a quaternion has length 1, this one has {length:.3f}"


class BaseVelocity(_Body):
    """Forward velocity (m/s) and yaw rate (rad/s)."""

    linear: Annotated[float, Field(ge=-2.0, le=2.0)]
    angular: Annotated[float, Field(ge=-4.0, le=4.0)]


_JointVelocity = Annotated[float, Field(ge=-10.0, le=10.0)]


class Teleop(_JsonTuples):
    """Hold, and what for; with none of the three the last demand stays.

    `target`: the tool goes there; its quaternion has length 1. With `base` too: the tool keeps to it while the base
    moves. `base` alone: the base drives, the arm stands. `joints` alone (rad/s): joints turn, the base stands. All at
    `share` of the usual speed.
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
    share: Annotated[float, Field(ge=0.05, le=1.0)] = 1.0
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
    """Who is invited."""

    user: Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9_.\- ]+$")]
    role: Role


class Outcome(BaseModel):
    """Done or not, and the reason in words."""

    ok: bool
    reason: str


class Invited(Outcome):
    """Done, and the link to hand on."""

    link: str


class Me(BaseModel):
    """Who is signed in."""

    user: str
    role: Role


class Rule(_Body):
    """The numbers of the pruning rule; what is left out takes its usual value. Lengths in metres."""

    system: Literal["spur", "guyot"] = "spur"
    nodes_kept: Annotated[int, Field(ge=1, le=5), _WHOLE] = 2
    fruiting_nodes: Annotated[int, Field(ge=3, le=20), _WHOLE] = 8
    keeper_diameter: Annotated[float, Field(ge=0.003, le=0.015)] = 0.006
    offset: Annotated[float, Field(ge=0.005, le=0.05)] = 0.020


class RuleOutcome(Outcome):
    """How many points would be cut elsewhere or otherwise, go, or come, and how many acceptances would be void."""

    moved: int = 0
    gone: int = 0
    added: int = 0
    voided: int = 0


class Move(_Body):
    """So far along the cane (m): away from the cordon, or towards it where negative."""

    along: Annotated[float, Field(ge=-0.1, le=0.1)]


class Seek(_Body):
    """Where a recording goes on (s from its beginning; where it is when left out), or stands still."""

    position_s: Annotated[float, Field(ge=0.0, le=1e9)] | None = None
    playing: bool = True


class Ray(_JsonTuples):
    """A line of sight in odom (m): the point goes on the known cane that it passes nearest."""

    origin: tuple[_Metre, _Metre, _Metre]
    direction: tuple[_Unit, _Unit, _Unit]


class Pixel(_Body):
    """A place in a camera image, as shares of its width and height; `sequence` is that of the frame."""

    sequence: Annotated[int, Field(ge=0, le=_MOST), _WHOLE]
    u: Annotated[float, Field(ge=0.0, le=1.0)]
    v: Annotated[float, Field(ge=0.0, le=1.0)]
