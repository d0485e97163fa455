"""Choosing a point anywhere brings list, picture and 3-D view there; at work the page goes along with the robot."""

from typing import Any

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages import page as p
from rolling_panda.messages.perception import SpurDrawing
from tests.support.drawings import COLUMN
from tests.support.page_parts import mark, of_kind, open_screen, planned, ready, removal, show
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer, controller, point

pytestmark = pytest.mark.browser


@pytest.fixture
def screen() -> str:
    return "review"


MANY = 60


@pytest.fixture
def server() -> PlayedServer:
    rows = [point(1 + k, "ACCEPTED", vine=1 + k // 4, spur=1 + k % 4) for k in range(MANY)]
    # All of them on the image, where they can be pressed.
    return PlayedServer(
        points=tuple(
            msgspec.structs.replace(row, pixel=(30.0 + 42.0 * (k % 10), 40.0 + 50.0 * (k // 10)))
            for k, row in enumerate(rows)
        )
    )


def in_view(page: Page, name: str) -> bool:
    """Whether its sign is to be seen in the strip."""
    item, frame = box_of(mark(page, name)), box_of(page.locator("rp-point-strip"))
    return item["x"] >= frame["x"] - 1 and item["x"] + item["width"] <= frame["x"] + frame["width"] + 1


def is_shown(page: Page, name: str) -> None:
    expect(mark(page, name)).to_have_attribute("aria-current", "true")
    expect(page.locator(f'rp-review[data-key="{name}"][data-pictured="shown"]')).to_be_visible()
    until(page, lambda: in_view(page, name))


def chosen(server: PlayedServer) -> list[tuple[str, bool]]:
    return [(each.point_id, each.follow) for each in server.said if isinstance(each, p.Select)]


def at_work(server: PlayedServer, name: str, **changes: Any) -> None:
    server.controller = controller("AUTO", phase="APPROACH", active_point_id=name, **changes)


def test_choosing_in_the_picture_or_the_3d_view_brings_the_list_there(page: Page, server: PlayedServer) -> None:
    assert not in_view(page, "p50")
    page.locator("#swap").click()
    page.locator("rp-camera .mark").nth(49).locator(".target").click(force=True)
    is_shown(page, "p50")
    until(page, lambda: chosen(server) == [("p50", False)])
    # The server has brought the view there already.
    server.tell(p.Selected(point_id="p7"))
    is_shown(page, "p7")
    assert chosen(server) == [("p50", False)]
    # Looked away from, and clicked again in the view: the list comes back.
    page.locator("rp-point-strip").evaluate("strip => { strip.scrollLeft = strip.scrollWidth; }")
    until(page, lambda: not in_view(page, "p7"))
    server.tell(p.Selected(point_id="p7"))
    is_shown(page, "p7")


def test_choosing_a_row_brings_the_view_and_pressing_it_again_once_more(page: Page, server: PlayedServer) -> None:
    head = mark(page, "p2")
    head.click()
    is_shown(page, "p2")
    until(page, lambda: chosen(server) == [("p2", False)])
    expect(page.locator("rp-camera .mark.selected")).to_have_count(1)
    page.wait_for_function("at => performance.now() > at + 450", arg=page.evaluate("performance.now()"))
    head.click()
    until(page, lambda: chosen(server) == [("p2", False), ("p2", False)])
    page.keyboard.press("ArrowRight")
    is_shown(page, "p3")


def test_choosing_in_the_order_of_work_brings_the_queue_and_the_other_way_round(
    page: Page, server: PlayedServer
) -> None:
    page.locator("rp-order summary").click()
    mark(page, f"p{MANY}").click()
    expect(page.locator('.order-row[aria-selected="true"]')).to_have_attribute("data-point-id", f"p{MANY}")
    first = page.locator(".order-row").first
    name = first.get_attribute("data-point-id")
    assert name is not None
    first.click()
    is_shown(page, name)


@pytest.mark.long
def test_at_work_list_and_picture_go_along_but_not_from_under_somebodys_hand(page: Page, server: PlayedServer) -> None:
    at_work(server, "p40")
    is_shown(page, "p40")
    at_work(server, "p41")
    is_shown(page, "p41")
    until(page, lambda: chosen(server) == [("p40", True), ("p41", True)])
    # Somebody chooses another one: it stays theirs for a while, then the page goes along again.
    server.tell(p.Selected(point_id="p5"))
    is_shown(page, "p5")
    at_work(server, "p42")
    expect(mark(page, "p42")).to_have_class("strip-mark active")
    expect(mark(page, "p5")).to_have_attribute("aria-current", "true")
    expect(mark(page, "p42")).to_have_attribute("aria-current", "true", timeout=15_000)
    is_shown(page, "p42")
    assert chosen(server)[2:] == [("p42", True)]


def test_work_draws_the_cut_under_way_on_its_picture(page: Page, server: PlayedServer) -> None:
    open_screen(page, "work")
    at_work(server, "p40")
    picture = page.locator(".work-picture")
    expect(picture).to_have_attribute("data-shown", "yes")
    expect(picture.locator(".blade")).to_be_visible()
    expect(picture.locator(".falls > *").first).to_be_attached()
    head, cut = box_of(page.locator(".work-cut h2")), box_of(picture)
    assert cut["y"] >= head["y"] + head["height"]


@pytest.mark.parametrize("row", [12.0, 168.0])
def test_a_cut_at_the_edge_of_its_picture_is_in_sight_at_work(
    page: Page, server: PlayedServer, monkeypatch: pytest.MonkeyPatch, row: float
) -> None:
    drawn = server.drawing_of

    def at_the_edge(path: str) -> SpurDrawing | None:
        found = drawn(path)
        moved = () if found is None else [msgspec.structs.replace(cut, position=(COLUMN, row)) for cut in found.cuts]
        return None if found is None else msgspec.structs.replace(found, cuts=tuple(moved))

    monkeypatch.setattr(server, "drawing_of", at_the_edge)
    page.reload()
    open_screen(page, "work")
    at_work(server, "p40")
    picture = page.locator(".work-picture")
    expect(picture).to_have_attribute("data-shown", "yes")

    def is_in_sight() -> bool:
        blades, part = picture.locator(".blade .tips").bounding_box(), box_of(picture)
        if blades is None:
            return False
        return part["y"] <= blades["y"] and blades["y"] + blades["height"] <= part["y"] + part["height"]

    until(page, is_in_sight)


def test_nobody_is_taken_along_while_nothing_is_cut_or_a_point_is_placed(page: Page, server: PlayedServer) -> None:
    server.controller = controller("READY", active_point_id="")
    page.locator("#add-by-hand").click()
    at_work(server, "p40")
    expect(mark(page, "p40")).to_have_class("strip-mark active")
    assert chosen(server) == []


@pytest.mark.long
def test_the_time_left_learns_from_the_cuts_that_are_made(page: Page, server: PlayedServer) -> None:
    def tells(stamp: float, *, cut: int, mode: m.Mode = "AUTO") -> None:
        server.controller = controller(mode, phase="APPROACH", header=m.Header(stamp=stamp))
        page.wait_for_timeout(600)
        # Each is planned to take 3.5 s. Of the last one that the blades closed on it is not known yet what came of it.
        states: list[m.PointState] = [*["DONE"] * (cut - 1), *["CUTTING"] * (cut > 0), *["ACCEPTED"] * (4 - cut)]
        show(server, *(planned(point(k, state, spur=k), 1) for k, state in enumerate(states, 1)))

    left = page.locator("rp-vines p")
    tells(100.0, cut=0)
    expect(left).to_have_text("0 of 4 done · 14 s left")
    tells(107.0, cut=1)
    expect(left).to_have_text("0 of 4 done · 21 s left")
    # Of the cut under way what is left of it.
    tells(110.0, cut=1)
    expect(left).to_have_text("0 of 4 done · 18 s left")
    # A pause is no part of a cut.
    tells(111.0, cut=1, mode="PAUSED")
    tells(200.0, cut=1)
    tells(207.0, cut=2)
    expect(left).to_have_text("1 of 4 done · 14 s left")


def test_what_waits_for_a_person_is_the_same_number_everywhere(page: Page, server: PlayedServer) -> None:
    def site(needs: m.Need, spur: int) -> m.UndecidedSite:
        return m.UndecidedSite(reasons.nodes_lacking(0, 2), needs, 1, spur, (1.0, 0.0, 0.8))

    # Two reasons at one spur are one place. What was left waits for nobody.
    sites = (site("operator", 3), site("another look", 3), site("another look", 4), site("nothing", 5))
    server.undecided_sites = sites
    server.controller = ready()
    show(server, point(1, "PROPOSED"), point(2, "FAILED_NOT_CUT", spur=2, reason="it stands"))
    expect(page.locator('[data-tab="review"] .badge')).to_have_text("4")
    open_screen(page, "work")
    expect(page.locator("#needs-you")).to_have_text("4 need you")
    expect(page.locator("rp-work .needs")).to_have_text("1 not cut · 1 to review · 2 places to decide")
    # What the camera may still settle by itself waits for nobody yet.
    server.controller = controller("AUTO", phase="SURVEY")
    expect(page.locator("#needs-you")).to_have_text("3 need you")


def test_the_cuts_of_a_spur_are_told_apart_by_their_kind(page: Page, server: PlayedServer) -> None:
    renewal = of_kind(point(2, "ACCEPTED"), "renewal cut", reasons.renewal_cut(1))
    old = removal(point(4, "ACCEPTED"))
    show(
        server,
        planned(point(1, "ACCEPTED"), 1),
        planned(renewal, 2),
        planned(old, 3),
        planned(point(3, "ACCEPTED", spur=2), 4),
    )
    open_screen(page, "work")
    names = ["Spur 1 · Spur cut", "Spur 1 · Renewal cut", "Spur 1 · Removal", "Spur 2"]
    expect(page.locator("rp-work .cut-place")).to_have_text(names)
    open_screen(page, "review")
    page.locator("rp-order summary").click()
    expect(page.locator(".order-name")).to_have_text([f"Vine 1, {name[0].lower()}{name[1:]}" for name in names])
