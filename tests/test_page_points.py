"""What the page tells of a chosen point, and the pruning rule that is tried on it."""

import msgspec
import pytest
from played_page import until
from played_server import PlayedServer, point
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import page_messages as p

pytestmark = pytest.mark.browser


def test_the_chosen_point_shows_its_picture_and_what_is_behind_the_cut(page: Page, server: PlayedServer) -> None:
    expect(page.locator("rp-point-details")).to_have_count(0)
    page.locator('[data-point-id="p1"]').click()
    details = page.locator('[data-point-id="p1"] rp-point-details')
    expect(details.locator(".crop")).to_have_class("crop loaded")
    assert server.crops_fetched[-1].startswith("/api/points/p1/crop?revision=4")
    for words in (
        "Spur cut, 20 mm past node 2",
        "8.0 mm, ≈ 470 N",
        "± 3.0 mm, ± 2°",
        "wire 141 · cordon 62 · node 21 mm",
    ):
        expect(details).to_contain_text(words)
    count = len(server.crops_fetched)
    page.locator('[data-point-id="p3"]').click()
    expect(page.locator("rp-point-details")).to_have_count(1)
    until(page, lambda: len(server.crops_fetched) == count + 1)


def test_a_picture_is_fetched_once_a_revision_and_again_until_it_has_come(page: Page, server: PlayedServer) -> None:
    server.crop = b""
    page.locator('[data-point-id="p1"]').click()
    crop = page.locator("rp-point-details .crop")
    until(page, lambda: len(server.crops_fetched) == 1)
    expect(crop).to_have_class("crop")
    server.crop = PlayedServer().crop
    expect(crop).to_have_class("crop loaded")
    for _ in range(3):
        server.tell(server.page_points())
    page.wait_for_timeout(300)
    assert len(server.crops_fetched) == 2
    first = msgspec.structs.replace(server.points[0].point, revision=5, digest="ab" * 16)
    server.points = (msgspec.structs.replace(server.points[0], point=first), *server.points[1:])
    server.tell(server.page_points())
    until(page, lambda: server.crops_fetched[-1].startswith("/api/points/p1/crop?revision=5"))


def moved(row: p.PagePoint, digest: str) -> p.PagePoint:
    return msgspec.structs.replace(row, point=msgspec.structs.replace(row.point, digest=digest))


def test_another_rule_is_tried_at_once_and_says_what_it_changes(page: Page, server: PlayedServer) -> None:
    expect(page.locator("rp-rule summary")).to_have_text("Spur · 2 nodes · ≥ 6 mm · 20 mm past")
    page.locator("rp-rule summary").click()
    expect(page.locator("#rule-fruiting_nodes")).to_be_hidden()
    page.locator("#rule-offset").focus()
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    until(page, lambda: bool(server.posted))
    page.wait_for_timeout(300)
    assert server.posted == [
        (
            "/api/rule",
            {"system": "spur", "nodes_kept": 2, "fruiting_nodes": 8, "keeper_diameter": 0.006, "offset": 0.025},
        )
    ], "one request for a movement of the hand"
    first, second, third = server.points
    void = msgspec.structs.replace(second.entry, state="PROPOSED", reason="acceptance void: it moved by 5 mm")
    server.rule = m.PruningRule(offset=0.025)
    server.points = (
        moved(first, "a1"),
        msgspec.structs.replace(moved(second, "a2"), entry=void),
        third,
        point(9, "PROPOSED"),
    )
    server.tell(server.page_points())
    expect(page.locator(".rule-outcome")).to_have_text("4 points: 2 moved, 1 new, 1 acceptance void")
    expect(page.locator('[data-point-id="p2"] .reason')).to_contain_text("acceptance void: it moved by 5 mm")
    expect(page.locator("rp-rule summary")).to_contain_text("25 mm past")
    page.locator("#rule-back").click()
    until(page, lambda: len(server.posted) == 2)
    assert server.posted[-1][1]["offset"] == 0.02


def test_guyot_asks_for_the_nodes_of_the_fruiting_cane(page: Page, server: PlayedServer) -> None:
    page.locator("rp-rule summary").click()
    page.locator("#system-guyot").check(force=True)
    until(page, lambda: bool(server.posted))
    assert server.posted[-1][1]["system"] == "guyot"
    server.rule = m.PruningRule(system="guyot")
    server.tell(server.page_points())
    expect(page.locator("#rule-fruiting_nodes")).to_be_visible()


def test_a_rule_that_is_refused_goes_back_and_says_why(page: Page, server: PlayedServer) -> None:
    server.answers["/api/rule"] = (409, {"ok": False, "reason": "perception is busy with a frame"})
    page.locator("rp-rule summary").click()
    page.locator("#rule-nodes_kept").press("ArrowRight")
    expect(page.locator(".rule-outcome")).to_have_text("Not done: perception is busy with a frame")
    expect(page.locator("#rule-nodes_kept")).to_have_value("2")
    server.role = "viewer"
    expect(page.locator("#rule-nodes_kept")).to_be_disabled()
