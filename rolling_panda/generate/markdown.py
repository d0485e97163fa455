"""The generated blocks of `docs/wire.md`, `docs/reasons.md` and `docs/operator-guide.md`, between markers."""

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Annotated, Any, Literal, get_args, get_origin

import msgspec

from rolling_panda import messages
from rolling_panda.commands import COMMANDS, Command
from rolling_panda.errors import MessageError
from rolling_panda.generate.description import alias_name, aliases, describe, is_union, reachable, union_members
from rolling_panda.messages import page as page_messages
from rolling_panda.messages.types import Mode
from rolling_panda.mode_table import ROWS
from rolling_panda.reasons import CATALOGUE
from rolling_panda.resources import resource
from rolling_panda.topics import SERVICES, TOPICS

_BLOCK = re.compile(r"(<!-- generated: ([a-z-]+) -->\n).*?(<!-- end -->)", re.DOTALL)
_VALUE = re.compile(r"\{[^}]*\}")
#: Who may cause a change of mode, in words.
_RIGHTS = {"holder": "person in control", "operator": "operator", "supervisor": "supervisor"}
_PLAIN: dict[Any, str] = {
    bool: "bool",
    int: "int",
    float: "float",
    str: "string",
    bytes: "bytes",
    type(None): "nil",
}


def fill(document: str, blocks: Mapping[str, Callable[[], str]] | None = None, path: str = "docs/wire.md") -> str:
    """The document with every marked block generated again.

    Args:
        document: Text with blocks between markers.
        blocks: Each block by name; those of the wire's documentation unless given.
        path: Of the document, for errors.

    Raises:
        MessageError: A block's name is unknown, or one of the blocks is missing.
    """
    blocks = BLOCKS if blocks is None else blocks
    seen: set[str] = set()

    def replace(match: re.Match[str]) -> str:
        name = match[2]
        if name not in blocks:
            raise MessageError(f"{path} asks for the block {name}; there are {', '.join(blocks)}")
        seen.add(name)
        return f"{match[1]}\n{blocks[name]()}\n{match[3]}"

    out = _BLOCK.sub(replace, document)
    if seen != set(blocks):
        raise MessageError(f"{path} lacks the blocks {', '.join(sorted(set(blocks) - seen))}")
    return out


def topics_table() -> str:
    """One row for each topic."""
    rows = []
    for topic in TOPICS:
        rate = f"{topic.rate_hz:g} Hz" if topic.rate_hz else "on event"
        notes = [name for name, on in (("express", topic.express), ("latched", topic.latched)) if on]
        rows.append(
            (
                f"`{topic.name}`",
                _link(topic.message),
                topic.sender,
                topic.readers,
                rate,
                topic.priority,
                topic.congestion,
                ", ".join(notes),
                topic.about,
            )
        )
    return table(
        ("topic", "message", "sender", "carried to", "rate", "priority", "congestion", "carried", "what"), rows
    )


def services_table() -> str:
    """One row for each service."""
    rows = [
        (
            f"`{service.name}`",
            ", ".join(_link(request) for request in service.requests),
            service.server,
            f"{service.timeout_s:g} s",
            service.about,
        )
        for service in SERVICES
    ]
    return table(("service", "requests", "answered by", "timeout", "what"), rows)


def commands_table() -> str:
    """One row for each command."""
    rows = [
        (
            f"[{command.name}](#{command.name.lower()})",
            f"`POST /api{command.path}`" if command.path else "–",
            "control" if command.control else command.role,
            ", ".join(_modes(command)) or "all",
            ", ".join(command.conditions) or "–",
        )
        for command in COMMANDS
    ]
    return table(("command", "route", "least right", "modes", "conditions"), rows)


def guide_table() -> str:
    """One row for each command, in the words of the page."""
    texts = json.loads(resource("web/text/page.en.json").read_text(encoding="utf-8"))
    modes = {mode: f"*{texts[f'mode.{mode}']}*" for mode in get_args(Mode)}
    names = re.compile(rf"\b({'|'.join(modes)})\b")
    rows = [
        (
            command.words.capitalize(),
            names.sub(lambda found: modes[found[0]], describe(command.message).about.replace("\n", " ")),
            "; ".join(_who(command, modes)),
            ", ".join(modes[mode] for mode in _modes(command)) or "every",
        )
        for command in COMMANDS
    ]
    return table(("command", "what it does", "who", "modes"), rows)


def _who(command: Command, modes: Mapping[str, str]) -> Iterator[str]:
    """Who may use a command; where the modes differ in that, by mode."""
    rows = [row for row in ROWS if command.event is not None and row.event is command.event]
    if len({row.who for row in rows}) > 1:
        yield from (f"{_RIGHTS[row.who]} ({modes[row.before]})" for row in rows)
    else:
        yield "person in control" if command.control else command.role


def _modes(command: Command) -> tuple[str, ...]:
    if command.event is None:
        return command.modes
    return tuple(row.before for row in ROWS if row.event is command.event)


