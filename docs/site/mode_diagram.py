"""Draws the state diagram of the modes, so that the site needs no Mermaid from a foreign host."""

import re
from html import escape

#: Centre of each mode.
PLACES = {
    "[*]": (24, 190),
    "IDLE": (130, 190),
    "FAULT": (130, 330),
    "ESTOP_LATCHED": (130, 50),
    "READY": (300, 190),
    "TELEOP": (630, 50),
    "PAUSED": (630, 190),
    "AUTO": (630, 330),
    "PROTECTIVE_STOP": (860, 190),
}
_ARROW = re.compile(r"^\s*(\S+) --> (\S+): (.+?)(?: \(\w+\))?$", re.MULTILINE)


def draw(source: str) -> tuple[str, set[str]]:
    """The diagram of a `stateDiagram-v2` as SVG, and the modes that have no place in it."""
    arrows: dict[tuple[str, str], list[str]] = {}
    for start, end, event in _ARROW.findall(source):
        arrows.setdefault((start, end), []).append(event)
    modes = {mode for ends in arrows for mode in ends}
    drawn = {ends: events for ends, events in arrows.items() if set(ends) <= PLACES.keys()}
    parts = [_arrow(*ends, events, ends[::-1] in drawn) for ends, events in drawn.items()]
    parts += [_mode(mode) for mode in sorted(modes & PLACES.keys())]
    head = (
        '<defs><marker id="arrow" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0 0L8 4L0 8z"/></marker></defs>'
    )
    svg = '<svg class="modes" viewBox="0 0 960 380" role="img" aria-label="The modes; the table below has each arrow">'
    return f"{svg}{head}{''.join(parts)}</svg>", modes - PLACES.keys()


def _half(mode: str) -> tuple[float, float]:
    """Half the width and height of a mode's box."""
    return (8, 8) if mode == "[*]" else (14 + 4.8 * len(mode), 18)


def _mode(mode: str) -> str:
    (x, y), (width, height) = PLACES[mode], _half(mode)
    if mode == "[*]":
        return f'<circle cx="{x}" cy="{y}" r="{width}"/>'
    box = f'<rect x="{x - width:g}" y="{y - height:g}" width="{2 * width:g}" height="{2 * height:g}" rx="8"/>'
    return f'{box}<text class="mode" x="{x}" y="{y + 5}">{mode}</text>'


def _arrow(start: str, end: str, events: list[str], there_and_back: bool) -> str:
    (x0, y0), (x1, y1) = PLACES[start], PLACES[end]
    dx, dy = x1 - x0, y1 - y0
    length = (dx * dx + dy * dy) ** 0.5
    aside = 9 if there_and_back else 0
    right = (-dy / length, dx / length)
    # Around the mode that lies between.
    bend = 42 if (start, end) == ("READY", "PROTECTIVE_STOP") else 0
    x0, y0, x1, y1 = (at + aside * right[i % 2] for i, at in enumerate((x0, y0, x1, y1)))
    middle = ((x0 + x1) / 2, (y0 + y1) / 2 + 2 * bend)
    a, b = _edge(start, (x0, y0), middle), _edge(end, (x1, y1), middle)
    points = [f"{x:.0f} {y:.0f}" for x, y in (a, middle, b)]
    path = f'<path d="M{points[0]}Q{points[1]} {points[2]}" marker-end="url(#arrow)"/>'
    label = ""
    if end != "PROTECTIVE_STOP" and start != "[*]":
        upright = abs(dx) < abs(dy)
        x, y = (a[0] + b[0]) / 2, (a[1] + b[1]) / 2
        side = "start" if upright or right[0] > 0.2 else "end" if right[0] < -0.2 else "middle"
        x += {"start": 1, "end": -1, "middle": 0}[side] * (8 if upright else 18)
        y += 4 if upright or side != "middle" else -7
        label = f'<text style="text-anchor:{side}" x="{x:.0f}" y="{y:.0f}">{escape(events[0])}</text>'
    return f"<g><title>{escape(start)} → {escape(end)}: {escape('; '.join(events))}</title>{path}{label}</g>"


def _edge(mode: str, centre: tuple[float, float], towards: tuple[float, float]) -> tuple[float, float]:
    """Where the line from the centre of a mode leaves its box."""
    (width, height), dx, dy = _half(mode), towards[0] - centre[0], towards[1] - centre[1]
    part = min((width + 3) / abs(dx) if dx else 1e9, (height + 3) / abs(dy) if dy else 1e9)
    return centre[0] + part * dx, centre[1] + part * dy
