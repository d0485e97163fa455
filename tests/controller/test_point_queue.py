import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.config import WorkConfig
from controller.ledger.journal import Journal, TicketRow
from controller.work.point_queue import PointQueue
from rolling_panda import messages as m
from rolling_panda import reasons
from tests.support.points import point as pruning_point

POINT = pruning_point("a", (1.0, 0.85, 1.0), revision=3, confidence=0.8)


def point(point_id="a", **changes):
    return msgspec.structs.replace(POINT, point_id=point_id, **changes)


def shown(*points):
    return m.PruningPoints(header=m.Header(), segmenter="none", frames=1, points=points)


def queue(*points):
    q = PointQueue(WorkConfig())
    q.update(shown(*points))
    return q


def state(q, point_id="a"):
    return q.get(point_id).state


def test_acceptance_binds_what_the_operator_saw():
    q = queue(point())
    assert q.accept("a", 3, "ada") is None
    q.update(shown(point(revision=4, position=(1.0, 0.853, 1.0))))
    assert state(q) == "ACCEPTED"
    assert q.next().accepted.position == (1.0, 0.85, 1.0)
    assert q.entries()[0].accepted_position == (1.0, 0.85, 1.0)
    assert q.entries()[0].user == "ada"


def test_accepting_an_old_view_is_refused():
    q = queue(point())
    assert q.accept("a", 2, "ada") == reasons.point_revised("a", 2, 3)
    assert state(q) == "PROPOSED"


def test_the_same_cut_stays_accepted_however_far_the_picture_moves_and_the_operator_is_told_how_far():
    q = queue(point())
    q.accept("a", 3, "ada")
    assert q.update(shown(point(revision=4, position=(1.0, 0.86, 1.02)))) == []
    assert state(q) == "ACCEPTED" and q.next().accepted == POINT
    assert q.entries()[0].reason == reasons.seen_elsewhere(22.0)
    q.update(shown(point(revision=5, position=(1.0, 0.85, 1.001))))
    assert q.entries()[0].reason is None


def test_another_cane_another_count_or_a_cane_that_turned_is_not_accepted_any_more():
    turned = {"tangent": (0.0, 0.5, 0.866)}
    for changes in ({"cane": 1}, {"spur": 2}, {"vine": 1}, {"kind": "renewal cut"}, {"nodes_kept": 3}, turned):
        q = queue(point())
        q.accept("a", 3, "ada")
        voided = q.update(shown(point(revision=4, **changes)))
        assert len(voided) == 1 and voided[0] == reasons.acceptance_lost("a", q.get("a").reason)
        assert state(q) == "PROPOSED" and q.next() is None
        assert q.get("a").reason.code == "acceptance_void"


def test_after_a_restart_of_perception_numbers_mean_nothing_and_the_place_decides():
    def after_restart(**changes):
        q = queue()
        q.update(m.PruningPoints(header=m.Header(), segmenter="none", frames=90, points=(point(),)))
        q.accept("a", 3, "ada")
        for frames in (4, 5):
            q.update(m.PruningPoints(header=m.Header(), segmenter="none", frames=frames, points=(point(**changes),)))
        return state(q)

    assert after_restart(spur=3, cane=2, position=(1.0, 0.85, 1.004)) == "ACCEPTED"
    assert after_restart(position=(1.0, 0.85, 1.006)) == "PROPOSED"
    assert after_restart(nodes_kept=3) == "PROPOSED"


def test_after_a_restart_the_new_numbers_tell_the_cane():
    q = queue()

    def see(frames, cane):
        q.update(m.PruningPoints(header=m.Header(), segmenter="none", frames=frames, points=(point(cane=cane),)))

    see(90, 0)
    q.accept("a", 3, "ada")
    see(4, 2)
    see(5, 2)
    assert state(q) == "ACCEPTED"
    see(6, 3)
    assert state(q) == "PROPOSED" and q.get("a").reason == reasons.acceptance_void(reasons.other_cane())


def test_a_point_that_vanished_is_not_cut_and_a_new_look_is_needed():
    q = queue(point())
    q.accept("a", 3, "ada")
    void = reasons.acceptance_void(reasons.no_longer_reported())
    assert q.update(shown()) == [reasons.acceptance_lost("a", void)]
    assert q.next() is None
    assert q.accept("a", 3, "ada") == reasons.point_unseen("a")
    q.update(shown(point()))
    assert q.accept("a", 3, "ada") is None


