"""The benchmark of a whole vine: how its reviewer decides, what it counts, what it refuses, and its picture."""

import json
from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.control import vine as bench
from benchmarks.control.cut_truth import OLD_CANE, STUB, wanted_cuts
from benchmarks.control.row_report import Cut
from benchmarks.control.vine_plot import draw_vine
from bridge.sim import build
from bridge.sim.vineyard.config import VineyardConfig, load_vineyard
from bridge.sim.vineyard.grow import grow
from bridge.sim.vineyard.row import Row
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.errors import InputError
from tests.support.points import point

ROW = grow(VineyardConfig(vines=1), 3)
WANTED = wanted_cuts(ROW)


# --- the reviewer -----------------------------------------------------------------------------------------------------


class Page:
    """What a reviewer needs of a loop: points and places along a row that change as they are decided."""

    def __init__(self, points, sites=(), refuses=(), changes=()):
        self.now, self.points, self.sites = 0.0, {each.point_id: each for each in points}, list(sites)
        self.states = dict.fromkeys(self.points, "PROPOSED")
        self.refuses, self.changes, self.asked = refuses, list(changes), []
        self.inbox = SimpleNamespace(newest=lambda kind: SimpleNamespace(message=self.shown()))
        self.perception = SimpleNamespace(answer=self.leave)

    def shown(self):
        return m.PruningPoints(
            header=m.Header(self.now, "odom"),
            segmenter="none",
            frames=1,
            points=tuple(self.points.values()),
            undecided_sites=tuple(self.sites),
        )

    def queue(self, *states):
        return (
            m.QueueEntry(point_id=name, state=state, accepted_position=self.points[name].position)
            for name, state in self.states.items()
            if state in states
        )

    def run(self, seconds):
        self.now += seconds
        if self.changes and self.now >= self.changes[0][0]:
            _, name = self.changes.pop(0)
            self.points[name] = msgspec.structs.replace(self.points[name], revision=self.points[name].revision + 1)

    def command(self, asked):
        self.asked.append((round(self.now, 1), asked))
        if asked.point_id in self.refuses:
            return m.Answer(ok=False, reason=reasons.point_unseen(asked.point_id))
        assert asked.revision == self.points[asked.point_id].revision
        self.states[asked.point_id] = "ACCEPTED"
        return m.Answer(ok=True)

    def leave(self, asked):
        self.asked.append((round(self.now, 1), asked))
        return m.Answer(ok=True)


def at(name, vine, spur, **changes):
    return point(name, (0.1 * spur, 0.75, 1.0), vine=vine, spur=spur, **changes)


def place(spur, needs="operator"):
    return m.UndecidedSite(reason=reasons.no_cane_followed(), needs=needs, vine=1, spur=spur)


def told(page):
    return [getattr(asked, "point_id", f"place {getattr(asked, 'spur', '')}") for _, asked in page.asked]


def test_the_reviewer_goes_along_the_row_and_places_that_can_wait_come_last():
    page = Page(
        [at("c", 1, 4), at("a", 1, 1), at("b", 1, 2)], [place(3), place(1, "another look"), place(5, "nothing")]
    )
    reviewer = bench.Reviewer(page, 3.0, "each")
    reviewer.decide()
    assert told(page) == ["a", "b", "place 3", "c", "place 1"]
    assert reviewer.decisions == 5 and set(reviewer.accepted) == {"a", "b", "c"} and not reviewer.refusals
    assert page.now == pytest.approx(5 * 3.0, abs=0.8)


def test_a_cut_that_changes_while_it_is_looked_at_is_accepted_as_it_is_then_and_a_moment_later():
    page = Page([at("a", 1, 1)], changes=[(0.9, "a")])
    bench.Reviewer(page, 1.0, "each").decide()
    ((when, asked),) = page.asked
    assert asked.revision == 2 and 1.6 <= when <= 1.8


def test_a_refused_acceptance_is_asked_twice_and_told_with_its_code():
    page = Page([at("a", 1, 1), at("b", 1, 2)], refuses=("a",))
    reviewer = bench.Reviewer(page, 1.0, "each")
    reviewer.decide()
    assert told(page) == ["a", "b", "a"]
    assert reviewer.refusals == {"a": "point_unseen"} and set(reviewer.accepted) == {"b"}


