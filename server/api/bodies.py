"""Request and response bodies of the REST interface that are no messages: strict types and bounds, no NaN."""

import json
import re
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from rolling_panda import reasons
from rolling_panda.messages.types import Reason, Role

#: Leaves room for the user's name in a log line of 500 characters.
STOP_REASON_LENGTH = 400
#: Ids that two presses hardly have in common.
_PRESS = re.compile("[0-9a-zA-Z-]{16,64}")
_Metre = Annotated[float, Field(ge=-1e4, le=1e4)]
_Unit = Annotated[float, Field(ge=-1.001, le=1.001)]


class _Body(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)


class JsonTuples(_Body):
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


class Stop(_Body):
    """The reason, for the log, and the id of the press. A repeated request has the same id.

    The stop does not depend on its body: a long reason is truncated, and an unreadable one is ignored.
    """

    reason: str = "software stop"
    press: str = ""

    @classmethod
    def read(cls, content: bytes) -> "Stop":
        """The stop of a request body, whatever it contains."""
        try:
            told = json.loads(content)
        except (ValueError, RecursionError):
            return cls()
        reason, press = (_text(told, name) for name in ("reason", "press"))
        return cls(
            reason=reason[:STOP_REASON_LENGTH] or cls.model_fields["reason"].default,
            press=press if _PRESS.fullmatch(press) else "",
        )


def _text(told: object, name: str) -> str:
    """The text of this name in a body; empty without one."""
    value = told.get(name) if isinstance(told, dict) else None
    # A lone surrogate is valid JSON, but cannot be encoded as UTF-8.
    return value.encode(errors="replace").decode() if isinstance(value, str) else ""


class Target(JsonTuples):
    """T_odom_tool: position in m and unit quaternion x, y, z, w."""

    position: tuple[_Metre, _Metre, _Metre]
    quat_xyzw: tuple[_Unit, _Unit, _Unit, _Unit]

    @property
    def refused(self) -> Reason | None:
        """Why the quaternion is invalid; None where it is valid. JSON Schema cannot express this."""
        length = sum(part * part for part in self.quat_xyzw) ** 0.5
        return None if abs(length - 1.0) <= 1e-2 else reasons.quaternion_not_unit(length)


class BaseVelocity(_Body):
    """Forward velocity (m/s) and yaw rate (rad/s)."""

    linear: Annotated[float, Field(ge=-2.0, le=2.0)]
    angular: Annotated[float, Field(ge=-4.0, le=4.0)]


_JointVelocity = Annotated[float, Field(ge=-10.0, le=10.0)]


class Teleop(JsonTuples):
    """Hold the robot to a target. Without any of the three the last target stays.

    With `target` alone the tool moves there; its quaternion has length 1. With `base` too the tool stays there while
    the base moves. With `base` alone the base moves and the arm rests. With `joints` alone (rad/s) the base rests.
    `speed_scale` is the fraction of the usual speed.
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
    """Success, and why it was refused or what was done: as text, and as a code of the catalogue with its values.

    A value that is an object is the cause, with its own code and values. Without a reason there is no code.
    """

    ok: bool
    reason: str
    code: str = ""
    values: dict[str, str | float | dict[str, Any]] = {}


class Invited(Outcome):
    """Success, the sign-in link, and the rows of its QR code, of which 1 is a dark module."""

    link: str
    qr: list[str]


class Me(BaseModel):
    """The signed-in user."""

    user: str
    role: Role


class RuleOutcome(Outcome):
    """Numbers of points that a rule would move, remove and add, and of acceptances that it would void."""

    changed: int = 0
    removed: int = 0
    added: int = 0
    voided: int = 0
