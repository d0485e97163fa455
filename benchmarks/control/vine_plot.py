"""The picture of `bench vine`: the seconds of every vine, stage by stage."""

import json
from pathlib import Path

from matplotlib.figure import Figure

from benchmarks.control.row_plot import STAGE_COLOURS
from benchmarks.control.row_stages import STAGES
from benchmarks.control.vine import GLANCE_S, OURS, USUAL, condition
from rolling_panda.errors import InputError

#: The person's decisions are hatched; the work has the colours of `bench row`.
_COLOURS = {
    "survey": "#1b6e53",
    "decisions": "#ffffff",
    "plan": "#8c6d31",
    **dict(zip(STAGES, STAGE_COLOURS, strict=True)),
    "leaving": "#98a98a",
}


def draw_vine(folder: Path, figure: Figure) -> None:
    """A bar for each vine, in a panel for each condition.

    Args:
        folder: With files of vines, `vine*.json`.
        figure: To draw in.

    Raises:
        FileNotFoundError: There is no such file.
        InputError: A file is not what the benchmark writes, or has no vine.
    """
    paths = sorted(folder.glob("vine*.json"))
    if not paths:
        raise FileNotFoundError(folder / "vine.json")
    groups: dict[str, list[dict[str, float]]] = {}
    for path in paths:
        document = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(document, dict) or not document.get("results") or "stages_s" not in document:
            raise InputError(f"{path} has no vines of `bench vine --json`; run it again")
        for run in document["results"]:
            grown = run["training"], run.get("cultivar", USUAL), run["preset"]
            name = condition(
                *grown, run["review"], run["decision_s"], run.get("method", OURS), run.get("glance_s", GLANCE_S)
            )
            groups.setdefault(name, []).append(run["stages"])
    sizes = [len(own) for own in groups.values()]
    figure.set_size_inches(8.0, 1.2 + 0.11 * sum(sizes) + 0.35 * len(sizes))
    panels = figure.subplots(len(groups), 1, sharex=True, squeeze=False, height_ratios=sizes).ravel()
    for panel, (name, own) in zip(panels, groups.items(), strict=True):
        left = [0.0] * len(own)
        for stage, colour in _COLOURS.items():
            widths = [stages.get(stage, 0.0) for stages in own]
            person = {"hatch": "////", "edgecolor": "#888888", "linewidth": 0.5} if stage == "decisions" else {}
            panel.barh(range(len(own)), widths, left=left, height=0.8, color=colour, label=stage, **person)
            left = [at + width for at, width in zip(left, widths, strict=True)]
        panel.set_yticks([])
        panel.invert_yaxis()
        panel.set_title(f"{name} a decision ({len(own)} vines)", fontsize=9, loc="left")
    panels[-1].set_xlabel("simulated seconds of a vine; hatched: the person's decisions")
    figure.legend(*panels[0].get_legend_handles_labels(), ncols=6, loc="outside upper center", fontsize="small")