def test_sure_cuts_and_places_of_a_vine_take_three_presses_and_a_glance_each_and_the_others_one():
    page = Page([at("a", 1, 1), at("b", 1, 2), at("c", 1, 3, confidence=0.5)], [place(4), place(5, "another look")])
    reviewer = bench.Reviewer(page, 2.0, "vine", 0.5)
    reviewer.decide()
    assert told(page) == ["a", "b", "place 4", "place 5", "c"]
    assert (reviewer.decisions, reviewer.glances) == (4, 4) and set(reviewer.accepted) == {"a", "b", "c"}
    assert reviewer.unsure == {"c"}
    assert page.now == pytest.approx(4 * 2.0 + 4 * 0.5, abs=0.5)


def test_a_cut_that_changes_after_a_glance_is_looked_at_again_and_accepted_as_it_is_then():
    page = Page([at(name, 1, k) for k, name in enumerate("abcd")], changes=[(2.4, "a")])
    reviewer = bench.Reviewer(page, 1.0, "vine", 0.5)
    reviewer.decide()
    assert [asked.revision for _, asked in page.asked] == [2, 1, 1, 1]
    assert (reviewer.decisions, reviewer.glances) == (2, 5) and not reviewer.refusals


def test_a_cut_that_changes_at_the_press_is_refused_and_asked_again():
    page = Page([at(name, 1, k) for k, name in enumerate("abcd")], refuses=("b",))
    reviewer = bench.Reviewer(page, 1.0, "vine", 0.5)
    reviewer.decide()
    assert told(page) == ["a", "b", "c", "d", "b"] and reviewer.refusals == {"b": "point_unseen"}


def test_a_place_keeps_the_reason_for_which_it_was_left_whatever_is_cut_beside_it():
    page = Page([], [place(3)])
    reviewer = bench.Reviewer(page, 1.0, "each")
    reviewer.decide()
    page.sites = [msgspec.structs.replace(place(3), reason=reasons.pruned_already(0.0, 2.0))]
    reviewer.decide()
    assert reviewer.left == [place(3)] and reviewer.decisions == 1


def test_few_cuts_are_decided_one_by_one():
    page = Page([at("a", 1, 1), at("b", 1, 2)], [place(3)])
    reviewer = bench.Reviewer(page, 1.0, "vine", 0.5)
    reviewer.decide()
    assert told(page) == ["a", "b", "place 3"] and (reviewer.decisions, reviewer.glances) == (3, 0)


def test_a_reviewer_who_decides_nothing_asks_for_nothing():
    page = Page([at("a", 1, 1)], [place(2)])
    reviewer = bench.Reviewer(page, 3.0, "nothing")
    reviewer.decide()
    assert not page.asked and reviewer.decisions == 0 and not reviewer.accepted


# --- the judge --------------------------------------------------------------------------------------------------------


def asked_for(count):
    return [each for each in WANTED if each.cut is not None and each.kind == "spur cut"][:count]


def bite(each, past=0.0):
    where = each.cut.best + past * each.cut.tangent
    # As the trace has it: wood that is no cane has no cane's number.
    kind, cane = {STUB: ("spur", -1), OLD_CANE: ("cordon", -1)}.get(each.cane, ("cane", each.cane))
    piece = {"vine": each.vine, "spur": each.spur, "cane": cane, "kind": kind, "point": where.tolist()}
    return {"event": "cut", "point_id": f"p{each.spur}", "code": "wood_severed", "severed": [piece]}


def proposal(each):
    return point(f"p{each.spur}", tuple(each.cut.best.tolist()), vine=1, spur=each.spur)


def test_every_cut_that_the_vine_asks_for_has_one_outcome_with_its_reason():
    right, harmed, refused, void, open_, unseen = asked_for(6)
    points = {f"p{each.spur}": proposal(each) for each in (right, harmed, refused, void)}
    accepted = {name: m.QueueEntry(point_id=name, state="ACCEPTED") for name in points if name != f"p{void.spur}"}
    reviewer = SimpleNamespace(points=points, accepted=accepted, refusals={f"p{void.spur}": "point_unseen"})
    ends = {name: m.QueueEntry(point_id=name, state="DONE") for name in accepted}
    ends[f"p{refused.spur}"] = m.QueueEntry(
        point_id="x", state="UNREACHABLE", reason=reasons.not_reachable(reasons.out_of_reach(0.9, 1.6))
    )
    stub = next(rod for _, rod in ROW.standing() if rod.kind == "spur" and rod.spur == open_.spur)
    site = m.UndecidedSite(
        reason=reasons.cane_end_unclear(), needs="operator", vine=1, spur=9, position=tuple(stub.end.tolist())
    )
    earlier = msgspec.structs.replace(site, reason=reasons.cane_base_hidden())
    found = bench.places(ROW, WANTED, [bite(right), bite(harmed, -0.06)], reviewer, ends, [earlier, site])
    assert len(found) == sum(each.cut is not None for each in WANTED)
    outcome = {(each.spur, each.kind): (each.outcome, each.reason) for each in found}
    assert outcome[right.spur, "spur cut"] == ("right", "")
    assert outcome[harmed.spur, "spur cut"][0] == "wrong" and "cut off" in outcome[harmed.spur, "spur cut"][1]
    assert outcome[refused.spur, "spur cut"] == ("refused", "not_reachable: out_of_reach")
    assert outcome[void.spur, "spur cut"] == ("refused", "point_unseen")
    assert outcome[open_.spur, "spur cut"] == ("undecided", "cane_end_unclear")
    assert outcome[unseen.spur, "spur cut"] == ("unseen", "")


