"""The message definitions as data: names, fields, bounds and docstrings."""

import inspect
import re
from collections.abc import Iterable
from dataclasses import dataclass
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

import msgspec

from rolling_panda import messages
from rolling_panda.messages import page

_ATTRIBUTE = re.compile(r"^ {4}(\w+): (.*)$")


@dataclass(frozen=True)
class FieldDescription:
    """One field: its `hint` is the Python annotation, with bounds; `about` is from the docstring."""

    name: str
    hint: Any
    required: bool
    default: Any
    about: str


@dataclass(frozen=True)
class StructDescription:
    """One message or part of a message; `tag` is the value of its `type` field, None without one."""

    name: str
    tag: str | None
    about: str
    fields: tuple[FieldDescription, ...]


def describe(struct: type[msgspec.Struct]) -> StructDescription:
    """Fields of a struct in order, with its docstring."""
    about, attributes = _docstring(struct)
    fields = tuple(
        FieldDescription(
            name=field.encode_name,
            hint=field.type,
            required=field.required,
            default=None if field.required else field.default,
            about=attributes.get(field.name, ""),
        )
        for field in msgspec.structs.fields(struct)
    )
    tag = struct.__struct_config__.tag
    return StructDescription(struct.__name__, None if tag is None else str(tag), about, fields)


def reachable(roots: Iterable[type[msgspec.Struct]]) -> tuple[type[msgspec.Struct], ...]:
    """The roots and every struct they contain, parts before the wholes, each once."""
    found: dict[type[msgspec.Struct], None] = {}
    begun: set[type[msgspec.Struct]] = set()

    def visit(hint: Any) -> None:
        if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
            # A struct may contain others of its type.
            if hint not in begun:
                begun.add(hint)
                for field in msgspec.structs.fields(hint):
                    visit(field.type)
                found[hint] = None
            return
        if get_origin(hint) is not Literal:
            for argument in get_args(hint):
                visit(argument)

    for root in roots:
        visit(root)
    return tuple(found)


def union_members(union: Any) -> tuple[type[msgspec.Struct], ...]:
    """Member types of a tagged union."""
    return get_args(union)


def is_union(hint: Any) -> bool:
    """Is this annotation `A | B`?"""
    return get_origin(hint) in (Union, UnionType)


def aliases() -> dict[str, Any]:
    """Named types of the message modules that are no structs: bounded numbers and texts, vectors, literals."""
    out: dict[str, Any] = {}
    for module in (messages, page):
        for name, value in vars(module).items():
            if not name.startswith("_") and not is_union(value) and get_origin(value) is not None:
                out.setdefault(name, value)
    return out


def alias_name(hint: Any) -> str | None:
    """Name under which the message modules define this annotation, None when they give it no name."""
    for name, value in aliases().items():
        if value == hint and type(value) is type(hint):
            return name
    return None


def _docstring(struct: type) -> tuple[str, dict[str, str]]:
    """Description and attributes of a Google style docstring, each on one line; attributes of the bases too."""
    head, attributes = "", dict[str, str]()
    for kind in reversed(struct.__mro__):
        head, _, tail = inspect.cleandoc(kind.__doc__ or "").partition("\nAttributes:\n")
        name = ""
        for line in tail.splitlines():
            match = _ATTRIBUTE.match(line)
            if match:
                name = match[1]
                attributes[name] = match[2].strip()
            elif line.strip() and name:
                attributes[name] += " " + line.strip()
    return " ".join(head.split()), attributes
