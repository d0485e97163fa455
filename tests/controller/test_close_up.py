"""A picture of a point is asked for until it comes; one that does not show the point is taken once more."""

import numpy as np
import pytest
from msgspec.structs import replace

from controller.work.close_up import CloseUpClient
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CloseUpResult, Finding


def look(number: int, finding: Finding = "seen", point_id: str = "a") -> CloseUpResult:
    return CloseUpResult(header=m.Header(), point_id=point_id, number=number, finding=finding)


def test_the_request_is_repeated_until_the_picture_comes_and_no_longer() -> None:
    client = CloseUpClient(2.0, 2)
    client.ask("a", "seen", 0.0)
    sent = [request for tick in range(20) if (request := client.due(0.01 * tick)) is not None]
    assert 3 <= len(sent) <= 5 and set(sent) == {(1, "a")}
    assert client.answer("a", 0.2) is None
    client.update(look(1), 0.2)
    answer = client.answer("a", 0.2)
    assert answer is not None and answer.finding == "seen"
    assert client.due(0.5) is None


def test_a_picture_that_shows_nothing_is_taken_once_more_under_a_new_number() -> None:
    client = CloseUpClient(2.0, 2)
    client.ask("a", "seen", 0.0)
    client.due(0.0)
    client.update(look(1, "unseen"), 0.1)
    assert client.due(0.11) == (2, "a") and client.answer("a", 0.11) is None
    client.update(look(1, "seen"), 0.15)
    assert client.answer("a", 0.15) is None, "the first request's picture comes too late"
    client.update(look(2, "unseen"), 0.2)
    answer = client.answer("a", 0.2)
    assert answer is not None and answer.finding == "unseen"


def test_pictures_that_show_nothing_may_be_more_than_those_that_contradict_what_is_expected() -> None:
    client = CloseUpClient(8.0, 2, 4)
    client.ask("a", "seen", 0.0)
    for number in (1, 2, 3):
        client.update(look(number, "unseen"), 0.1 * number)
        assert client.answer("a", 0.1 * number) is None
    client.update(look(4), 0.5)
    answer = client.answer("a", 0.5)
    assert answer is not None and answer.finding == "seen"
    client.ask("b", "seen", 1.0)
    client.update(look(5, "severed", "b"), 1.1)
    client.update(look(6, "severed", "b"), 1.2)
    answer = client.answer("b", 1.2)
    assert answer is not None and answer.finding == "severed"


def test_a_lost_picture_is_asked_for_anew_and_a_look_ends_whatever_comes() -> None:
    client = CloseUpClient(5.0, 1)
    client.ask("a", "seen", 0.0)
    numbers = {request[0] for tick in range(490) if (request := client.due(0.01 * tick)) is not None}
    assert numbers == {1, 2, 3, 4}
    assert client.answer("a", 4.9) is None
    answer = client.answer("a", 5.1)
    assert answer is not None and answer.finding == "unseen" and answer.reason.code == "no_close_up"


@pytest.mark.parametrize(
    ("findings", "answer"),
    [(["unseen"], ("unseen", "cane_hidden")), (["changed"], ("unseen", "no_close_up"))],
    ids=["nothing to be seen", "one that contradicts"],
)
def test_on_a_slow_machine_the_pictures_that_came_in_time_count(
    findings: list[Finding], answer: tuple[Finding, str]
) -> None:
    client = CloseUpClient(5.0, 2, 4)
    client.ask("a", "seen", 0.0)
    for number, finding in enumerate(findings, 1):
        client.update(replace(look(number, finding), reason=reasons.cane_hidden()), 3.0)
    assert client.answer("a", 4.9) is None
    found = client.answer("a", 5.1)
    assert found is not None and found.reason is not None and (found.finding, found.reason.code) == answer


def test_on_a_slow_machine_a_cane_that_sways_is_where_the_pictures_that_came_in_time_show_it() -> None:
    client = CloseUpClient(5.0, 2, 4)
    client.ask("a", "seen", 0.0, np.array([0.5, 0.75, 1.0]))
    for at, x in ((2.0, 0.52), (3.5, 0.49)):
        request = client.due(at)
        assert request is not None
        client.update(replace(look(request[0]), position=(x, 0.75, 1.0)), at)
    assert client.answer("a", 4.9) is None
    found = client.answer("a", 5.1)
    assert found is not None and found.finding == "seen"
    assert found.position == pytest.approx(((0.52 + 0.49 + 0.5) / 3, 0.75, 1.0))


