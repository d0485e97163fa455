"""The cutter's word and the look afterwards, together: what a cut came to."""

import pytest
from controller_at_work import CONFIG, point

from controller.eye import Eye
from controller.queue import PointQueue
from controller.verification import Verification
from rolling_panda import messages as m
from rolling_panda.look_messages import CloseLook, Finding


class Work:
    """A queue with one accepted point that has been cut."""

    def __init__(self) -> None:
        self.queue, self.eye = PointQueue(CONFIG), Eye(2.0, 1)
        self.verification = Verification(self.queue, self.eye, True)
        self.queue.update(m.PruningPoints(header=m.Header(), segmenter="", frames=1, points=(point("a", (0, 0, 1)),)))
        assert self.queue.accept("a", 1, "ada") == ""
        self.now, self.number = 0.0, 0

    def cut(self, outcome: m.Outcome, finding: Finding | None) -> str:
        """One try; the state afterwards."""
        self.queue.intend("a", "c")
        self.verification.begin("a", outcome, f"says {outcome}", self.now)
        assert self.state in ("INTENT", outcome)
        self.now += 0.5
        if finding is not None:
            self.verification.look("a", self.now)
            due = self.eye.due(self.now)
            if due is not None:
                look = CloseLook(header=m.Header(), point_id="a", number=due[0], finding=finding, reason="it is hidden")
                self.eye.take(look, self.now)
        else:
            self.now += 5.0
        self.verification.step(self.now)
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
    assert "seen to be off" in seen.ticket.reason
    assert "not seen afterwards: it is hidden" in told.ticket.reason


@pytest.mark.parametrize(("second", "state"), [("FAILED_NOT_CUT", "FAILED_NOT_CUT"), ("DONE", "UNKNOWN")])
def test_what_stands_is_cut_once_more_and_no_third_time(second: m.Outcome, state: str) -> None:
    work = Work()
    accepted = work.ticket.accepted
    assert work.cut("FAILED_NOT_CUT", "seen") == "ACCEPTED"
    assert work.ticket.accepted is accepted and "once more" in work.ticket.reason
    assert work.cut(second, "seen") == state and "twice" in work.ticket.reason


def test_an_unknown_outcome_is_never_tried_again_and_not_even_looked_at() -> None:
    work = Work()
    work.cut("UNKNOWN", "seen")
    assert work.state == "UNKNOWN" and not work.verification.pending


def test_after_a_new_acceptance_there_is_a_second_try_again() -> None:
    work = Work()
    work.cut("FAILED_NOT_CUT", "seen")
    assert work.cut("FAILED_NOT_CUT", "seen") == "FAILED_NOT_CUT"
    assert work.queue.accept("a", 1, "ada") == ""
    # The same point as before is the same object; a person's new word still gives it one more try.
    assert work.cut("FAILED_NOT_CUT", "seen") == "ACCEPTED"
