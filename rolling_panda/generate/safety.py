"""The generated blocks of `docs/safety.md`: bounds, time limits, diagram and tables of the modes."""

import importlib
from collections.abc import Callable, Iterator

from msgspec import Struct

from rolling_panda.bounds import Bound, Number, numbers
from rolling_panda.generate.description import describe
from rolling_panda.generate.markdown import table
from rolling_panda.mode_table import ROWS, SEVERITY, Event
from rolling_panda.timeouts import LIMITS, RELATIONS

#: Types of the configuration sections with safety limits. They are imported by name, since this package may not import
#: the processes' packages statically.
SECTIONS = {
    "robot": ("rolling_panda.config", "RobotConfig"),
    "bridge": ("bridge.config", "BridgeConfig"),
    "real": ("bridge.real.config", "RealConfig"),
    "controller": ("controller.config", "ControllerConfig"),
    "server": ("server.config", "ServerConfig"),
}
_STRICTER = {"less": "smaller", "more": "larger", "neither": "–"}
#: Events that are possible in nearly every mode; their arrows would hide the others.
_FROM_ANYWHERE = (Event.FAULT, Event.STOP)


def section(name: str) -> type[Struct]:
    """The type of a configuration section."""
    module, kind = SECTIONS[name]
    found: type[Struct] = getattr(importlib.import_module(module), kind)
    return found


def bounds_table() -> str:
    """One row for each safety limit."""
    rows = []
    for name in SECTIONS:
        kind = section(name)
        descriptions = dict(_descriptions(kind, ""))
        for key, limits in _by_key(list(numbers(kind()))).items():
            usual = ", ".join(_format(each.usual, each.bound) for each in limits)
            bounds = list(dict.fromkeys(str(each.bound) for each in limits))
            allowed = bounds[0] if len(bounds) == 1 else ", ".join(str(each.bound) for each in limits)
            stricter = "on" if isinstance(limits[0].usual, bool) else _STRICTER[limits[0].bound.safer]
            rows.append((f"`[{name}]`", f"`{key}`", usual, allowed, stricter, descriptions[key]))
    return table(("section", "key", "usual", "hard bound", "stricter", "what"), rows)


def _by_key(limits: list[Number]) -> dict[str, list[Number]]:
    """Group the numbers of an array under one key."""
    out: dict[str, list[Number]] = {}
    for each in limits:
        out.setdefault(each.name.split("[")[0], []).append(each)
    return out


def _descriptions(kind: type[Struct], prefix: str) -> Iterator[tuple[str, str]]:
    for field in describe(kind).fields:
        if isinstance(field.hint, type) and issubclass(field.hint, Struct):
            yield from _descriptions(field.hint, f"{prefix}{field.name}.")
        yield prefix + field.name, field.about


def _format(value: float, bound: Bound) -> str:
    return str(bool(value)).lower() if bound.switch else f"{value:.10g}"


def mode_diagram() -> str:
    """Mermaid state diagram, without the events that are possible in nearly every mode."""
    lines = [
        "```mermaid",
        "stateDiagram-v2",
        "    [*] --> IDLE: start",
        "    [*] --> ESTOP_LATCHED: start, still latched",
    ]
    lines += [
        f"    {row.before} --> {row.after}: {row.event.value} ({row.who})"
        for row in ROWS
        if row.event not in _FROM_ANYWHERE
    ]
    lines += [f"    state {mode}" for mode in SEVERITY if all(mode not in line for line in lines)]
    return "\n".join([*lines, "```"]) + "\n"


def transitions_table() -> str:
    """One row for each transition, and one for each event that is possible in nearly every mode."""
    rows = [
        (f"{row.before} → {row.after}", row.event.value, row.who, row.when)
        for row in ROWS
        if row.event not in _FROM_ANYWHERE
    ]
    for event in _FROM_ANYWHERE:
        rows_of_event = [row for row in ROWS if row.event is event]
        missing = [mode for mode in SEVERITY if mode not in {row.before for row in rows_of_event}]
        start = f"any but {', '.join(missing)}"
        rows.append((f"{start} → {rows_of_event[0].after}", event.value, rows_of_event[0].who, rows_of_event[0].when))
    return table(("from → to", "event", "who", "when"), rows)


def severity_order() -> str:
    """The modes, most severe first."""
    return " > ".join(f"`{mode}`" for mode in reversed(SEVERITY)) + "\n"


def limits_table() -> str:
    """One row for each related limit."""
    rows = []
    for limit in LIMITS.values():
        where = "configuration" if limit.configurable else f"`{limit.source.partition(':')[0]}`"
        rows.append((limit.label, f"{limit.seconds(limit.usual):.4g} {limit.unit}", where))
    return table(("limit or period", "usual", "where"), rows)


def relations_table() -> str:
    """One row for each relation between limits."""
    return table(("relation", "why"), [(str(relation), relation.why) for relation in RELATIONS])


BLOCKS: dict[str, Callable[[], str]] = {
    "time-limits": limits_table,
    "relations": relations_table,
    "bounds": bounds_table,
    "modes": mode_diagram,
    "transitions": transitions_table,
    "severity": severity_order,
}