def types_table() -> str:
    """One row for each named type that is not a message."""
    rows = [(f"`{name}`", spelled_out(hint)) for name, hint in aliases().items()]
    return table(("name", "values"), rows)


def wire_messages() -> str:
    """A section for every message of the topics and services, and for the parts that they contain."""
    roots = [topic.message for topic in TOPICS]
    requests = [request for service in SERVICES for request in service.requests]
    return _sections((*roots, *requests, messages.Answer))


def page_message_sections() -> str:
    """A section for every message of the page's socket that is not already a message of the wire."""
    known = set(reachable([*(topic.message for topic in TOPICS)]))
    unions = (page_messages.FromServer, page_messages.FromPage)
    return _sections([member for union in unions for member in union_members(union)], leave_out=known)


def spelled_out(hint: Any) -> str:
    """An annotation as text: base type, bounds, length, pattern.

    Raises:
        MessageError: The annotation is not supported.
    """
    if hint in _PLAIN:
        return _PLAIN[hint]
    origin, arguments = get_origin(hint), get_args(hint)
    if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
        return _link(hint)
    if origin is Annotated:
        unit = {str: "character", bytes: "byte"}.get(arguments[0], "item")
        return ", ".join([spelled_out(arguments[0]), *_bounds(arguments[1:], unit)])
    if origin is Literal:
        return " \\| ".join(f'`"{value}"`' for value in arguments)
    if is_union(hint):
        return " or ".join(_named(argument) for argument in arguments)
    if origin is dict:
        return f"map of {_named(arguments[0])} to {_named(arguments[1])}"
    if origin is tuple and arguments[-1] is Ellipsis:
        return f"array of {_named(arguments[0])}"
    if origin is tuple:
        kinds = {_named(argument) for argument in arguments}
        if len(kinds) == 1:
            return f"array of {len(arguments)} {kinds.pop()}"
        return f"array of ({', '.join(_named(argument) for argument in arguments)})"
    raise MessageError(f"cannot describe {hint}; extend rolling_panda/generate/markdown.py")


def _named(hint: Any) -> str:
    name = alias_name(hint)
    return spelled_out(hint) if name is None else f"`{name}`"


def _bounds(metas: Iterable[Any], unit: str) -> list[str]:
    out = []
    for meta in metas:
        if meta.ge is not None and meta.le is not None:
            out.append(f"{_number(meta.ge)} … {_number(meta.le)}")
        elif meta.gt is not None and meta.le is not None:
            out.append(f"more than {_number(meta.gt)}, at most {_number(meta.le)}")
        if meta.min_length is not None:
            out.append(f"at least {meta.min_length} {unit}{'s' if meta.min_length > 1 else ''}")
        if meta.max_length is not None:
            out.append(f"at most {meta.max_length} {unit}s")
        if meta.pattern is not None:
            out.append(f"matching `{meta.pattern}`")
    return out


def _number(value: float) -> str:
    return "2^62" if value == 2**62 else f"{value:g}"


def _sections(roots: Iterable[type[msgspec.Struct]], leave_out: set[type[msgspec.Struct]] | None = None) -> str:
    parts = []
    for struct in reachable(roots):
        if leave_out and struct in leave_out:
            continue
        text = describe(struct)
        parts.append(f"### {text.name}\n\n{text.about}\n")
        rows = [] if text.tag is None else [("`type`", f'`"{text.tag}"`', "required", "the tag")]
        for field in text.fields:
            default = "required" if field.required else f"`{_default(field.default)}`"
            rows.append((f"`{field.name}`", _named(field.hint), default, field.about))
        parts.append(table(("field", "type", "default", "meaning"), rows))
    return "\n".join(parts)


def _default(value: Any) -> str:
    if value is None:
        return "nil"
    if isinstance(value, bytes):
        return '""'
    return f'"{value}"' if isinstance(value, str) else str(value).replace("()", "[]")


def _link(struct: type[msgspec.Struct]) -> str:
    return f"[{struct.__name__}](#{struct.__name__.lower()})"


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines.extend("| " + " | ".join(row) + " |" for row in rows)
    return "\n".join(lines) + "\n"


def reasons_table() -> str:
    """One row for each reason, by code."""
    entries = sorted(CATALOGUE.values(), key=lambda entry: entry.code)
    # As code, since Markdown's `attr_list` takes a bare `{why}` at the end of a cell for an attribute of the cell.
    rows = [(f"`{entry.code}`", entry.severity, _VALUE.sub(_as_code, entry.text), entry.act) for entry in entries]
    return table(("code", "severity", "text", "what to do"), rows)


def _as_code(value: re.Match[str]) -> str:
    """A value as code; of words for one and for several the latter."""
    _, several, words = value[0].strip("{}").partition("|")
    return words if several else f"`{value[0]}`"


BLOCKS: dict[str, Callable[[], str]] = {
    "topics": topics_table,
    "services": services_table,
    "commands": commands_table,
    "types": types_table,
    "messages": wire_messages,
    "page-messages": page_message_sections,
}
