"""What came of rows worked off: each cut, each row, and the figures over all of them."""

import math
from dataclasses import dataclass

import numpy as np

from benchmarks.common.intervals import share
from benchmarks.control.row_stages import LIMITS, STAGES
from benchmarks.perception.blocked import Blocker

#: A cut is at the right place when the cane was severed within this of the accepted point (m).
RIGHT_PLACE = 0.010


@dataclass(frozen=True)
class Cut:
    """One accepted point and how it ended.

    Attributes:
        method: Whole-body method.
        seed: Of the row.
        point_id: Its name.
        state: How it ended.
        reason: Code of the reason, with those of its causes; empty without one.
        distance: From the accepted point to what was severed (m); None when nothing was.
        tool_error: From the accepted point to the middle of the blades as they closed (m); None when they did not.
        duration_s: Since the cut before it, or since the start (s, simulated).
        true_right: Wood was severed where it is right by the simulator's truth, and nothing that stays.
        harm: What that stays was severed; empty for nothing.
        right_cane: Wood that is to be cut was cut.
        nodes_left: Count nodes left on the cane that stays, where it was cut.
        past_best: Along the wood, from where the rule puts the blades to where they cut (m).
        aside: Across the wood, from the middle of the blades to the nearest wood as they closed (m); None when they
            did not, or none was near.
        blocked: What leaves no room for the blades wherever it may be made; empty where there is room.
    """

    method: str
    seed: int
    point_id: str
    state: str
    reason: str
    distance: float | None
    tool_error: float | None
    duration_s: float
    true_right: bool
    harm: str
    right_cane: bool = False
    nodes_left: int | None = None
    past_best: float | None = None
    aside: float | None = None
    blocked: Blocker = ""

    @property
    def bitten(self) -> bool:
        """The blades closed for it."""
        return self.tool_error is not None

    @property
    def told_truly(self) -> bool:
        """Told as cut where something was severed, and as not cut where nothing was."""
        return self.state == ("FAILED_NOT_CUT" if self.distance is None else "DONE")

    @property
    def right(self) -> bool:
        """Severed at the right place."""
        return self.distance is not None and self.distance <= RIGHT_PLACE


@dataclass(frozen=True)
class RowRun:
    """One row worked off by one method.

    Attributes:
        method: Whole-body method.
        seed: Of the row.
        cuts: The accepted points.
        work_s: Of automatic work, from the start to the end of the last one (s, simulated).
        other_s: Of looking and of driving on by hand between stretches of work, of a whole row (s, simulated).
        path_rms: Of the true tool against its trajectory, over all followed motion (m).
        contacts: Physics steps in which the robot met posts, trunks, cordons or wires.
        self_contacts: Physics steps in which it met itself.
        stops: Protective stops.
        stages: Seconds by stage (simulated).
        limits: Seconds under way between cuts by what held the motion back.
        canes_touched: Canes, not the ones cut, that a part of the robot other than the blades overlapped with, and
            which parts these were.
        staying_touched: The same of wood that stays when the row is pruned, on canes that were cut too.
        camera_warning: What a check of the camera has told; empty without a check, or where nothing is wrong.
        cleared: Stops and pauses after which a played person let the work go on.
        auto_s: In automatic work, whether a point ended or not (s, simulated).
        false_stops: Protective stops at which the robot touched nothing, by the truth.
    """

    method: str
    seed: int
    cuts: tuple[Cut, ...]
    work_s: float
    other_s: float
    path_rms: float
    contacts: int
    self_contacts: int
    stops: int
    stages: dict[str, float]
    limits: dict[str, float]
    canes_touched: dict[str, str]
    staying_touched: dict[str, str]
    camera_warning: str = ""
    cleared: int = 0
    auto_s: float = 0.0
    false_stops: int = 0


