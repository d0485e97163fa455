"""Reasons as the page shows them, against their text elsewhere."""

from string import Formatter

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import reasons
from rolling_panda.messages import Reason
from server.api.responses import outcome
from tests.support.page_parts import open_screen
from tests.support.played_server import PlayedServer

pytestmark = pytest.mark.browser


@pytest.fixture
def screen() -> str:
    return "engineer"


TEXTS = """async reasons => {
  const { reasonText } = await import("/js/state/reasons.js");
  return reasons.map(reason => reasonText(reason));
}"""
NUMBERS = (0.0, 1.0, 2.0, -3.26, 7.149, 1234.5678, 1e-3, 0.1 + 0.2)


def shown(page: Page, made: list[Reason]) -> list[str]:
    return page.evaluate(TEXTS, msgspec.json.decode(msgspec.json.encode(made)))


def reason(entry: reasons.Entry, number: float) -> Reason:
    """Of this entry, with a cause as the last of its texts."""
    fields = [(name, form) for _, name, form, _ in Formatter().parse(entry.text) if name]
    return Reason(code=entry.code, values=tuple((name, number if form else f"({name})") for name, form in fields))


def test_every_reason_reads_as_elsewhere(server: PlayedServer, page: Page) -> None:
    made = [reason(entry, number) for entry in reasons.CATALOGUE.values() for number in NUMBERS]
    assert shown(page, made) == [reasons.text_of(each) for each in made]


def test_a_cause_is_part_of_the_text(server: PlayedServer, page: Page) -> None:
    cause = reasons.control_held("ada")
    made = [reasons.said(cause)]
    assert shown(page, made) == [reasons.text_of(made[0])] == [reasons.text_of(cause)]


def test_a_reason_of_another_version_is_shown_with_its_values(server: PlayedServer, page: Page) -> None:
    (text,) = shown(page, [Reason(code="of_tomorrow", values=(("distance", 3.5), ("user", "ada")))])
    assert all(part in text for part in ("of_tomorrow", "distance", "3.5", "ada"))


def test_points_are_called_by_vine_and_spur_also_when_they_are_gone(server: PlayedServer, page: Page) -> None:
    made = [
        reasons.point_unseen("p3"),
        reasons.point_left("p3", reasons.revised("p1")),
        reasons.acceptances_restored("p1, p3"),
        reasons.point_moved_before("Ada", "p3", "p1"),
        reasons.point_unseen("p99"),
        # A person may be called like a point.
        reasons.control_given("p3"),
    ]
    told = [
        "Perception does not see vine 1, spur 2 any more",
        "Vine 1, spur 2 was left: Vine 1, spur 1 was revised",
        "Accepted again after the rule was undone: vine 1, spur 1; vine 1, spur 2",
        "Ada moved vine 1, spur 2 before vine 1, spur 1",
        "Perception does not see p99 any more",
        "p3 holds control",
    ]
    assert shown(page, made) == told
    server.points = ()
    server.tell(server.page_points())
    open_screen(page, "review")
    expect(page.locator(".strip-mark")).to_have_count(2)
    assert shown(page, made) == told


def test_modes_and_states_have_their_labels(server: PlayedServer, page: Page) -> None:
    (text,) = shown(page, [reasons.wrong_mode("Home", "READY", "PROTECTIVE_STOP")])
    assert "Ready" in text and "Protective stop" in text and "PROTECTIVE_STOP" not in text


def test_a_refused_request_is_shown_with_the_page_s_own_words(server: PlayedServer, page: Page) -> None:
    """The answer has its reason as data; its English text is for scripts."""
    why = reasons.decision_unrecorded(reasons.wrong_mode("Home", "READY", "PROTECTIVE_STOP"))
    server.answers["/api/home"] = (409, outcome(False, why))
    page.locator("#more").click()
    page.locator("#home").click()
    expect(page.locator(".toast")).to_contain_text("It was decided, but is not recorded: Home is possible in Ready; ")
    expect(page.locator(".toast")).to_contain_text("the mode is Protective stop")