def test_of_a_guyot_vine_both_canes_of_the_spur_are_asked_for_and_its_stub_stays():
    row = grow(VineyardConfig(vines=1, training="guyot"), 3)
    wanted = wanted_cuts(row, guyot=True)
    assert [each.kind for each in wanted if each.cut is not None] == ["spur cut", "cane cut", "removal"]
    reviewer = SimpleNamespace(points={}, accepted={}, refusals={})
    lower, upper, stub, _ = wanted
    found = bench.places(row, wanted, [bite(lower), bite(upper)], reviewer, {}, [])
    assert [each.outcome for each in found] == ["right", "right", "unseen"]
    piece = {"vine": 0, "spur": 0, "cane": STUB, "kind": "spur", "point": [0.0, 0.0, 0.0]}
    assert "stays" in bench.true_cut([stub], [piece]).harm


def test_the_removal_of_last_years_cane_is_asked_for_and_has_its_own_reason():
    row = grow(VineyardConfig(vines=1, training="guyot"), 3)
    wanted = wanted_cuts(row, guyot=True)
    lower, upper, _, old = wanted
    reviewer = SimpleNamespace(points={}, accepted={}, refusals={})
    stub = next(rod for _, rod in row.standing() if rod.kind == "spur")

    def outcomes(bites, *told):
        sites = [
            m.UndecidedSite(reason=each, needs="operator", vine=1, spur=1, position=tuple(stub.end.tolist()))
            for each in told
        ]
        found = bench.places(row, wanted, bites, reviewer, {}, sites)
        return [(each.kind, each.outcome, each.reason) for each in found]

    few = reasons.nodes_lacking(5, 8)
    for told in ([reasons.old_cane_unseen(), few], [few, reasons.old_cane_unseen()]):
        assert outcomes([bite(lower)], *told) == [
            ("spur cut", "right", ""),
            ("cane cut", "undecided", "nodes_lacking"),
            ("removal", "undecided", "old_cane_unseen"),
        ]
    # Whoever leaves the whole spur to a person leaves that cane, too; nothing told of it is nothing seen.
    assert outcomes([], few)[2] == ("removal", "undecided", "nodes_lacking")
    assert [each[1] for each in outcomes([bite(lower), bite(upper)], reasons.old_cane_unseen())[:2]] == ["right"] * 2
    assert outcomes([])[2] == ("removal", "unseen", "")
    assert outcomes([bite(old)])[2] == ("removal", "right", "")
    _, outcome, harm = outcomes([bite(old, -0.03)])[2]
    assert outcome == "wrong" and "the head that stays" in harm
    assert outcomes([bite(old, 0.2)])[2][1] == "wrong", "shoots of last year's cane stay"


def test_a_removal_that_was_proposed_has_its_own_outcome_wherever_on_last_years_cane():
    row = grow(VineyardConfig(vines=1, training="guyot"), 3)
    wanted = wanted_cuts(row, guyot=True)
    old = wanted[-1]
    shoot = next(rod for _, rod in row.standing() if rod.spur == 1 and rod.cane == 0)
    for place in (old.cut.best, shoot.start + 0.6 * (shoot.end - shoot.start)):
        told = point("r", tuple(place.tolist()), vine=1, spur=1, kind="removal", cane=-1)
        ended = m.QueueEntry(point_id="r", state="UNREACHABLE", reason=reasons.out_of_reach(0.9, 1.6))
        reviewer = SimpleNamespace(points={"r": told}, accepted={"r": ended}, refusals={})
        found = bench.places(row, wanted, [], reviewer, {"r": ended}, [])
        assert [(each.kind, each.outcome, each.reason) for each in found] == [
            ("spur cut", "unseen", ""),
            ("cane cut", "unseen", ""),
            ("removal", "refused", "out_of_reach"),
        ]


