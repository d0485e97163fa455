"""Camera checks before and after a cut."""

import msgspec
import numpy as np
import pytest

from controller.work.close_up import CloseUpClient, PostCutCheck, not_as_accepted
from controller.work.point_queue import PointQueue, Ticket
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CloseUpResult, Finding
from tests.support.controller_at_work import CONFIG, entry, finish, run_until, working
from tests.support.points import point

REPORTS = {"DONE": reasons.cutter_cut(), "FAILED_NOT_CUT": reasons.cutter_missed(), "UNKNOWN": reasons.cutter_unsure()}


class Work:
    """A queue with one accepted point that has been cut."""

    def __init__(self) -> None:
        self.queue, self.client = PointQueue(CONFIG.work), CloseUpClient(2.0, 1)
        self.check = PostCutCheck(self.queue, self.client, True)
        self.queue.update(m.PruningPoints(header=m.Header(), segmenter="", frames=1, points=(point("a", (0, 0, 1)),)))
        assert self.queue.accept("a", 1, "ada") is None
        self.now, self.number = 0.0, 0

    def cut(self, outcome: m.Outcome, finding: Finding | None, aside: float = 0.0) -> str:
        """One try; the state afterwards. The cane is seen `aside` (m) of the cut, if it is."""
        self.queue.begin_cut("a", "c")
        self.check.start("a", outcome, REPORTS[outcome], self.now)
        assert self.state in ("CUTTING", outcome)
        self.now += 0.5
        if finding is not None:
            self.check.request_close_up("a", np.array([0.0, 0.0, 1.0]), self.now)
            due = self.client.due(self.now)
            if due is not None:
                look = CloseUpResult(
                    header=m.Header(), point_id="a", number=due[0], finding=finding, reason=reasons.cane_hidden()
                )
                if finding == "seen":
                    # Along its cane a cut is seen now here, now there.
                    look = msgspec.structs.replace(look, position=(aside, 0.0, 1.02), tangent=(0.0, 0.0, 1.0))
                self.client.update(look, self.now)
        else:
            self.now += 5.0
        self.check.step(self.now)
        return self.state

    @property
    def ticket(self):
        found = self.queue.get("a")
        assert found is not None
        return found

    @property
    def state(self) -> str:
        return self.ticket.state


@pytest.mark.parametrize(
    ("outcome", "finding", "state"),
    [
        ("DONE", "severed", "DONE"),
        ("DONE", "unseen", "DONE"),
        ("DONE", None, "DONE"),
        ("FAILED_NOT_CUT", "severed", "UNKNOWN"),
        ("FAILED_NOT_CUT", "unseen", "FAILED_NOT_CUT"),
        ("FAILED_NOT_CUT", None, "FAILED_NOT_CUT"),
        ("UNKNOWN", "severed", "UNKNOWN"),
        ("DONE", "seen", "ACCEPTED"),
        ("FAILED_NOT_CUT", "seen", "ACCEPTED"),
    ],
)
def test_what_one_try_comes_to(outcome: m.Outcome, finding: Finding | None, state: str) -> None:
    assert Work().cut(outcome, finding) == state


def test_it_says_whether_the_result_was_seen() -> None:
    seen, told = Work(), Work()
    seen.cut("DONE", "severed")
    told.cut("DONE", "unseen")
    assert seen.ticket.reason == reasons.cut_and_gone()
    assert told.ticket.reason == reasons.unseen_after(REPORTS["DONE"], reasons.cane_hidden())


@pytest.mark.parametrize(("second", "state"), [("FAILED_NOT_CUT", "FAILED_NOT_CUT"), ("DONE", "UNKNOWN")])
def test_what_stands_is_cut_once_more_and_no_third_time(second: m.Outcome, state: str) -> None:
    work = Work()
    accepted = work.ticket.accepted
    assert work.cut("FAILED_NOT_CUT", "seen") == "ACCEPTED"
    assert work.ticket.accepted is accepted and work.ticket.reason.code == "stands_cut_again"
    assert work.cut(second, "seen") == state and work.ticket.reason.code in ("stands_unknown", "stands_not_cut")


@pytest.mark.parametrize(("first", "state"), [("DONE", "DONE"), ("FAILED_NOT_CUT", "ACCEPTED")])
def test_a_cane_that_seemed_to_stand_and_is_off_before_the_second_bite_was_cut(first: m.Outcome, state: str) -> None:
    work = Work()
    assert work.check.is_off("a") is None
    work.cut(first, "seen")
    told = work.check.is_off("a")
    assert work.state == state and (told is None) is (state == "ACCEPTED")


def test_the_blades_do_not_bite_again_where_the_second_look_shows_the_cane_off() -> None:
    r = working((point("a", (0.5, 0.75, 1.0)),))
    usual, looks = r.close_up, []

    def stands_at_first(request):
        found = usual(request)
        if r.cuts:
            looks.append(found.finding)
            # Two pictures decide.
            if len(looks) <= 2:
                place = {"position": (0.5, 0.75, 1.0), "tangent": (0.0, 0.0, 1.0)}
                return msgspec.structs.replace(found, finding="seen", **place)
        return found

    r.close_up = stands_at_first
    finish(r, 60.0)
    assert len(r.cuts) == 1 and any("it is cut once more" in event for event in r.events)
    assert entry(r, "a").state == "DONE" and entry(r, "a").reason == reasons.cut_and_gone()