def test_a_point_behind_the_blades_may_vanish():
    q = queue(point())
    q.accept("a", 3, "ada")
    assert q.update(shown(), keep="a") == []
    assert state(q) == "ACCEPTED"


def test_a_proposal_that_vanished_leaves_the_queue():
    q = queue(point(), point("b"))
    q.update(shown(point("b")))
    assert [e.point_id for e in q.entries()] == ["b"]


def test_a_thick_cane_is_refused():
    q = queue(point(radius=0.009))
    assert q.accept("a", 3, "ada") == reasons.cane_too_thick("a", 18.0, 15.0)


@pytest.mark.parametrize("kind", ["renewal cut", "removal"])
def test_two_year_wood_may_be_thicker(kind):
    q = queue(*(point(name, radius=radius, kind=kind) for name, radius in (("a", 0.009), ("b", 0.011))))
    assert q.accept("a", 3, "ada") is None
    assert q.accept("b", 3, "ada") == reasons.cane_too_thick("b", 22.0, 20.0)


def test_order_of_work_is_along_the_row():
    q = queue(point("far", position=(2.0, 0.8, 1.0)), point("near", position=(-0.5, 0.9, 1.0)), point("mid"))
    assert [e.point_id for e in q.entries()] == ["near", "mid", "far"]
    q.accept("far", 3, "ada")
    assert q.next().point.point_id == "far"
    q.accept("mid", 3, "ada")
    assert q.next().point.point_id == "mid"


def test_life_of_a_cut_point():
    q = queue(point())
    q.accept("a", 3, "ada")
    q.begin_cut("a", "cut-1")
    assert (state(q), q.entries()[0].cut_id) == ("CUTTING", "cut-1")
    assert q.reject("a", "ada", "no") == reasons.point_state("a", "CUTTING")
    q.resolve("a", "DONE", reasons.cutter_cut())
    assert q.accept("a", 3, "ada") == reasons.point_state("a", "DONE")
    q.update(shown())
    assert state(q) == "DONE"


def test_an_unknown_or_failed_cut_waits_for_a_person():
    for outcome in ("UNKNOWN", "FAILED_NOT_CUT"):
        q = queue(point())
        q.accept("a", 3, "ada")
        q.begin_cut("a", "cut-1")
        q.resolve("a", outcome, reasons.cutter_unsure())
        assert q.next() is None
        if outcome == "UNKNOWN":
            assert q.accept("a", 3, "eve") == reasons.outcome_undecided("a")
            assert q.reject("a", "eve", "no") == reasons.point_state("a", "UNKNOWN")
            assert q.proposed(0.0) == []
            assert q.decide("a", "FAILED_NOT_CUT", "eve", "the cane stands") is None
            assert q.get("a").reason == reasons.inspected("eve", "the cane stands")
        assert q.accept("a", 3, "eve") is None


def test_what_a_person_saw_ends_an_unknown_cut_and_nothing_else():
    q = queue(point())
    assert q.decide("a", "DONE", "eve", "cut") == reasons.outcome_known("a", "PROPOSED")
    assert q.decide("z", "DONE", "eve", "cut") == reasons.point_unknown("z")
    q.accept("a", 3, "ada")
    q.begin_cut("a", "cut-1")
    assert q.decide("a", "DONE", "eve", "cut") == reasons.outcome_known("a", "CUTTING")
    q.resolve("a", "UNKNOWN", reasons.cutter_unsure())
    assert q.decide("a", "DONE", "eve", "the cane is off") is None
    assert (state(q), q.get("a").cut_id) == ("DONE", "cut-1")
    assert q.accept("a", 3, "eve") == reasons.point_state("a", "DONE")


