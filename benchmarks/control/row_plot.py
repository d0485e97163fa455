"""The picture of `bench row`: seconds a cut by method, stage by stage."""

from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

#: One colour a stage, told apart by lightness too; the blades, which nothing makes faster, are dark.
STAGE_COLOURS = ("#b8b8b8", "#1f77b4", "#9467bd", "#6baed6", "#c6dbef", "#fdd0a2", "#333333", "#74c476")


def draw(stages: Mapping[str, Mapping[str, float]], path: Path) -> None:
    """Write the picture.

    Args:
        stages: For each method its seconds a cut by stage, in the order of a cut.
        path: PNG file to write.
    """
    figure = Figure(figsize=(8.0, 0.9 + 0.55 * len(stages)), layout="constrained")
    axes = figure.subplots()
    rows = list(stages)
    left = dict.fromkeys(rows, 0.0)
    for number, stage in enumerate(next(iter(stages.values()), {})):
        widths = [stages[row][stage] for row in rows]
        bars = axes.barh(rows, widths, left=[left[row] for row in rows], color=STAGE_COLOURS[number], label=stage)
        for bar, width in zip(bars, widths, strict=True):
            if width >= 0.25:
                middle = bar.get_x() + width / 2
                color = "white" if stage in ("blades", "transfer", "close-up") else "black"
                axes.text(
                    middle, bar.get_y() + bar.get_height() / 2, f"{width:.1f}", ha="center", va="center", color=color
                )
        for row, width in zip(rows, widths, strict=True):
            left[row] += width
    axes.invert_yaxis()
    axes.set_xlabel("simulated seconds a cut, mean")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(ncols=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, fontsize="small")
    figure.savefig(path, dpi=150)
