"""Points that a person places on the page, and the camera's image held still."""

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import reasons
from rolling_panda.messages import page as p
from server.api.responses import outcome
from tests.support.page_parts import open_screen
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer, point

pytestmark = pytest.mark.browser
PLACED = (200, outcome(True, reasons.point_placed("p9")))


def place_by_hand(page: Page) -> None:
    open_screen(page, "review")
    page.locator("#add-by-hand").click()
    open_screen(page, "work")


def click_image(page: Page, u: float, v: float) -> None:
    at = """(overlay, [u, v]) => {
      const { width, height } = overlay.viewBox.baseVal;
      const { x, y } = new DOMPoint(u * width, v * height).matrixTransform(overlay.getScreenCTM());
      return [x, y];
    }"""
    page.mouse.click(*page.locator("rp-camera .picture svg").evaluate(at, [u, v]))


def test_a_click_into_the_view_asks_for_a_point_only_while_points_are_placed(page: Page, server: PlayedServer) -> None:
    server.answers["/api/points/by-hand"] = PLACED
    line = p.PickRay(origin=(0.0, -0.5, 1.2), direction=(0.0, 1.0, 0.0))
    server.tell(line)
    # A later message, whose arrival can be seen: the click has come too.
    server.points = server.points[:2]
    server.tell(server.page_points())
    expect(page.locator("[data-cut]")).to_have_count(2)
    expect(page.locator("rp-placing")).to_be_hidden()
    place_by_hand(page)
    until(page, lambda: p.PlaceByHand(active=True) in server.said)
    expect(page.locator("rp-placing")).to_contain_text("Click a cane that has been seen")
    assert server.posted == []
    server.tell(line)
    until(page, lambda: bool(server.posted))
    assert server.posted == [("/api/points/by-hand", {"origin": [0, -0.5, 1.2], "direction": [0, 1, 0]})]
    until(page, lambda: p.Select(point_id="p9") in server.said)
    page.keyboard.press("Escape")
    until(page, lambda: p.PlaceByHand(active=False) in server.said)
    expect(page.locator("rp-placing")).to_be_hidden()


def test_a_click_into_the_camera_image_says_which_frame_and_where(page: Page, server: PlayedServer) -> None:
    server.answers["/api/points/by-hand-in-image"] = PLACED
    expect(page.locator("rp-camera img")).to_be_visible()
    page.locator("#swap").click()
    click_image(page, 0.25, 0.8)
    page.wait_for_timeout(200)
    assert server.posted == [], "a click means nothing before points are placed"
    place_by_hand(page)
    click_image(page, 0.25, 0.8)
    until(page, lambda: bool(server.posted))
    path, body = server.posted[0]
    assert path == "/api/points/by-hand-in-image"
    assert body["sequence"] in server.frames_fetched
    assert (body["u"], body["v"]) == (pytest.approx(0.25, abs=0.01), pytest.approx(0.8, abs=0.01))


def test_where_no_point_can_be_the_page_says_why(page: Page, server: PlayedServer) -> None:
    refusal = "no known cane within 25 mm of there; click on a cane that is drawn"
    server.answers["/api/points/by-hand"] = (409, {"ok": False, "reason": refusal})
    place_by_hand(page)
    server.tell(p.PickRay(origin=(0.0, -0.5, 1.2), direction=(0.0, 1.0, 0.0)))
    expect(page.locator(".toast")).to_contain_text(refusal)
    server.role = "viewer"
    expect(page.locator("rp-placing")).to_be_hidden()
    open_screen(page, "review")
    expect(page.locator("#add-by-hand")).to_be_disabled()


@pytest.mark.long
def test_a_frozen_image_stays_with_its_points_and_is_the_one_that_is_clicked(page: Page, server: PlayedServer) -> None:
    server.answers["/api/points/by-hand-in-image"] = PLACED
    expect(page.locator("rp-camera .mark")).to_have_count(3)
    page.locator("#swap").click()
    before = page.locator("rp-camera .mark").first.get_attribute("transform")
    page.locator("#freeze").click()
    expect(page.locator("rp-camera .stale-note")).to_contain_text("frozen")
    page.wait_for_timeout(200)
    count, shown = len(server.frames_fetched), page.locator("rp-camera img").get_attribute("src")
    assert shown is not None
    server.points = (point(1, "PROPOSED", spur=4), point(9, "PROPOSED"))
    server.points = tuple(p.PagePoint(point=row.point, entry=row.entry, pixel=(9.0, 9.0)) for row in server.points)
    server.tell(server.page_points())
    expect(page.locator("rp-camera .mark")).to_have_count(1)
    assert page.locator("rp-camera .mark").first.get_attribute("transform") == before
    page.wait_for_timeout(1500)
    assert len(server.frames_fetched) == count
    assert page.locator("rp-camera img").get_attribute("src") == shown
    place_by_hand(page)
    click_image(page, 0.5, 0.75)
    expect(page.locator("rp-camera .mark")).to_have_count(2)
    assert server.posted[0][1]["sequence"] == int(shown.split("n=")[1])
    page.keyboard.press("Escape")
    expect(page.locator("rp-placing")).to_be_hidden()
    page.locator("#freeze").click()
    until(page, lambda: len(server.frames_fetched) > count)
    expect(page.locator("rp-camera .mark").first).to_have_attribute("transform", "translate(9.0 9.0)")


def test_a_mark_shows_where_the_blades_close_across_the_cane(page: Page, server: PlayedServer) -> None:
    first, second, *_ = server.points
    server.points = (msgspec.structs.replace(first, cane_angle=-1.57), msgspec.structs.replace(second, cane_angle=None))
    server.tell(server.page_points())
    marks = page.locator("rp-camera .mark")
    expect(marks).to_have_count(2)
    expect(marks.nth(0).locator("path.ring")).to_have_attribute("transform", "rotate(-90) scale(1.5)")
    expect(marks.nth(1).locator("path.ring")).to_have_attribute("visibility", "hidden")


def test_on_a_telephone_the_picture_to_tap_comes_into_sight(page: Page, server: PlayedServer) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    open_screen(page, "review")
    page.locator("#add-by-hand").scroll_into_view_if_needed()
    picture = page.locator("rp-review rp-cut-picture")
    assert box_of(picture)["y"] < box_of(page.locator("main"))["y"]
    page.locator("#add-by-hand").click()
    until(page, lambda: box_of(picture)["y"] >= box_of(page.locator("main"))["y"])
