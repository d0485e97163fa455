"""The figures over rows: what was severed by the program's own place, and by the truth."""

import dataclasses

from benchmarks.control.row_report import Cut, RowRun, summarise
from benchmarks.control.row_stages import LIMITS, STAGES
from benchmarks.control.world import told_stops, work_of


def cut(state="DONE", distance: float | None = 0.001, right=True, harm="") -> Cut:
    return Cut("hierarchy", 1, "p", state, "", distance, 0.0001, 3.0, right, harm)


def run(*cuts: Cut) -> RowRun:
    zeros = dict.fromkeys(STAGES, 0.0), dict.fromkeys(LIMITS, 0.0)
    return RowRun("hierarchy", 1, cuts, 3.0 * len(cuts), 0.0, 0.001, 0, 0, 0, *zeros, {}, {})


def test_a_void_acceptance_counts_as_not_cut_and_a_lost_node_as_harm() -> None:
    rows = [run(cut(), cut("PROPOSED", None, False)), run(cut(right=False, harm="a node"), cut("UNKNOWN", None, False))]
    summary = summarise(rows)
    assert (summary["accepted"], summary["void"], summary["unknown"], summary["harmed"]) == (4, 1, 1, 1)
    assert summary["truly_right"] == 0.25 and summary["right_place"] == 0.5
    assert summary["truly_right_low"] < 0.25 and summary["cut_s_mean"] == 3.0


def test_false_stops_are_counted_and_runs_from_before_them_have_none() -> None:
    rows = [dataclasses.replace(run(cut()), stops=2, false_stops=1), dataclasses.replace(run(cut()), stops=1)]
    summary, work = summarise(rows), work_of(rows)
    assert (summary["stops"], summary["false_stops"]) == (3, 1)
    assert (work.stops, work.false_stops) == (3, 1) and "1 of them with nothing touched" in told_stops(work)
