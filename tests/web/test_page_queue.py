"""Deciding about points on the page: reasons, taking back, keys, and very many points."""

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages import page as p
from rolling_panda.reasons import text_of
from tests.support.played_page import until
from tests.support.played_server import PlayedServer, point

pytestmark = pytest.mark.browser


@pytest.fixture
def screen() -> str:
    return "review"


SEEN = {"revision": 4, "digest": "00000002" * 4}


def become(server: PlayedServer, name: str, state: m.PointState, reason: m.Reason | None = None) -> None:
    rows = []
    for row in server.points:
        if row.point.point_id == name:
            row = msgspec.structs.replace(row, entry=msgspec.structs.replace(row.entry, state=state, reason=reason))
        rows.append(row)
    server.points = tuple(rows)
    server.tell(server.page_points())


def test_a_rejection_has_a_reason_or_none(page: Page, server: PlayedServer) -> None:
    page.locator('[data-point-id="p1"] button.reject').click()
    expect(page.locator("#reject-reason")).to_be_focused()
    page.keyboard.type("a tie is there")
    assert server.posted == [], "letters are no commands here"
    page.keyboard.press("Enter")
    until(page, lambda: ("/api/points/p1/reject", {"reason": "a tie is there"}) in server.posted)
    page.locator('[data-point-id="p2"]').focus()
    page.keyboard.press("r")
    page.get_by_role("button", name="wrong cane").click()
    until(page, lambda: ("/api/points/p2/reject", {"reason": "wrong cane"}) in server.posted)
    page.keyboard.press("r")
    page.keyboard.press("Escape")
    expect(page.locator("rp-reject-form")).to_have_count(0)
    expect(page.locator('[data-point-id="p2"]')).to_be_focused()
    assert len(server.posted) == 2
    assert server.stops() == [], "a space in the reason is a character"


def test_the_last_decisions_are_taken_back_one_after_the_other(page: Page, server: PlayedServer) -> None:
    expect(page.locator("#undo")).to_be_disabled()
    page.locator('[data-point-id="p1"]').focus()
    page.keyboard.press("a")
    until(page, lambda: len(server.posted) == 1)
    become(server, "p1", "ACCEPTED")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("r")
    page.keyboard.press("Enter")
    until(page, lambda: len(server.posted) == 2)
    become(server, "p2", "REJECTED", "rejected")
    expect(page.locator("#undo")).to_have_attribute("title", "Take back: rejected p2 (Z)")
    page.keyboard.press("z")
    until(page, lambda: len(server.posted) == 3)
    assert server.posted[-1] == ("/api/points/p2/accept", SEEN), "it was accepted before, and as it was seen then"
    page.locator("#undo").click()
    until(page, lambda: len(server.posted) == 4)
    assert server.posted[-1] == ("/api/points/p1/reconsider", {})
    expect(page.locator("#undo")).to_be_disabled()


def test_accepting_all_is_taken_back_where_nothing_has_happened_since(page: Page, server: PlayedServer) -> None:
    server.points = tuple(point(number, "PROPOSED", spur=number) for number in (1, 2, 3))
    server.tell(server.page_points())
    expect(page.locator("rp-point")).to_have_count(3)
    page.locator("#accept-all").click()
    until(page, lambda: len(server.posted) == 1)
    for name, state in (("p1", "ACCEPTED"), ("p2", "DONE"), ("p3", "ACCEPTED")):
        become(server, name, state)  # type: ignore[arg-type]
    expect(page.locator('[data-point-id="p2"]')).to_have_attribute("data-state", "DONE")
    page.locator("#undo").click()
    until(page, lambda: len(server.posted) == 3)
    assert {path for path, _ in server.posted[1:]} == {"/api/points/p1/reconsider", "/api/points/p3/reconsider"}


def test_a_decision_that_was_refused_cannot_be_taken_back(page: Page, server: PlayedServer) -> None:
    server.answers["/api/points/p1/accept"] = (409, {"ok": False, "reason": "p1 has changed since"})
    page.locator('[data-point-id="p1"] button.accept').click()
    expect(page.locator(".toast")).to_contain_text("p1 has changed since")
    expect(page.locator("#undo")).to_be_disabled()


def test_a_point_is_moved_along_its_cane_by_millimetres_and_back(page: Page, server: PlayedServer) -> None:
    page.locator('[data-point-id="p1"]').click()
    page.get_by_role("button", name="+5").click()
    until(page, lambda: ("/api/points/p1/move", {"along": 0.005}) in server.posted)
    page.locator("#undo").click()
    until(page, lambda: ("/api/points/p1/move", {"along": -0.005}) in server.posted)
    server.answers["/api/points/p1/move"] = (409, {"ok": False, "reason": "4 mm from a node: the blades need 10 mm"})
    page.get_by_role("button", name="−1").click()
    expect(page.locator(".toast").last).to_contain_text("4 mm from a node")
    expect(page.locator("#undo")).to_be_disabled()
    page.locator('[data-point-id="p2"]').click()
    expect(page.get_by_role("button", name="+1")).to_have_attribute("title", text_of(reasons.acceptance_stands("p2")))


def many(count: int) -> tuple[p.PagePoint, ...]:
    rows = (
        point(number, "PROPOSED", vine=1 + number // 20, spur=1 + number // 2 % 10) for number in range(1, count + 1)
    )
    return tuple(msgspec.structs.replace(row, pixel=None) for row in rows)


@pytest.mark.alone  # It is about time: how long the page keeps a person waiting.
def test_two_thousand_points_are_listed_and_walked_through_without_a_standstill(
    page: Page, server: PlayedServer
) -> None:
    server.points = many(2000)
    server.tell(server.page_points())
    expect(page.locator("rp-point")).to_have_count(2000, timeout=20_000)
    page.locator("rp-point").first.focus()
    page.evaluate(
        "() => { window.longest = 0; new PerformanceObserver((list) => { for (const each of list.getEntries())"
        " window.longest = Math.max(window.longest, each.duration); }).observe({ type: 'longtask' }); }"
    )
    for key in ("ArrowDown", "ArrowDown", "PageDown", "End", "Home", "ArrowDown"):
        page.keyboard.press(key)
        page.wait_for_timeout(100)
    expect(page.locator('rp-point[aria-current="true"]')).to_have_attribute(
        "data-point-id", server.points[1].point.point_id
    )
    walking = page.evaluate("window.longest")
    page.evaluate("() => { window.longest = 0; }")
    for state in ("ACCEPTED", "REJECTED", "PROPOSED"):
        become(server, "p1000", state)  # type: ignore[arg-type]
        page.wait_for_timeout(400)
    changing = page.evaluate("window.longest")
    print(f"2,000 points: longest task {walking:.0f} ms while walking, {changing:.0f} ms while a point changes")
    assert walking < 400
    assert changing < 1000
