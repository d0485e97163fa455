"""`rolling-panda bench plots`: pictures of what the benchmarks wrote, for the documentation.

Every picture is drawn from files in the results' folder alone, so that it shows what its table says. A picture whose
files are not there is left out, and said.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.common.intervals import share
from benchmarks.control.vine_plot import draw_vine
from benchmarks.control.world_plot import draw_world
from benchmarks.peers.stopwatch import EDGES_US, counts
from rolling_panda.errors import InputError

#: One colour a method in every picture, told apart without colours by order and legend as well.
COLOURS = {"hierarchy": "#1b6e53", "nullspace": "#b4622d", "decoupled": "#5b6f9a"}
#: Edges of the distances (m) that successes are counted between.
_EDGES = np.array([0.0, 0.75, 1.25, 1.75, 2.25, 2.75, 3.25, 3.75, 4.25, 5.7])
_STYLE: Any = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "figure.dpi": 130,
}
Results = dict[str, dict[str, Any]]


def reach_by_distance(axes: Axes, reach: Results) -> None:
    """Share of goals reached over the goal's distance from the base, with 95 % intervals.

    Args:
        axes: To draw in.
        reach: What `bench reach --json` wrote, by method.
    """
    middles = (_EDGES[1:] + _EDGES[:-1]) / 2
    for shift, (method, document) in zip((0.0, 0.04, -0.04), reach.items(), strict=False):
        rows = document["results"]
        place = np.digitize([row["distance"] for row in rows], _EDGES) - 1
        reached = np.array([row["reached"] for row in rows])
        shown = [i for i in range(len(middles)) if (place == i).any()]
        shares = np.array([reached[place == i].mean() for i in shown])
        counted = [share(int(reached[place == i].sum()), int((place == i).sum())) for i in shown]
        bounds = np.array([(figure.low, figure.high) for figure in counted])
        errors = np.abs(bounds.T - shares)
        axes.errorbar(
            middles[shown] + shift,
            100 * shares,
            100 * errors,
            marker="o",
            ms=4,
            capsize=2,
            color=COLOURS[method],
            label=f"{method} (n = {len(rows)})",
        )
    axes.set(xlabel="distance of the goal from the base (m)", ylabel="reached to 1 mm and 0.5° in 30 s (%)")
    axes.set_ylim(-3, 103)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)


def omega_along(axes: Axes, reach: Results) -> None:
    """The arm's manipulability along the way to one goal, each method until it ends.

    Args:
        axes: To draw in.
        reach: What `bench reach --json` wrote, by method.
    """
    shared = set.intersection(*({sample["target"] for sample in document["samples"]} for document in reach.values()))
    if not shared:
        raise InputError("the files of reach hold no goal in common; run all methods with the same seed")
    target = min(shared)
    for method, document in reach.items():
        (sample,) = [sample for sample in document["samples"] if sample["target"] == target]
        row = next(row for row in document["results"] if row["target"] == target)
        end = "reached" if row["reached"] else f"{100 * row['position_error']:.0f} cm short"
        axes.plot(sample["t"], sample["omega"], color=COLOURS[method], label=f"{method}: {end}")
    axes.set(xlabel="time (s)", ylabel="ω of the arm", title=f"goal {target} of the run")
    axes.set_ylim(bottom=0.0)
    axes.legend()


def tick(axes: Axes, document: dict[str, Any]) -> None:
    """How long one control step takes, and one whole-body step of others on the same problems.

    Args:
        axes: To draw in.
        document: What `bench tick --json` wrote.
    """
    parts = document["parts"]
    series = [
        ("whole control step", document, "#222222"),
        ("hierarchy, everything on", parts["step"], COLOURS["hierarchy"]),
        ("nullspace", parts["nullspace step"], COLOURS["nullspace"]),
    ]
    peers = [peer for peer in document.get("peers", []) if "absent" not in peer]
    for peer, colour in zip(peers, ("#8a63a8", "#3f8fb0", "#a8a13c", "#b0506a"), strict=False):
        series.append((f"{peer['name']} {peer['version']}", peer, colour))
    middles = np.sqrt(EDGES_US[1:] * EDGES_US[:-1])
    for name, times, colour in series:
        found = counts(times["histogram"])
        label = f"{name}: {times['median_us']:.0f} µs"
        axes.step(middles, 100 * found / found.sum(), where="mid", color=colour, label=label)
        axes.axvline(times["median_us"], color=colour, lw=0.8, ls=":")
    axes.set(xlabel="time of one step (µs)", ylabel="share of the steps (%)", xscale="log", xlim=(5, 2000))
    axes.set_xticks([10, 100, 1000], ["10", "100", "1000"])
    axes.set_ylim(bottom=0.0)
    axes.legend(title="median")


def _tick(folder: Path, figure: Figure) -> None:
    document = json.loads((folder / "tick.json").read_text(encoding="utf-8"))
    if not isinstance(document, dict) or "histogram" not in document:
        raise InputError(f"{folder / 'tick.json'} is not what `bench tick --json` writes; run it again")
    tick(figure.add_subplot(), document)


def _reach(draw: Callable[[Axes, Results], None]) -> Callable[[Path, Figure], None]:
    def picture(folder: Path, figure: Figure) -> None:
        files = {method: folder / f"reach_{method}.json" for method in COLOURS}
        found = {method: _read(path) for method, path in files.items() if path.exists()}
        if not found:
            raise FileNotFoundError(files["hierarchy"])
        draw(figure.add_subplot(), found)

    return picture


#: Picture's name → what draws it from a folder of results; raises FileNotFoundError where a file is missing.
PICTURES: dict[str, Callable[[Path, Figure], None]] = {
    "reach_by_distance": _reach(reach_by_distance),
    "omega_along_a_reach": _reach(omega_along),
    "tick": _tick,
    "world": draw_world,
    "vine": draw_vine,
}


def draw(results: Path, out: Path, names: Sequence[str] = tuple(PICTURES)) -> tuple[list[Path], list[str]]:
    """Draw pictures.

    Args:
        results: Folder with what the benchmarks wrote.
        out: Folder for the pictures, made where it is missing.
        names: Which.

    Returns:
        The files written, and for each picture that could not be drawn a line that says why.
    """
    out.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    missing: list[str] = []
    for name in names:
        with mpl.rc_context(_STYLE):
            figure = Figure(figsize=(7.2, 3.8), layout="constrained")
            try:
                PICTURES[name](results, figure)
            except FileNotFoundError as error:
                missing.append(f"{name}: no {error.args[0]}; run its benchmark with --json first")
                continue
            path = out / f"{name}.png"
            # Without the library's version in it, the same results give the same file.
            figure.savefig(path, metadata={"Software": None})
            written.append(path)
    return written, missing


def main(argv: Sequence[str]) -> int:
    """Draw, and say what was drawn. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="rolling-panda bench plots", description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("benchmarks/results"), metavar="DIR")
    parser.add_argument("--out", type=Path, default=Path("docs/images"), metavar="DIR")
    parser.add_argument("names", nargs="*", choices=[[], *PICTURES], metavar="NAME", help="(default: every picture)")
    arguments = parser.parse_args(argv)
    try:
        written, missing = draw(arguments.results, arguments.out, arguments.names or tuple(PICTURES))
    except (InputError, OSError, KeyError, ValueError) as error:
        print(f"rolling-panda bench plots: {error}", file=sys.stderr)
        return 1
    for path in written:
        print(path)
    for line in missing:
        print(line, file=sys.stderr)
    return 0 if written else 1


def _read(path: Path) -> dict[str, Any]:
    document = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(document, dict) or not {"results", "samples"} <= document.keys():
        raise InputError(f"{path} is not what `bench reach --json` writes; run it again")
    return document
