"""Faults at the instants around a cut: what the judge sees, and a few with the real processes.

`rolling-panda bench faults --cuts N` has all of them.
"""

import json

import pytest

from benchmarks.faults.cut_faults import INSTANTS, Seen
from benchmarks.faults.cut_judge import Records, judge_cuts
from benchmarks.faults.cut_rig import Told
from benchmarks.faults.run import main


def blade(event, point_id="p1", cut_id="run-1"):
    return {"event": event, "point_id": point_id, "cut_id": cut_id}


def ticket(number, state, point_id="p1", cut_id=""):
    return number, point_id, {"state": state, "cut_id": cut_id}


def left(**changes):
    """A point that was accepted, cut and said to be."""
    told = Told(
        ordered={"run-1": 1.0},
        outcomes={"run-1": "DONE"},
        states={("p1", "ACCEPTED"), ("p1", "CUTTING"), ("p1", "DONE")},
        granted=[("AcceptPoint", "p1"), ("Start", "")],
    )
    values = {
        "blades": [blade("closing"), blade("bite")],
        "tickets": [
            ticket(1, "PROPOSED"),
            ticket(2, "ACCEPTED"),
            ticket(3, "CUTTING", cut_id="run-1"),
            ticket(4, "DONE", cut_id="run-1"),
        ],
        "requests": [
            (5, "ada", {"reason": None, "asked": {"type": "AcceptPoint", "point_id": "p1"}}),
            (6, "ada", {"reason": None, "asked": {"type": "Start"}}),
        ],
        "told": told,
        "problem": "",
        "rows": 6,
    }
    return Records(**(values | changes))


def kinds(records):
    return sorted({finding.kind for finding in judge_cuts(records)})


def test_a_cut_that_all_records_agree_on_is_well():
    assert kinds(left()) == []


def test_blades_that_close_twice_for_one_order_or_one_acceptance_are_found():
    assert kinds(left(blades=[blade("closing"), blade("opened"), blade("closing"), blade("bite")])) == ["double cut"]
    again = [*left().blades, blade("closing", cut_id="run-2"), blade("bite", cut_id="run-2")]
    assert "double cut" in kinds(left(blades=again))


def test_what_was_told_and_is_in_no_row_is_lost():
    whole = left()
    told = whole.tickets[:2] + [ticket(3, "CUTTING", cut_id="run-1"), ticket(4, "UNKNOWN", cut_id="run-1")]
    assert kinds(left(tickets=told)) == ["lost row"]
    assert kinds(left(requests=whole.requests[:1])) == ["lost row"]
    refused = [
        (5, "ada", {"reason": {"code": "busy"}, "asked": {"type": "AcceptPoint", "point_id": "p1"}}),
        whole.requests[1],
    ]
    assert kinds(left(requests=refused)) == ["lost row"]


def test_a_cut_without_an_intent_is_a_lost_row():
    tickets = [row for row in left().tickets if row[2]["state"] != "CUTTING"]
    assert "lost row" in kinds(left(tickets=tickets))


def test_a_point_that_is_said_to_stand_and_is_off_is_untrue():
    tickets = [*left().tickets[:3], ticket(4, "FAILED_NOT_CUT", cut_id="run-1")]
    told = Told(ordered={"run-1": 1.0}, outcomes={"run-1": "FAILED_NOT_CUT"})
    assert kinds(left(tickets=tickets, told=told)) == ["untrue state"]
    assert kinds(left(blades=[blade("closing"), blade("opened")])) == ["untrue state"]


def test_unknown_is_never_untrue():
    tickets = [*left().tickets[:3], ticket(4, "UNKNOWN", cut_id="run-1")]
    told = Told(ordered={"run-1": 1.0})
    for blades in ([], [blade("closing")], [blade("closing"), blade("bite")]):
        assert kinds(left(tickets=tickets, told=told, blades=blades)) == []


def test_who_says_how_a_cut_ended_that_no_bridge_has_told_of_is_found():
    told = left().told
    told.outcomes.clear()
    assert kinds(left(told=told)) == ["certain of the unknown"]
    told.ordered.clear()
    assert kinds(left(told=told)) == [], "what was never ordered was not cut"


def test_a_damaged_ledger_is_found():
    assert kinds(left(problem="row 3 is not as it was written")) == ["damaged ledger"]


def test_what_was_hit_is_told_by_what_was_true():
    def hit(*true):
        names = ("intent_written", "closing", "bitten", "outcome_told", "result_written")
        return Seen(**{name: name in true for name in names}).instant

    assert hit() == INSTANTS[0]
    assert hit("intent_written") == INSTANTS[1]
    assert hit("intent_written", "closing") == INSTANTS[2]
    assert hit("intent_written", "closing", "bitten") == INSTANTS[3]
    assert hit("intent_written", "closing", "bitten", "outcome_told", "result_written") == "over"


def test_a_fault_that_there_is_not_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["--cuts", "1", "--only", "the moon"])
    assert "bridge killed" in capsys.readouterr().err


@pytest.mark.alone
@pytest.mark.slow
def test_kills_around_a_cut_cut_nothing_twice_and_lose_nothing(tmp_path):
    file = tmp_path / "cuts.json"
    only = ["bridge killed", "controller killed", "writer killed"]
    assert main(["--cuts", "4", "--seed", "3", "--json", str(file), "--only", *only]) == 0
    found = json.loads(file.read_text())
    assert len(found["trials"]) == 4 * 5 and found["findings"] == []
    # What is there is not done again.
    assert main(["--cuts", "4", "--seed", "3", "--json", str(file), "--only", *only]) == 0
    assert len(json.loads(file.read_text())["trials"]) == 4 * 5