def test_a_cane_that_is_seen_beside_the_cut_hangs_and_is_not_cut_again() -> None:
    work = Work()
    assert work.cut("DONE", "seen", 0.02) == "DONE" and work.ticket.reason == reasons.cut_and_hangs(20.0)
    swaying = Work()
    assert swaying.cut("DONE", "seen", 0.01) == "ACCEPTED"


def test_a_cane_beside_the_cut_that_the_blades_have_not_cut_is_for_a_person_to_look_at() -> None:
    """After a second bite: where it sways the first one may have closed beside it."""
    work = Work()
    assert work.cut("FAILED_NOT_CUT", "seen", 0.02) == "ACCEPTED"
    assert work.cut("FAILED_NOT_CUT", "seen", 0.02) == "UNKNOWN"
    assert work.ticket.reason == reasons.beside_but(REPORTS["FAILED_NOT_CUT"], 20.0)


def test_an_unknown_outcome_is_never_tried_again_and_not_even_looked_at() -> None:
    work = Work()
    work.cut("UNKNOWN", "seen")
    assert work.state == "UNKNOWN" and not work.check.pending


def test_after_a_new_acceptance_there_is_a_second_try_again() -> None:
    work = Work()
    work.cut("FAILED_NOT_CUT", "seen")
    assert work.cut("FAILED_NOT_CUT", "seen") == "FAILED_NOT_CUT"
    assert work.queue.accept("a", 1, "ada") is None
    # The same point as before is the same object; a person's new word still gives it one more try.
    assert work.cut("FAILED_NOT_CUT", "seen") == "ACCEPTED"


ACCEPTED = point("a", (0.5, 0.75, 1.0))
TICKET = Ticket(ACCEPTED, "ACCEPTED", accepted=ACCEPTED)


def look(finding="seen", dx=0.0, reason=None):
    position = (0.5 + dx, 0.75, 1.0) if finding == "seen" else None
    return CloseUpResult(
        header=m.Header(), point_id="a", number=1, finding=finding, reason=reason, position=position, tangent=(0, 0, 1)
    )


@pytest.mark.parametrize(
    ("seen", "why"),
    [
        (look(), None),
        (look(dx=0.02), None),
        (look("changed", reason=reasons.said("a node")), reasons.changed_in_close_up(reasons.said("a node"))),
        (look("severed"), reasons.gone_already()),
        (look("unseen", reason=reasons.said("hidden")), reasons.unseen_in_close_up(reasons.said("hidden"))),
    ],
)
def test_only_what_the_close_up_sees_is_cut_wherever_it_sees_it(seen, why):
    found = not_as_accepted(seen, TICKET)
    assert found == why or (found.code, dict(found.values)) == (why.code, pytest.approx(dict(why.values)))


def test_without_an_acceptance_nothing_is_cut():
    assert not_as_accepted(look(), Ticket(ACCEPTED))
    assert not_as_accepted(look(), None)


def looking(r, *, dx=0.0, finding="seen", point_id="a"):
    """Let the robot's camera show one point otherwise than the others."""
    usual = r.close_up

    def looked(request):
        found = usual(request)
        if request.point_id != point_id or found.finding != "seen":
            return found
        x, y, z = found.position
        changed = {"position": (x + dx, y, z)} if finding == "seen" else {"finding": finding, "position": None}
        return msgspec.structs.replace(found, **changed)

    r.close_up = looked
    return r


def test_a_point_that_the_close_up_shows_changed_is_not_cut_says_why_and_the_work_goes_on():
    r = looking(working((point("a", (0.5, 0.75, 1.0)), point("b", (0.8, 0.75, 1.05)))), finding="changed")
    finish(r, 60.0)
    assert [cut[0] for cut in r.cuts] == ["b"]
    assert entry(r, "a").state == "PROPOSED" and entry(r, "a").reason.code == "acceptance_void"
    assert entry(r, "b").state == "DONE"