def tell(run: RowRun, speed: float) -> None:
    """Print a row in one line, and each cut that went wrong; `speed` is simulated over real time."""
    right = sum(cut.right for cut in run.cuts)
    each = run.work_s / max(len(run.cuts), 1)
    contacts = f"{run.contacts}+{run.self_contacts}"
    print(
        f"{run.method:<10} {run.seed:>4} {len(run.cuts):>8} {right:>6} {each:>8.1f} {contacts:>8} {speed:>11.1f}",
        flush=True,
    )
    for cut in run.cuts:
        if not (cut.right and cut.true_right):
            print(
                f"       {cut.point_id}: {cut.state}, {cut.reason or 'no reason'}; distance {cut.distance} {cut.harm}"
            )


def mean_stages(runs: list[RowRun]) -> dict[str, float]:
    """Seconds a cut by stage, over all rows of one method."""
    return {stage: _mean(runs, "stages", stage) for stage in STAGES}


def tell_stages(runs: dict[str, list[RowRun]]) -> None:
    """Print where the time of a cut goes, by method."""
    for title, field, names in (
        ("s a cut by stage", "stages", STAGES),
        ("s a cut under way, by what held it", "limits", LIMITS),
    ):
        print(f"\n{title:<36}" + "".join(f"{method:>12}" for method in runs))
        for name in names:
            print(f"{name:<36}" + "".join(f"{_mean(done, field, name):>12.2f}" for done in runs.values()))


def _mean(runs: list[RowRun], field: str, name: str) -> float:
    cuts = sum(len(run.cuts) for run in runs)
    return sum(float(getattr(run, field)[name]) for run in runs) / max(cuts, 1)


def summarise(runs: list[RowRun]) -> dict[str, float | int]:
    """Share severed at the right place, seconds a cut, distances and contacts, over all rows of one method."""
    cuts = [cut for run in runs for cut in run.cuts]
    durations = [cut.duration_s for cut in cuts if cut.right and cut.duration_s > 0.0]
    distances = [cut.distance for cut in cuts if cut.distance is not None]
    tool = [cut.tool_error for cut in cuts if cut.tool_error is not None]

    def quantile(values: list[float], share: float, digits: int) -> float:
        return round(float(np.quantile(values, share)), digits) if values else 0.0

    right = sum(cut.right for cut in cuts)
    at_place, true = share(right, len(cuts)), share(sum(cut.true_right for cut in cuts), len(cuts))
    return {
        "accepted": len(cuts),
        "right": right,
        "right_place": round(right / max(len(cuts), 1), 3),
        "right_place_low": round(at_place.low or 0.0, 3),
        "right_place_high": round(1.0 if at_place.high is None else at_place.high, 3),
        "truly_right": round(sum(cut.true_right for cut in cuts) / max(len(cuts), 1), 3),
        "truly_right_low": round(true.low or 0.0, 3),
        "harmed": sum(bool(cut.harm) for cut in cuts),
        "void": sum(cut.state == "PROPOSED" for cut in cuts),
        "unknown": sum(cut.state == "UNKNOWN" for cut in cuts),
        "cut_s_mean": round(sum(run.work_s for run in runs) / max(len(cuts), 1), 2),
        "cut_s_median": quantile(durations, 0.5, 2),
        "other_s_mean": round(sum(run.other_s for run in runs) / max(len(cuts), 1), 2),
        "distance_mm_median": quantile([1e3 * d for d in distances], 0.5, 2),
        "distance_mm_max": quantile([1e3 * d for d in distances], 1.0, 2),
        "tool_mm_p95": quantile([1e3 * d for d in tool], 0.95, 2),
        "path_mm_rms": round(1e3 * math.sqrt(float(np.mean([run.path_rms**2 for run in runs]))), 2) if runs else 0.0,
        "contact_steps": sum(run.contacts for run in runs),
        "self_contact_steps": sum(run.self_contacts for run in runs),
        "canes_touched": sum(len(run.canes_touched) for run in runs),
        "staying_touched": sum(len(run.staying_touched) for run in runs),
        "stops": sum(run.stops for run in runs),
        "false_stops": sum(run.false_stops for run in runs),
        "stops_cleared": sum(run.cleared for run in runs),
    }