def test_two_points_are_looked_at_at_once_and_what_nobody_asked_for_is_nobodys() -> None:
    client = CloseUpClient(2.0, 1)
    client.ask("a", "seen", 0.0)
    client.ask("b", "severed", 0.0)
    assert {client.due(0.0), client.due(0.001)} == {(1, "a"), (2, "b")}
    client.update(look(2, "severed", "b"), 0.1)
    client.update(look(9, "seen", "c"), 0.1)
    assert client.answer("c", 0.1) is None and client.answer("a", 0.1) is None
    answer = client.answer("b", 0.1)
    assert answer is not None and answer.finding == "severed"
    client.forget("b")
    assert client.answer("b", 0.1) is None


def test_what_is_not_as_expected_is_believed_after_a_second_picture_only() -> None:
    client = CloseUpClient(2.0, 2)
    client.ask("a", "severed", 0.0)
    client.update(look(1, "seen"), 0.1)
    assert client.answer("a", 0.1) is None and client.due(0.1) == (2, "a")
    client.update(look(2, "severed"), 0.2)
    answer = client.answer("a", 0.2)
    assert answer is not None and answer.finding == "severed"


def test_a_picture_that_was_taken_for_lost_still_counts_when_it_comes_late() -> None:
    client = CloseUpClient(8.0, 2)
    client.ask("a", "seen", 0.0)
    sent = [request[0] for tick in range(400) if (request := client.due(0.01 * tick)) is not None]
    assert sent[-1] > sent[0] == 1
    client.update(look(1, "unseen"), 4.0)
    assert client.answer("a", 4.0) is None, "not as expected: one more, taken from now on"
    client.update(look(2), 4.1)
    assert client.answer("a", 4.1) is None, "taken before that"
    request = client.due(4.2)
    assert request is not None
    client.update(look(request[0]), 5.0)
    answer = client.answer("a", 5.0)
    assert answer is not None and answer.finding == "seen"


def seen_at(client: CloseUpClient, *places: float | None) -> float | None:
    """Pictures of a cane that is expected at 0.5, by where they show it (None: not). Where the answer has it."""
    client.ask("a", "seen", 0.0, np.array([0.5, 0.75, 1.0]))
    for tick, x in enumerate(places):
        assert client.answer("a", 0.4 * tick) is None, f"answered after {tick} pictures"
        request = client.due(0.4 * tick)
        assert request is not None
        finding: Finding = "unseen" if x is None else "seen"
        position = None if x is None else (x, 0.75, 1.0)
        found = CloseUpResult(header=m.Header(), point_id="a", number=request[0], finding=finding, position=position)
        client.update(found, 0.4 * tick)
    answer = client.answer("a", 2.0)
    return None if answer is None or answer.position is None else answer.position[0]


@pytest.mark.parametrize(
    ("places", "answer"),
    [
        ((0.503,), 0.503),
        ((0.52, 0.521), 0.5205),
        ((0.52, None, 0.521), 0.5205),
        ((0.52, 0.49, 0.51), 0.505),
        ((0.52, None, None, None), None),
        ((None, None, None, 0.52), None),
        ((None, None, 0.52, 0.49), 0.503333),
        ((None, None, None, None), None),
    ],
    ids=[
        "there",
        "shifted",
        "hidden once",
        "swaying",
        "elsewhere in one alone",
        "elsewhere at last",
        "swaying, hidden first",
        "never",
    ],
)
def test_a_cane_that_is_seen_elsewhere_is_looked_at_again_and_one_that_sways_is_where_it_is_in_the_mean(places, answer):
    """In the mean of what the pictures show; of one that sways with where it was expected."""
    assert seen_at(CloseUpClient(8.0, 2, 4), *places) == (answer and pytest.approx(answer, abs=1e-6))


@pytest.mark.parametrize(("x", "apart"), [(0.52, 0.3), (0.503, None), (None, 0.0)], ids=["swaying", "there", "unseen"])
def test_pictures_of_a_cane_that_may_sway_are_apart_in_time(x, apart):
    client = CloseUpClient(8.0, 2, 4)
    client.ask("a", "seen", 0.0, np.array([0.5, 0.75, 1.0]))
    request = client.due(0.0)
    assert request is not None
    position = None if x is None else (x, 0.75, 1.0)
    finding: Finding = "unseen" if x is None else "seen"
    client.update(
        CloseUpResult(header=m.Header(), point_id="a", number=request[0], finding=finding, position=position), 1.0
    )
    due = [now for now in (1.0, 1.1, 1.29, 1.31, 1.5) if client.due(now) is not None]
    assert (due[0] if due else None) == (None if apart is None else pytest.approx(1.0 + apart, abs=0.02))