def test_a_finished_cut_can_be_called_wrong_and_right_again_and_is_recorded_each_time():
    journal = Journal()
    q = PointQueue(WorkConfig(), journal)
    q.update(shown(point()))
    assert q.judge("z", True, "ada") == reasons.point_unknown("z")
    assert q.judge("a", True, "ada") == reasons.point_state("a", "PROPOSED")
    q.accept("a", 3, "ada")
    q.begin_cut("a", "c1")
    q.resolve("a", "DONE", reasons.cutter_cut())
    journal.drain()
    assert q.judge("a", False, "bo") is None and not journal.drain(), "it is not called wrong"
    assert q.judge("a", True, "bo") is None and q.judge("a", True, "cy") is None
    assert q.judge("a", False, "ada") is None and state(q) == "DONE"
    assert [(row.body.wrong_by, row.body.cut_id, row.body.user) for row in journal.drain()] == [
        ("bo", "c1", "ada"),
        ("", "c1", "ada"),
    ]
    restored = PointQueue(WorkConfig())
    restored.restore([msgspec.structs.replace(q_row(q), wrong_by="bo")])
    assert restored.get("a").wrong_by == "bo"


def q_row(q):
    ticket = q.get("a")
    return TicketRow(point=ticket.point, state=ticket.state, cut_id=ticket.cut_id, proposer=ticket.proposer)


def test_the_record_names_the_network_that_proposed_what_was_accepted():
    journal = Journal()
    q = PointQueue(WorkConfig(), journal)
    q.update(m.PruningPoints(header=m.Header(), segmenter="network a.onnx 1111", frames=1, points=(point(),)))
    q.update(m.PruningPoints(header=m.Header(), segmenter="network b.onnx 2222", frames=2, points=(point(),)))
    q.accept("a", 3, "ada")
    hand = point("h", kind="by hand")
    q.update(m.PruningPoints(header=m.Header(), segmenter="network c.onnx 3333", frames=3, points=(point(), hand)))
    q.accept("h", 3, "ada")
    told = {row.name: row.body.proposer for row in journal.drain() if row.body.state == "ACCEPTED"}
    assert told == {"a": "network b.onnx 2222", "h": ""}
    assert q.get("a").proposer == "network b.onnx 2222", "another network since then did not propose it"


def test_rejected_points_are_not_proposed_and_unknown_ones_are_named():
    q = queue(point(), point("b", confidence=0.4))
    assert q.reject("a", "ada", "keep this one") is None
    assert (q.entries()[0].state, q.entries()[0].reason) == ("REJECTED", reasons.said("keep this one"))
    assert [p.point_id for p in q.proposed(0.0)] == ["b"]
    assert q.proposed(0.5) == []
    assert q.accept("zz", 1, "ada") == reasons.point_unknown("zz")
    assert q.reject("zz", "ada", "") == reasons.point_unknown("zz")


def test_accepted_points_follow_an_order_asked_for_and_the_others_keep_their_places():
    places = {"a": 0.1, "b": 0.3, "c": 0.5, "d": 0.7}
    q = queue(*(point(i, position=(x, 0.75, 1.0)) for i, x in places.items()))
    for point_id in ("a", "c", "d"):
        assert q.accept(point_id, q.get(point_id).point.revision, "ada") is None
    q.arrange(("d", "a", "c"))
    assert [e.point_id for e in q.entries()] == ["d", "b", "a", "c"]
    assert q.next().point.point_id == "d"
    q.begin_cut("d", "cut-1")
    q.resolve("d", "DONE", "cut")
    assert q.next().point.point_id == "a"
    q.arrange(())
    assert [e.point_id for e in q.entries()] == ["a", "b", "c", "d"]


def test_another_content_than_was_seen_is_refused():
    queue = PointQueue(WorkConfig())
    point = msgspec.structs.replace(POINT, digest="ab" * 16)
    queue.update(m.PruningPoints(header=m.Header(), segmenter="s", frames=1, points=(point,)))
    refused = queue.accept(point.point_id, point.revision, "Ada", "cd" * 16)
    assert refused == reasons.point_replaced(point.point_id, "abababab", "cdcdcdcd")
    assert queue.entries()[0].digest == ""
    assert queue.accept(point.point_id, point.revision, "Ada", point.digest) is None
    assert queue.entries()[0].digest == point.digest


