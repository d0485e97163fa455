"""The order of work on the page: whose it is, changed by dragging and by keys, and with many points."""

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.reasons import text_of
from tests.support.page_parts import choose, mark
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer, controller, point

pytestmark = pytest.mark.browser


@pytest.fixture
def screen() -> str:
    return "review"


ALLOWED = ("MoveInQueue", "ResetOrder", "SetApproach")


@pytest.fixture
def server() -> PlayedServer:
    state = controller(order=m.QueueOrder(7, ""))
    state = msgspec.structs.replace(state, allowed=state.allowed | dict.fromkeys(ALLOWED))
    rows = tuple(point(number, "ACCEPTED", spur=number) for number in range(1, 6))
    return PlayedServer(controller=state, points=rows)


def shown(page: Page) -> list[str]:
    return page.locator(".order-row").evaluate_all(
        "rows => rows.sort((a, b) => a.offsetTop - b.offsetTop).map(row => row.dataset.pointId)"
    )


def opened(page: Page) -> None:
    page.locator("rp-order summary").click()
    expect(page.locator(".order-row").first).to_be_visible()
    page.locator(".order-list").scroll_into_view_if_needed()


def test_the_list_is_in_the_order_of_work_and_says_whose_it_is(page: Page, server: PlayedServer) -> None:
    expect(page.locator("rp-order summary")).to_have_text("Order of work: 5 points, by the plan")
    opened(page)
    assert shown(page) == ["p1", "p2", "p3", "p4", "p5"]
    back = page.locator("#planners-order")
    whose = {"ResetOrder": reasons.order_of_plan()}
    server.controller = msgspec.structs.replace(server.controller, allowed=server.controller.allowed | whose)
    expect(back).to_have_attribute("title", text_of(reasons.order_of_plan()))
    allowed = server.controller.allowed | {"ResetOrder": None}
    server.controller = msgspec.structs.replace(server.controller, order=m.QueueOrder(8, "Bob"), allowed=allowed)
    expect(page.locator("rp-order summary")).to_contain_text("by Bob")
    back.click()
    until(page, lambda: ("/api/order/planners", {"revision": 8}) in server.posted)


def test_a_row_is_dragged_to_another_place(page: Page, server: PlayedServer) -> None:
    opened(page)
    grip = box_of(page.locator('.order-row[data-point-id="p4"] .order-grip'))
    goal = box_of(page.locator('.order-row[data-point-id="p2"]'))
    page.mouse.move(grip["x"] + 10, grip["y"] + 20)
    page.mouse.down()
    page.mouse.move(goal["x"] + 10, goal["y"] + 8, steps=4)
    expect(page.locator(".order-mark")).to_be_visible()
    page.mouse.up()
    until(page, lambda: ("/api/points/p4/work-before", {"before": "p2", "revision": 7}) in server.posted)


def test_a_drag_that_ends_where_it_began_asks_for_nothing(page: Page, server: PlayedServer) -> None:
    opened(page)
    grip = box_of(page.locator('.order-row[data-point-id="p3"] .order-grip'))
    page.mouse.move(grip["x"] + 10, grip["y"] + 20)
    page.mouse.down()
    page.mouse.move(grip["x"] + 10, grip["y"] + 24, steps=2)
    page.mouse.up()
    page.wait_for_timeout(100)
    assert server.posted == []


def test_keys_move_the_chosen_point(page: Page, server: PlayedServer) -> None:
    opened(page)
    page.locator(".order-list").focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowDown")
    expect(page.locator('.order-row[data-point-id="p2"]')).to_have_attribute("aria-selected", "true")
    page.keyboard.press("Alt+ArrowDown")
    until(page, lambda: ("/api/points/p2/work-before", {"before": "p4", "revision": 7}) in server.posted)
    page.keyboard.press("Alt+Home")
    until(page, lambda: ("/api/points/p2/work-before", {"before": "p1", "revision": 7}) in server.posted)
    page.keyboard.press("Alt+End")
    until(page, lambda: ("/api/points/p2/work-before", {"before": "", "revision": 7}) in server.posted)


def test_who_may_not_change_it_changes_nothing(page: Page, server: PlayedServer) -> None:
    opened(page)
    server.role = "viewer"
    expect(page.locator("#planners-order")).to_have_attribute("title", text_of(reasons.viewer_only()))
    page.locator(".order-list").focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Alt+ArrowDown")
    page.wait_for_timeout(100)
    assert server.posted == []


WATCH = """() => {
  window.touched = [];
  new MutationObserver((records) => {
    for (const { target } of records) {
      const part = target instanceof Element ? target : target.parentElement;
      const row = part?.closest(".strip-mark, .order-row");
      if (row) window.touched.push(row.dataset.pointId);
    }
  }).observe(document.querySelector("rp-review"), {
    subtree: true, childList: true, attributes: true, characterData: true,
  });
}"""


def touched(page: Page) -> set[str]:
    """Points of which anything was drawn anew since the last time; two pictures later nothing is outstanding."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return set(page.evaluate("() => window.touched.splice(0)"))


def test_of_many_points_only_those_in_view_are_there_and_only_what_changed_is_drawn_anew(
    page: Page, server: PlayedServer
) -> None:
    opened(page)
    server.points = tuple(point(number, "ACCEPTED", spur=number) for number in range(300))
    server.tell(server.page_points())
    expect(page.locator("rp-order summary")).to_contain_text("300 points")
    page.locator(".order-list").focus()
    page.keyboard.press("End")
    expect(page.locator('.order-row[data-point-id="p299"]')).to_be_visible()
    assert page.locator(".order-row").count() < 30
    page.evaluate(WATCH)
    touched(page)
    for _ in range(3):
        server.tell(server.state())
        server.tell(server.page_points())
    assert touched(page) == set(), "states and points that are as they were"
    page.keyboard.press("ArrowUp")
    expect(page.locator('.order-row[data-point-id="p298"]')).to_have_attribute("aria-selected", "true")
    assert touched(page) <= {"p298", "p299", "p0"}
    entry = msgspec.structs.replace(server.points[297].entry, state="UNREACHABLE")
    changed = msgspec.structs.replace(server.points[297], entry=entry)
    server.points = (*server.points[:297], changed, *server.points[298:])
    server.tell(server.page_points())
    expect(mark(page, "p297")).to_have_attribute("data-status", "unreachable")
    # Of the order of work, where it is no longer, the rows in view have moved up.
    changed_ones = touched(page)
    assert "p297" in changed_ones and len(changed_ones) < 30


def test_the_approach_is_turned_and_left_to_the_search_again(page: Page, server: PlayedServer) -> None:
    choose(page, "p2")
    page.locator(".adjust summary").click()
    page.get_by_label("Turn of the approach").fill("30")
    until(page, lambda: bool(server.posted))
    path, body = server.posted[0]
    assert path == "/api/points/p2/approach" and body["azimuth"] == pytest.approx(0.5236, abs=1e-3)
    expect(page.get_by_role("button", name="As found")).to_have_attribute("aria-disabled", "true")
    entry = msgspec.structs.replace(server.points[1].entry, azimuth=0.5236)
    turned = msgspec.structs.replace(server.points[1], entry=entry)
    server.points = (server.points[0], turned, *server.points[2:])
    server.tell(server.page_points())
    expect(page.locator(".approach .number")).to_have_text("30°")
    page.get_by_role("button", name="As found").click()
    until(page, lambda: ("/api/points/p2/approach", {"azimuth": None}) in server.posted)
