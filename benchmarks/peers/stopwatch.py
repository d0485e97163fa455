"""What every script here shares: read the problem, time the steps, print one line of JSON. Needs numpy alone."""

import gc
import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

#: Edges of a histogram's bins (µs): thirty to a decade, from 3 µs to 10 ms.
EDGES_US = 3.0 * 10.0 ** (np.arange(107) / 30.0)


def histogram(micros: Any) -> dict[str, int]:
    """How many durations (µs) are in the bins that are not empty, by the number of the bin's lower edge.

    What is outside the outermost edges counts with the outermost bins.
    """
    counts, _ = np.histogram(np.clip(micros, EDGES_US[0], EDGES_US[-1]), EDGES_US)
    return {str(i): int(counts[i]) for i in np.flatnonzero(counts)}


def counts(histogram: dict[str, int]) -> Any:
    """How many are in each bin, from what `histogram` gave."""
    return np.array([histogram.get(str(i), 0) for i in range(len(EDGES_US) - 1)])


def urdf() -> Path:
    """The robot's description, from the folder that is the script's only argument."""
    return Path(sys.argv[1]) / "robot.urdf"


def load(names: Sequence[str]) -> dict[str, Any]:
    """The arrays of the problem, in the solver's own order of the joints."""
    with np.load(Path(sys.argv[1]) / "problem.npz") as file:
        out = dict(file)
    known = out["names"].tolist()
    order = [known.index(name) for name in names]
    for key in ("q", "v", "posture", "velocity", "acceleration"):
        out[key] = out[key][..., order]
    out["order"] = order
    return out


def rolling(problem: dict[str, Any], q: Any) -> Any:
    """A (3×12) of A q̇ = 0, the wheels roll and do not slip, in the solver's order of the joints."""
    radius, half_track = float(problem["wheel_radius"]), float(problem["half_track"])
    phi = q[problem["order"].index(2)]
    c, s = np.cos(phi), np.sin(phi)
    A = np.zeros((3, 12))
    A[0, :2] = -s, c
    A[1, :4] = c, s, -half_track, -radius
    A[2, :5] = c, s, half_track, 0.0, -radius
    return A[:, problem["order"]]


def report(name: str, version: str, note: str, step: Callable[[int], Any], count: int) -> None:
    """Time the steps, and print the result; see `timed`."""
    print(json.dumps({"name": name, "version": version, "note": note, **timed(step, count)}))


def timed(step: Callable[[int], Any], count: int) -> dict[str, Any]:
    """Times of `step(i)` for i in 0…count − 1 (µs), after the first 200 for warming up.

    A step returns the velocities, or None where the solver found none, which is counted.
    """
    for i in range(min(count, 200)):
        step(i)
    gc.collect()
    gc.disable()
    seconds, failed = [], 0
    for i in range(count):
        begin = time.perf_counter()
        v = step(i)
        seconds.append(time.perf_counter() - begin)
        failed += v is None or not np.isfinite(v).all()
    gc.enable()
    micros = np.array(seconds) * 1e6
    return {
        "median_us": round(float(np.median(micros)), 1),
        "p99_us": round(float(np.percentile(micros, 99)), 1),
        "max_us": round(float(micros.max()), 1),
        "histogram": histogram(micros),
        "steps": count,
        "failed": int(failed),
    }