def test_a_decision_is_taken_back_until_the_cut_begins():
    queue = PointQueue(WorkConfig())
    queue.update(m.PruningPoints(header=m.Header(), segmenter="s", frames=1, points=(POINT,)))
    assert queue.reconsider("a", "Ada") == reasons.nothing_to_take_back("a", "PROPOSED")
    assert queue.accept("a", POINT.revision, "Ada") is None and queue.reconsider("a", "Ada") is None
    assert queue.entries()[0].state == "PROPOSED" and queue.next() is None
    assert queue.reject("a", "Ada", "wrong cane") is None and queue.reconsider("a", "Ada") is None
    assert queue.entries()[0].state == "PROPOSED" and queue.entries()[0].reason is None
    assert queue.accept("a", POINT.revision, "Ada") is None
    queue.begin_cut("a", "c1")
    assert queue.reconsider("a", "Ada") == reasons.nothing_to_take_back("a", "CUTTING")


REFUSED = {"a": reasons.no_square_approach()}


def beyond(*others):
    """A queue whose accepted point `a` no plan reaches."""
    q = queue(point(), *others)
    q.accept("a", 3, "ada")
    assert q.reach(q.accepted(), REFUSED)
    return q


def test_what_the_plan_refuses_is_neither_accepted_nor_worked_on_and_says_why():
    q = beyond(point("b", position=(2.0, 0.85, 1.0)))
    assert (state(q), q.get("a").reason) == ("UNREACHABLE", REFUSED["a"])
    assert q.next() is None and q.waits == reasons.none_reachable(1)
    assert q.accepted() == (point(),), "the next plan is asked about it again"
    assert q.count("ACCEPTED") == 0 and q.count("UNREACHABLE") == 1
    assert not q.reach(q.accepted(), REFUSED), "the same again is nothing new"
    assert q.accept("a", 3, "eve") == reasons.point_unreachable("a", REFUSED["a"])
    q.accept("b", 3, "ada")
    assert q.next().point.point_id == "b" and q.waits is None
    assert q.move("a", "b", 0, "ada") == reasons.unreachable_in_order("a", REFUSED["a"])


def test_it_is_accepted_again_when_a_plan_reaches_it_or_somebody_turns_its_approach():
    q = beyond()
    q.reach(q.accepted(), {})
    assert (state(q), q.get("a").reason, q.get("a").user) == ("ACCEPTED", None, "ada")
    q = beyond()
    assert q.turn("a", 0.5, "ada") is None and state(q) == "ACCEPTED"


def test_a_plan_says_nothing_of_what_was_accepted_otherwise_or_is_worked_on():
    q = queue(point())
    q.accept("a", 3, "ada")
    assert not q.reach((point(revision=2),), REFUSED)
    assert not q.reach(q.accepted(), REFUSED, busy="a")
    assert state(q) == "ACCEPTED"


def test_an_acceptance_out_of_reach_is_void_like_any_other_and_can_be_taken_back():
    q = beyond()
    (lost,) = q.update(shown(point(revision=4, cane=1)))
    assert lost.code == "acceptance_lost" and lost.values[1][1].code == "acceptance_void"
    assert state(q) == "PROPOSED"
    q = beyond()
    assert [lost.code for lost in q.update(shown())] == ["acceptance_lost"]
    q = beyond()
    assert q.reconsider("a", "ada") is None and state(q) == "PROPOSED" and q.waits == reasons.none_accepted()


STEPS = st.lists(st.sampled_from(["refuse", "reach", "accept", "back", "reject", "move", "gone", "seen"]), max_size=30)


@given(STEPS)
def test_whatever_happens_only_what_somebody_accepted_is_out_of_reach_and_what_is_is_never_next(steps):
    q = queue(point())
    revision = 3
    for step in steps:
        if step in ("refuse", "reach"):
            q.reach(q.accepted(), REFUSED if step == "refuse" else {})
        elif step == "accept":
            q.accept("a", revision, "ada")
        elif step == "back":
            q.reconsider("a", "ada")
        elif step == "reject":
            q.reject("a", "ada", "")
        elif step == "move":
            revision += 1
            q.update(shown(point(revision=revision, cane=revision % 2)))
        else:
            q.update(shown(*([point(revision=revision)] if step == "seen" else [])))
        ticket = q.get("a")
        if ticket is None:
            continue
        if ticket.state == "UNREACHABLE":
            assert ticket.accepted is not None and ticket.user == "ada" and ticket.reason and q.next() is None
        assert (ticket.accepted is None) == (ticket.state not in ("ACCEPTED", "UNREACHABLE"))
