"""The benchmark in a rough world: which worlds it runs, what it counts, what it refuses, and its picture."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from benchmarks.control import world as bench
from benchmarks.control.row_report import Cut
from benchmarks.control.world_plot import draw_world
from bridge.sim.world.config import CALM, PRESETS, WorldConfig, only
from rolling_panda.errors import InputError
from tests.benchmarks.test_row_report import run


def cut(state="DONE", right=True, harm="", past: float | None = 0.002, nodes: int | None = 2) -> Cut:
    made = past is not None
    return Cut("hierarchy", 1, "p", state, "", None, None, 3.0, right, harm, made, nodes if made else None, past)


def test_each_disturbance_is_run_by_itself_and_every_knob_belongs_to_one() -> None:
    knobs = [knob for group in bench.DISTURBANCES.values() for knob in group]
    assert sorted(knobs) == sorted(WorldConfig.__struct_fields__[1:])
    cases = bench.conditions(tuple(PRESETS), True, {})
    assert len(cases) == 1 + 2 * len(bench.DISTURBANCES) and cases[0].world == CALM
    slip = next(case for case in cases if (case.name, case.level) == ("slip", "storm"))
    assert slip.world == only(("slip",), "storm") and slip.world.sway == 0.0 < slip.world.slip
    assert [case.world for case in bench.conditions(("field",), False, {})] == [PRESETS["field"]]
    (given,) = bench.conditions((), False, {"hand_eye_angle": 0.01})
    assert given.world.hand_eye_angle == 0.01 and given.world.slip == 0.0


def test_a_knob_without_such_a_name_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(InputError, match=r"hand_eye: known are hand_eye_angle, "):
        bench.conditions((), False, {"hand_eye": 0.01})
    with pytest.raises(SystemExit):
        bench.main(["--knob", "slip"])
    with pytest.raises(SystemExit):
        bench.main(["--each", "--knob", "slip=0.1"])


def test_shares_are_of_the_accepted_and_of_the_cuts_that_were_made() -> None:
    wrong, harmful = cut(right=False, past=0.04, nodes=3), cut(right=False, harm="a node", past=-0.03, nodes=1)
    void, refused = cut("PROPOSED", False, past=None), cut("FAILED_NOT_CUT", False, past=None)
    figures = bench.summarise([run(cut(), cut(), wrong), run(harmful, void, refused, cut("UNKNOWN", past=0.001))])
    assert (figures["right"].value, figures["right"].n) == (pytest.approx(3 / 7), 7)
    assert (figures["right_of_made"].value, figures["right_of_made"].n) == (pytest.approx(3 / 5), 5)
    assert figures["right_nodes_of_made"].value == pytest.approx(3 / 5)
    assert [figures[name].value for name in ("void", "refused", "unknown", "harmed")] == [pytest.approx(1 / 7)] * 4
    low, high = figures["right"].low, figures["right"].high
    assert low is not None and high is not None and low < 3 / 7 < high


def test_what_the_truth_leaves_no_room_for_is_no_failure_of_the_robot() -> None:
    blocked = replace(cut("UNREACHABLE", False, past=None), blocked="cane")
    figures = bench.summarise([run(cut(), cut(right=False), blocked, replace(cut(), blocked="wire"))])
    assert (figures["right"].value, figures["right"].n) == (pytest.approx(2 / 4), 4)
    assert (figures["right_of_possible"].value, figures["right_of_possible"].n) == (pytest.approx(1 / 2), 2)


def test_outcomes_are_held_against_what_was_severed() -> None:
    severed, missed = replace(cut(), tool_error=0.001, distance=0.001), replace(cut(), tool_error=0.001, distance=None)
    told_not_cut = replace(severed, state="FAILED_NOT_CUT")
    asked, never = replace(severed, state="UNKNOWN"), cut("FAILED_NOT_CUT", False, past=None)
    rightly_not = replace(missed, state="FAILED_NOT_CUT")
    figures = bench.summarise([run(severed, missed, told_not_cut, asked, rightly_not, never)])
    assert (figures["told_falsely"].value, figures["told_falsely"].n) == (pytest.approx(2 / 5), 5)
    assert figures["asked_of_person"].value == pytest.approx(1 / 5)


def test_minutes_of_work_for_a_stop_are_told_beside_the_times_a_person_came() -> None:
    work = bench.work_of([replace(run(cut()), stops=1, cleared=2, auto_s=90.0), replace(run(cut()), auto_s=210.0)])
    assert work == bench.Work(minutes=5.0, stops=1, stops_cleared=2)
    assert "1 in 5.0 min of work, one in 5.0 min" in bench.told_stops(work)
    assert "one in" not in bench.told_stops(bench.work_of([run(cut())]))


@pytest.mark.long
def test_what_was_run_is_on_disk_and_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    worlds: list[tuple[int, WorldConfig]] = []
    offsets: list[float] = []

    def worked_off(
        seed, points, method, pictures, segmenter, world, checked, localise, supervised, servo, frame_time_offset
    ):
        worlds.append((seed, world))
        offsets.append(frame_time_offset)
        return run() if world.depth_lost == PRESETS["storm"].depth_lost else run(cut(), cut(right=world == CALM))

    monkeypatch.setattr(bench, "cut_row", worked_off)
    path = tmp_path / "world.json"
    assert bench.main(["--count", "2", "--json", str(path)]) == 0
    assert [seed for seed, _ in worlds] == [2000, 2001] * 3
    assert [world for _, world in worlds[::2]] == list(PRESETS.values())
    summary = json.loads(path.read_text())["summary"]
    assert summary["all, calm"]["right"]["value"] == 1.0 and summary["all, field"]["right"]["value"] == 0.5
    assert summary["all, storm"]["right"]["value"] is None, "nothing was proposed"
    assert bench.main(["--each", "--count", "1", "--json", str(tmp_path / "world_each.json")]) == 0
    assert set(offsets) == {0.0}
    assert bench.main(["--preset", "storm", "--calibrated", "--count", "1", "--json", str(tmp_path / "c.json")]) == 0
    (_, storm), late = worlds[-1], offsets[-1]
    assert storm.hand_eye_angle < PRESETS["field"].hand_eye_angle and storm.slip == PRESETS["storm"].slip
    assert late == PRESETS["storm"].frame_delay
    figure = Figure()
    draw_world(tmp_path, figure)
    assert {axes.get_title() for axes in figure.axes if axes.get_visible()} >= {"all (n 4)", "slip (n 2)"}
    with pytest.raises(FileNotFoundError):
        draw_world(tmp_path / "nowhere", Figure())