@pytest.mark.long
@pytest.mark.parametrize("finding", ["unseen", "severed", "changed"])
@pytest.mark.parametrize("hidden", [1, 2, 9])
def test_what_close_ups_do_not_show_is_looked_at_from_other_sides_and_then_left(hidden, finding):
    """The other cut is made in between. The third side is the last one. Nobody has cut this one."""
    r = working((point("a", (0.5, 0.75, 1.0)), point("b", (0.8, 0.75, 1.05))))
    usual, sides = r.close_up, []
    told = {"unseen": "The close-up did not", "severed": "Its cane is off", "changed": "In the close-up"}[finding]

    def again():
        return sum(event.startswith(f"a: {told}") for event in r.events)

    def partly(request):
        found = usual(request)
        if request.point_id != "a" or found.finding != "seen":
            return found
        if len(sides) <= again():
            sides.append(r.model.kinematics(r.q).T_odom_tool.rotation[:, 2])
        return found if again() >= hidden else msgspec.structs.replace(found, finding=finding, position=None)

    r.close_up = partly
    finish(r, 90.0)
    assert again() == min(hidden, 2) and len(sides) == min(hidden + 1, 3)
    assert all(one @ other < 0.9995 for k, one in enumerate(sides) for other in sides[:k])
    assert [cut[0] for cut in r.cuts] == (["b", "a"] if hidden < 3 else ["b"])
    ended = entry(r, "a")
    assert (ended.state, ended.reason.code) == (
        ("DONE", "cut_and_gone") if hidden < 3 else ("PROPOSED", "acceptance_void")
    )


def test_the_other_side_is_looked_at_from_there_where_no_other_cut_is_left():
    r = working((point("a", (0.5, 0.75, 1.0)),))
    usual, sides = r.close_up, {}

    def hidden(request):
        found, missed = usual(request), sum("tried again another way" in event for event in r.events)
        if found.finding == "seen":
            sides.setdefault(missed, r.model.kinematics(r.q).T_odom_tool.rotation[:, 2])
        return found if missed == 2 or found.finding != "seen" else msgspec.structs.replace(found, finding="unseen")

    r.close_up = hidden
    finish(r, 60.0)
    assert [cut[0] for cut in r.cuts] == ["a"] and len(sides) == 3
    assert all(sides[one] @ sides[other] < 0.995 for one, other in ((0, 1), (0, 2), (1, 2))), sides


@pytest.mark.parametrize(("dx", "told"), [(0.004, False), (0.02, True)])
def test_the_place_of_the_close_up_is_cut_and_the_log_says_how_far_it_is_from_the_accepted_one(dx, told):
    r = looking(working((point("a", (0.5, 0.75, 1.0)),)), dx=dx)
    finish(r, 30.0)
    assert entry(r, "a").state == "DONE"
    assert abs(r.cuts[0][1][0, 3] - 0.5 - dx) < 0.0015
    assert any("a is cut 20 mm from where it was accepted" in event for event in r.events) is told


def test_a_cane_that_sways_is_cut_in_the_middle_of_its_way():
    r = working((point("a", (0.5, 0.75, 1.0)),))
    usual, swings = r.close_up, iter([0.02, -0.018, 0.014, *[0.0] * 50])

    def swaying(request):
        found = usual(request)
        if found.finding != "seen":
            return found
        x, y, z = found.position
        return msgspec.structs.replace(found, position=(x + next(swings), y, z))

    r.close_up = swaying
    finish(r, 30.0)
    assert entry(r, "a").state == "DONE"
    assert abs(r.cuts[0][1][0, 3] - 0.504) < 0.0015


def test_the_robot_does_not_go_back_for_a_severed_cane_that_hangs_beside_its_stub():
    r = working((point("a", (0.5, 0.75, 1.0)), point("b", (0.8, 0.75, 1.05))))
    usual = r.close_up

    def hanging(request):
        found = usual(request)
        if request.point_id == "a" and found.finding == "severed":
            return msgspec.structs.replace(found, finding="seen", position=(0.52, 0.75, 0.98), tangent=(0.0, 0.0, 1.0))
        return found

    r.close_up = hanging
    finish(r, 60.0)
    assert [cut[0] for cut in r.cuts] == ["a", "b"]
    assert entry(r, "a").state == "DONE" and entry(r, "a").reason.code == "cut_and_hangs"


def test_the_phase_is_told_while_the_robot_looks_and_the_blades_stay_out_of_the_canes():
    r = working((point("a", (0.5, 0.75, 1.0)),))
    r.close_up = lambda request: None
    run_until(r, lambda s: s is not None and s.phase == "CLOSE_UP", 20.0)
    for _ in range(150):
        r.step()
    assert r.state.phase == "CLOSE_UP" and r.state.T_odom_tool.position[1] < 0.75 - 0.19
    finish(r, 70.0)
    unseen = reasons.unseen_in_close_up(reasons.no_close_up(8.0))
    assert not r.cuts and entry(r, "a").reason == reasons.acceptance_void(unseen)
    assert sum(event.startswith("a: ") and event.endswith("The cut is tried again") for event in r.events) == 2


def test_a_cut_whose_close_up_did_not_come_is_made_at_the_next_try_from_the_same_side():
    r = working((point("a", (0.5, 0.75, 1.0)),))
    usual, axes = r.close_up, {}

    def late(request):
        found, missed = usual(request), any("The cut is tried again" in event for event in r.events)
        if found.finding != "seen":
            return found
        axes[missed] = r.model.kinematics(r.q).T_odom_tool.rotation[:, 2]
        return found if missed else None

    r.close_up = late
    finish(r, 60.0)
    assert [cut[0] for cut in r.cuts] == ["a"] and entry(r, "a").state == "DONE"
    assert axes[False] @ axes[True] > 0.9995