class Stopping:
    """A loop whose work ends in protective stops, and goes on after each has been acknowledged and resumed."""

    def __init__(self, stops, cause_s):
        self.now, self.stops, self.cause_s = 0.0, stops, cause_s
        self.controller = SimpleNamespace(mode="READY")
        self.stopped_at, self.starts = 0.0, 0

    def queue(self, *states):
        return iter(())

    def run(self, seconds):
        self.now += seconds

    def run_until(self, condition, limit_s):
        if self.controller.mode == "AUTO":
            self.now += 5.0
            self.controller.mode = "PROTECTIVE_STOP" if self.stops else "READY"
            self.stops, self.stopped_at = max(self.stops - 1, 0), self.now
        end = self.now + limit_s
        while not condition() and self.now < end:
            self.now += 0.5

    def command(self, asked):
        mode = self.controller.mode
        if isinstance(asked, intents.Start) and mode == "READY" and self.starts < 9:
            self.controller.mode, self.starts = "AUTO", self.starts + 1
        elif isinstance(asked, intents.Acknowledge) and self.now > self.stopped_at + self.cause_s:
            self.controller.mode = "PAUSED"
        elif isinstance(asked, intents.Resume) and mode == "PAUSED":
            self.controller.mode = "READY"
        return m.Answer(ok=self.controller.mode != mode)


@pytest.mark.parametrize(("stops", "cause_s", "acknowledged"), [(0, 0.0, 0), (2, 22.0, 2), (1, 60.0, 0), (9, 0.0, 4)])
def test_a_person_looks_at_a_protective_stop_and_the_work_goes_on(monkeypatch, stops, cause_s, acknowledged):
    monkeypatch.setattr(bench, "row_of", lambda loop: None)
    loop = Stopping(stops, cause_s)
    clock = SimpleNamespace(begin=lambda now: None, end=lambda now: None)
    visit = bench.Visit(loop, bench.Reviewer(loop, 1.0, "vine"), clock, 1.0)
    visit.work()
    assert visit.stops == acknowledged and loop.starts == 1 + acknowledged
    assert visit.stages["decisions"] >= 20.0 * acknowledged
    assert loop.controller.mode == ("READY" if acknowledged == stops else "PROTECTIVE_STOP")


# --- the figures ------------------------------------------------------------------------------------------------------


def run(seed=1, outcomes=("right", "refused"), blocked="", harm="", ended="", survey=20.0, decisions=4, **more):
    stages = dict.fromkeys(bench.VINE_STAGES, 0.0) | {"survey": survey, "decisions": 3.0 * decisions}
    cuts = (Cut("hierarchy", seed, "p", "DONE", "", None, None, 0.0, not harm, harm, True, 2, 0.0),)
    places = tuple(bench.Place(k, "spur cut", blocked, each, "") for k, each in enumerate(outcomes))
    return bench.VineRun(
        seed, "spur", "calm", "each", 3.0, stages, decisions, {}, cuts, places, 0, 0, 0, {}, ended, 100.0, **more
    )


def test_without_vines_or_cuts_nothing_is_shared_in_and_nothing_divided():
    for runs in ([], [run(outcomes=(), decisions=0)]):
        figures = bench.summarise(runs)
        assert all(figures[outcome].value is None and figures[outcome].n == 0 for outcome in bench.OUTCOMES)
    assert bench.summarise([])["harmed"].value is None
    assert bench.summarise([run(ended="PAUSED: x")])["machine_s_median"].value is None


def test_shares_are_of_the_cuts_with_room_and_seconds_of_the_vines_that_were_left():
    runs = [
        run(1, ("right", "right", "undecided")),
        run(2, ("wrong", "unseen"), harm="a node", survey=80.0, decisions=2),
        run(3, ("refused",), blocked="wire"),
        run(4, ("right",), ended="PAUSED: x", survey=500.0),
    ]
    figures = bench.summarise(runs)
    assert (figures["right"].value, figures["right"].n) == (pytest.approx(3 / 6), 6)
    assert figures["blocked"].value == pytest.approx(1 / 7)
    assert figures["harmed"].value == figures["machine_60_s"].value - 2 / 3 + 0.25 == 0.25
    assert figures["machine_s_most"].value == 80.0 and figures["left_the_vine"].value == 0.75
    assert figures["both_s_median"].value == 20.0 + 4 * 3.0 + 2.0
    assert figures["person_10_s"].value == pytest.approx(1 / 3), "three decisions of three seconds are more than 10 s"


