"""The diagram and the table of the supervision machine for `docs/safety.md`."""

from collections.abc import Callable

from rolling_panda.generate.markdown import table
from rolling_panda.mode_table import ROWS, SEVERITY, Event

#: Transitions from as good as everywhere, told in words since their arrows would hide the others.
_FROM_ANYWHERE = (Event.FAULT, Event.STOP)


def diagram() -> str:
    """Mermaid's state diagram of every transition but those from anywhere."""
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


def transitions() -> str:
    """One row a transition, those from anywhere in one row each."""
    rows = [
        (f"{row.before} → {row.after}", row.event.value, row.who, row.when)
        for row in ROWS
        if row.event not in _FROM_ANYWHERE
    ]
    for event in _FROM_ANYWHERE:
        those = [row for row in ROWS if row.event is event]
        missing = [mode for mode in SEVERITY if mode not in {row.before for row in those}]
        start = f"any but {', '.join(missing)}"
        rows.append((f"{start} → {those[0].after}", event.value, those[0].who, those[0].when))
    return table(("from → to", "event", "who", "when"), rows)


def severity() -> str:
    """The modes, the most severe first."""
    return " > ".join(f"`{mode}`" for mode in reversed(SEVERITY)) + "\n"


BLOCKS: dict[str, Callable[[], str]] = {"modes": diagram, "transitions": transitions, "severity": severity}
