"""The messages of a step, by type."""

from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")


def every(messages: Iterable[object], kind: type[T]) -> list[T]:
    """The messages of this type, in order."""
    return [message for message in messages if isinstance(message, kind)]


def newest(messages: Iterable[object], kind: type[T]) -> T | None:
    """The last message of this type; None without one."""
    found = every(messages, kind)
    return found[-1] if found else None
