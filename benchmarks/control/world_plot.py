"""The picture of `bench world`: how many accepted cuts are right, from calm to storm, by disturbance."""

import json
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from rolling_panda.errors import InputError

_LEVELS = ("calm", "field", "storm")
_COLOUR, _COLUMNS = "#1b6e53", 5


def draw_world(folder: Path, figure: Figure) -> None:
    """A panel for all disturbances together, and one for each by itself, with 95 % intervals.

    Args:
        folder: With `world.json` of the presets, or `world_each.json` of `--each`, or both.
        figure: To draw in.

    Raises:
        FileNotFoundError: Neither file is there.
        InputError: A file is not what the benchmark writes.
    """
    files = [path for path in (folder / "world.json", folder / "world_each.json") if path.exists()]
    if not files:
        raise FileNotFoundError(folder / "world.json")
    curves: dict[str, dict[str, dict[str, Any]]] = {}
    for path in files:
        document = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(document, dict) or "summary" not in document:
            raise InputError(f"{path} is not what `bench world --json` writes; run it again")
        for name, figures in document["summary"].items():
            disturbance, _, level = name.rpartition(", ")
            curves.setdefault(disturbance, {})[level] = figures["right"]
    # A calm world is the first place of every curve.
    calm = curves.pop("none", {}).get("calm") or curves.get("all", {}).get("calm")
    names = list(curves)
    rows = -(-len(names) // _COLUMNS)
    figure.set_size_inches(1.9 * min(_COLUMNS, len(names)) + 0.6, 1.9 * rows + 0.3)
    panels = figure.subplots(rows, min(_COLUMNS, len(names)), sharex=True, sharey=True, squeeze=False).ravel()
    for panel, name in zip(panels, names, strict=False):
        points = {"calm": calm, **curves[name]}
        # Where nothing is proposed there is no share.
        known = [(k, points.get(level)) for k, level in enumerate(_LEVELS)]
        shown = [(k, point) for k, point in known if point is not None and point["value"] is not None]
        places = [k for k, _ in shown]
        values = [100 * point["value"] for _, point in shown]
        below = [value - 100 * point["low"] for value, (_, point) in zip(values, shown, strict=True)]
        above = [100 * point["high"] - value for value, (_, point) in zip(values, shown, strict=True)]
        panel.errorbar(places, values, [below, above], color=_COLOUR, marker="o", ms=4, capsize=2)
        counts = sorted({point["n"] for _, point in shown}) or [0]
        n = str(counts[0]) if len(counts) == 1 else f"{counts[0]}–{counts[-1]}"
        panel.set_title(f"{name} (n {n})", fontsize=9)
        panel.set_xticks(range(len(_LEVELS)), _LEVELS)
        panel.set_ylim(-3, 103)
    for panel in panels[len(names) :]:
        panel.set_visible(False)
    # The lowest panel of each column names the levels, also above an empty place.
    for panel in panels[max(len(names) - _COLUMNS, 0) : len(names)]:
        panel.tick_params(labelbottom=True)
    figure.supylabel("accepted cuts that are right (%)", fontsize=10)
