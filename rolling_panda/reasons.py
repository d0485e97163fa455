"""Catalogue of reasons: the code of each with its values, its severity, its English text and what to do.

A reason is made by calling its function, so that the type checker compares the values. The docstring is the text.
"""

from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature
from string import Formatter
from typing import Any, Final, Literal, ParamSpec

from rolling_panda.errors import MessageError
from rolling_panda.messages.types import Reason

P = ParamSpec("P")
Severity = Literal["info", "warning", "error"]


@dataclass(frozen=True)
class Entry:
    """An entry of the catalogue.

    Attributes:
        code: The code, which never changes its meaning.
        severity: Severity.
        text: English text, with the values' names in braces.
        act: What to do, in English.
    """

    code: str
    severity: Severity
    text: str
    act: str


#: All entries, by their codes.
CATALOGUE: Final[dict[str, Entry]] = {}


def text_of(reason: Reason) -> str:
    """English text of a reason, with what to do. A code that this version does not know is shown with its values."""
    entry = CATALOGUE.get(reason.code)
    values = {name: text_of(value) if isinstance(value, Reason) else value for name, value in reason.values}
    try:
        told = "" if entry is None else entry.text.format(**values)
    except (LookupError, TypeError, ValueError):
        entry = None
    if entry is None:
        return f"{reason.code} {values or ''}".strip()[:500]
    return (f"{told}: {entry.act}" if entry.act else told)[:500]


def entry_of(severity: Severity, act: str, made: Callable[P, None]) -> tuple[Entry, Callable[P, Reason]]:
    """The entry that a function describes, and the function that makes its reasons.

    Raises:
        MessageError: The text does not name exactly the parameters.
    """
    code, text = made.__name__, (made.__doc__ or "").strip().removesuffix(".")
    parameters = tuple(signature(made).parameters)
    named = {name for _, name, _, _ in Formatter().parse(text) if name is not None}
    if not text or named != set(parameters):
        raise MessageError(f"reason {code}: its text names {sorted(named)}, its parameters are {[*parameters]}")

    def make(*args: P.args, **kwargs: P.kwargs) -> Reason:
        # It fails where the arguments are not the parameters.
        made(*args, **kwargs)
        values: dict[str, Any] = dict(zip(parameters, args, strict=False)) | kwargs
        return Reason(code=code, values=tuple((name, _bounded(values[name])) for name in parameters))

    return Entry(code, severity, text, act), make


def _bounded(value: str | float | Reason) -> str | float | Reason:
    """The value within the bounds of the wire, which refuses a whole message for one value out of them."""
    if isinstance(value, Reason):
        return value
    return value[:500] if isinstance(value, str) else max(-1e9, min(1e9, value))


def _reason(severity: Severity, act: str) -> Callable[[Callable[P, None]], Callable[P, Reason]]:
    def enter(made: Callable[P, None]) -> Callable[P, Reason]:
        entry, make = entry_of(severity, act, made)
        CATALOGUE[entry.code] = entry
        return make

    return enter


@_reason("info", "")
def said(text: str) -> None:
    """{text}."""


# Control and roles


@_reason("warning", "sign in as an operator or a supervisor")
def viewer_only() -> None:
    """A viewer may look and stop, not operate."""


@_reason("warning", "sign in as an operator or a supervisor")
def operator_needed() -> None:
    """This needs the role operator or supervisor."""


@_reason("warning", "change the mode first")
def wrong_mode(command: str, modes: str, mode: str) -> None:
    """{command} is possible in {modes}; the mode is {mode}."""


@_reason("warning", "wait until it accepts commands")
def watchdog_holds() -> None:
    """The bridge's watchdog holds the robot."""


@_reason("warning", "ask for it, or take it")
def control_held(user: str) -> None:
    """{user} holds control of this robot."""


@_reason("warning", "wait until the robot is at rest")
def control_passes(user: str) -> None:
    """Control passes to {user}."""


@_reason("warning", "wait, then ask them for it")
def control_being_taken(user: str) -> None:
    """{user} is taking control already."""


@_reason("warning", "confirm to take it from them; the robot stops first")
def control_unconfirmed(user: str) -> None:
    """{user} holds control."""


@_reason("warning", "take it")
def control_free() -> None:
    """Nobody holds control."""


@_reason("info", "go on")
def control_yours() -> None:
    """You hold control already."""


@_reason("warning", "wait for the answer to their request")
def control_requested(user: str) -> None:
    """{user} has asked for control already."""


@_reason("warning", "ask the person in control")
def control_not_yours() -> None:
    """You do not hold control."""


@_reason("warning", "wait until somebody asks")
def control_not_requested() -> None:
    """Nobody asks for control."""