def test_what_perception_was_sure_of_has_shares_of_its_own_where_that_was_told():
    runs = [run(1, unsure=()), run(2, unsure=(), harm="a node"), run(3, unsure=("p",), harm="a node"), run(4)]
    figures = bench.summarise(runs)
    assert (figures["sure"].value, figures["sure"].n) == (pytest.approx(2 / 3), 3)
    assert (figures["harmed_of_sure"].value, figures["harmed_of_sure"].n) == (0.5, 2)
    assert figures["right_of_sure_made"].value == 0.5
    assert figures["harmed"].value == 0.5 and bench.summarise([run(4)])["harmed_of_sure"].value is None


def test_vines_with_another_time_for_a_look_are_figures_of_their_own():
    assert run(glance_s=0.5).condition == "spur, calm, each 3 s, a look 0.5 s" != run().condition


@pytest.mark.parametrize(
    ("outcomes", "blocked", "harm", "as_ruled", "with_room"),
    [
        (("right", "right"), "", "", True, True),
        (("right", "right"), "wire", "", True, True),
        (("right", "undecided"), "", "", False, False),
        (("unseen",), "", "", False, False),
        (("refused",), "wire", "", False, True),
        (("right", "right"), "", "a node", False, False),
        (("refused",), "wire", "a node", False, False),
    ],
)
def test_a_vine_is_as_the_rule_says_where_every_cut_is_right_and_nothing_that_stays_is_gone(
    outcomes, blocked, harm, as_ruled, with_room
):
    figures = bench.summarise([run(1, outcomes, blocked, harm), run(2, ("wrong",))])
    whole, room = figures["vines_as_the_rule_says"], figures["vines_with_room_as_ruled"]
    assert (whole.value, whole.n) == (as_ruled / 2, 2) and (room.value, room.n) == (with_room / 2, 2)


def test_a_run_goes_on_where_the_last_one_stopped_and_its_file_is_drawn(tmp_path: Path, monkeypatch, capsys):
    made = []

    def pruned(seed, *rest):
        made.append((seed, *rest))
        return run(seed)

    monkeypatch.setattr(bench, "prune_vine", pruned)
    path = tmp_path / "vine.json"
    assert bench.main(["--seed", "7", "--count", "1", "--json", str(path)]) == 0
    assert bench.main(["--seed", "7", "--count", "2", "--json", str(path)]) == 0
    assert made == [(seed, "spur", "calm", "each", 3.0, 2.0, "", 0.33, "standard", "hierarchy") for seed in (7, 8)]
    document = json.loads(path.read_text())
    assert document["summary"]["spur, calm, each 3 s"]["right"] == pytest.approx(
        {"value": 0.5, "low": 0.15, "high": 0.85, "n": 4}, abs=0.01
    )
    assert bench.read(path) == [run(7), run(8)]
    assert "seed 8" in capsys.readouterr().out
    figure = Figure()
    draw_vine(tmp_path, figure)
    (panel,) = figure.axes
    assert "2 vines" in panel.get_title(loc="left")
    widths = [bar.get_width() for bar in panel.patches if bar.get_width() > 0.0]
    assert sorted(widths) == [12.0, 12.0, 20.0, 20.0]
    (tmp_path / "vine_guyot.json").write_text(path.read_text().replace('"spur"', '"guyot"'))
    figure = Figure()
    draw_vine(tmp_path, figure)
    assert [panel.get_title(loc="left").split(",")[0] for panel in figure.axes] == ["spur", "guyot"]
    (tmp_path / "vine_other.json").write_text("{}")
    with pytest.raises(InputError, match="vine_other"):
        draw_vine(tmp_path, Figure())


def test_without_vines_there_is_no_picture_of_them(tmp_path: Path):
    with pytest.raises(FileNotFoundError):
        draw_vine(tmp_path, Figure())


def test_vines_of_another_cultivar_or_method_are_figures_of_their_own(tmp_path: Path, monkeypatch, capsys):
    made = []

    def pruned(seed, *rest):
        made.append(rest[-2:])
        return run(seed, cultivar=rest[-2], method=rest[-1])

    monkeypatch.setattr(bench, "prune_vine", pruned)
    path = tmp_path / "vine.json"
    for words in ([], ["--cultivar", "vigorous"], ["--cultivar", "vigorous"], ["--method", "decoupled"]):
        assert bench.main(["--seed", "7", "--count", "1", "--json", str(path), *words]) == 0
    assert made == [("standard", "hierarchy"), ("vigorous", "hierarchy"), ("standard", "decoupled")], "one is on file"
    assert set(json.loads(path.read_text())["summary"]) == {
        "spur, calm, each 3 s",
        "spur, vigorous, calm, each 3 s",
        "decoupled: spur, calm, each 3 s",
    }
    assert capsys.readouterr().out.count("spur, vigorous, calm, each 3 s, seed 7:") == 2
    figure = Figure()
    draw_vine(tmp_path, figure)
    assert [panel.get_title(loc="left") for panel in figure.axes] == [
        "spur, calm, each 3 s a decision (1 vines)",
        "spur, vigorous, calm, each 3 s a decision (1 vines)",
        "decoupled: spur, calm, each 3 s a decision (1 vines)",
    ]


def test_a_file_from_before_there_were_cultivars_and_methods_has_vines_of_the_usual_ones(tmp_path: Path):
    path = tmp_path / "vine.json"
    document = bench.document([run(7)], 2.0, "")
    for each in document["results"]:
        del each["cultivar"], each["method"]
    path.write_text(json.dumps(document))
    assert bench.read(path) == [run(7)] and bench.read(path)[0].cultivar == "standard"
    draw_vine(tmp_path, Figure())


def test_a_cultivar_is_the_preset_of_the_vineyard_that_the_robot_stands_in(tmp_path: Path):
    settings = bench.one_vine("guyot", 1.8, "drooping")
    got = load_vineyard(bench.sim_config(tmp_path / "vine.toml", 2.0, bench.PRESETS["calm"], settings))
    assert (got.preset, got.training, got.vines) == ("drooping", "guyot", 1)
    assert got.cane_droop == bench.CULTIVARS["drooping"].cane_droop != VineyardConfig().cane_droop


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"results": [{"seed": 1}]}'])
def test_a_file_of_something_else_is_refused_and_stays(tmp_path: Path, text):
    path = tmp_path / "vine.json"
    path.write_text(text)
    with pytest.raises(InputError, match="bench vine"):
        bench.main(["--count", "1", "--json", str(path)])
    assert path.read_text() == text
    with pytest.raises((InputError, ValueError)):
        draw_vine(tmp_path, Figure())


@pytest.mark.parametrize(
    "words",
    [
        ["--preset", "hail"],
        ["--training-system", "bush"],
        ["--cultivar", "oak"],
        ["--method", "magic"],
        ["--count", "0"],
        ["--decision", "-1"],
        ["--decision", "x"],
    ],
)
def test_what_it_does_not_know_is_refused_before_anything_runs(words, capsys):
    with pytest.raises(SystemExit):
        bench.main(words)
    assert words[0] in capsys.readouterr().err


def test_an_unknown_world_is_refused_with_those_that_there_are():
    with pytest.raises(InputError, match="calm, field, storm"):
        bench.prune_vine(1, preset="hail")


def test_an_unknown_cultivar_is_refused_with_those_that_there_are():
    with pytest.raises(InputError, match="'oak'; known are standard, short_internodes, vigorous, drooping"):
        bench.prune_vine(1, cultivar="oak")


# --- whole vines ------------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_vine_that_nobody_decides_about_is_surveyed_left_and_told():
    found = bench.prune_vine(3, review="nothing", segmenter="labels", pictures=0.7)
    assert found.ended == "" and found.decisions == 0 and not found.cuts
    assert {each.outcome for each in found.places} <= {"undecided", "unseen"}
    assert found.stages["survey"] > 12.0 and found.stages["blades"] == 0.0 and found.contacts == 0


@pytest.mark.long
def test_a_vine_without_canes_asks_for_no_cut_and_gets_none(monkeypatch):
    def bare(config: VineyardConfig, seed: int) -> Row:
        row = grow(config, seed)
        return Row(tuple(None if rod is not None and rod.cane >= 0 else rod for rod in row.rods), 0, row.backdrop)

    monkeypatch.setattr(build, "grow", bare)
    found = bench.prune_vine(3, segmenter="labels", pictures=0.7, decision_s=1.0, method="decoupled")
    assert found.method == "decoupled"
    assert found.ended == "" and not found.places and not found.cuts and found.stages["blades"] == 0.0
    assert np.isfinite(found.machine_s) and bench.summarise([found])["right"].value is None
