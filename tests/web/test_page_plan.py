"""What the page's queue shows of the session's plan."""

import re

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import reasons
from rolling_panda.messages.supervision import PointPlan
from rolling_panda.reasons import text_of
from tests.support.played_page import until
from tests.support.played_server import PlayedServer, controller, point
from tests.support.points import rolled_out

pytestmark = pytest.mark.browser


@pytest.fixture
def screen() -> str:
    return "review"


WAY = PointPlan(
    point_id="p1",
    revision=4,
    order=2,
    rollout=rolled_out("p1", 4, begins_s=5.0, ends_s=8.14, clearance=0.122, manipulability=0.07),
)
REFUSAL = PointPlan(point_id="p2", revision=4, order=0, reason=reasons.out_of_reach(1.2, 0.9))


@pytest.fixture
def server() -> PlayedServer:
    far = point(2, "UNREACHABLE", reason=reasons.out_of_reach(1.2, 0.9))
    rows = (
        msgspec.structs.replace(point(1, "ACCEPTED"), plan=WAY),
        msgspec.structs.replace(far, plan=REFUSAL),
        point(3, "PROPOSED"),
    )
    return PlayedServer(points=rows)


def test_a_row_says_its_number_and_way_or_why_the_plan_refuses_it(page: Page) -> None:
    facts = page.locator('[data-point-id="p1"] .facts')
    expect(page.locator('[data-point-id="p1"] .reason')).to_contain_text("no. 2, 3.1 s")
    assert "the cut takes 3.1 s and leaves 122 mm between link5 and camera, manipulability 0.070" in (
        facts.get_attribute("title") or ""
    )
    expect(page.locator('[data-point-id="p2"] .reason')).to_contain_text("No posture of the arm reaches it")
    for other in ("p2", "p3"):
        expect(page.locator(f'[data-point-id="{other}"] .reason')).not_to_contain_text("no. ")


def test_what_the_plan_refuses_neither_looks_accepted_nor_is_counted_so(page: Page, server: PlayedServer) -> None:
    row = page.locator('rp-point[data-point-id="p2"]')
    expect(row.locator(".point-state")).to_have_text("Cannot reach")
    expect(page.locator("rp-queue .summary")).to_have_text("3 found · 1 accepted · 1 cannot be reached · 0 done")
    expect(page.locator("rp-order summary")).to_contain_text("1 point, by the plan · 1 cannot be reached")
    signs = page.locator("rp-point .point-state").evaluate_all(
        "all => all.map(each => [getComputedStyle(each).color, each.querySelector('path').getAttribute('d')])"
    )
    assert len({color for color, _ in signs}) == len({shape for _, shape in signs}) == 3
    marks = page.locator("rp-camera .mark .sign").evaluate_all("all => all.map(each => each.getAttribute('d'))")
    assert len(set(marks)) == 3, "nor does it in the picture"
    expect(row.locator("button.accept")).to_have_attribute(
        "title", re.compile("^p2 is accepted, and cannot be reached: No posture of the arm reaches it")
    )
    # It can be taken off; where it is the only one nothing can be started, for that reason.
    row.locator("button.reject").click()
    page.keyboard.press("Enter")
    until(page, lambda: bool(server.posted))
    assert server.posted[-1] == ("/api/points/p2/reject", {"reason": ""})
    none = reasons.none_reachable(1)
    server.controller = controller("READY", allowed={"Start": none})
    server.points = server.points[1:2]
    server.tell(server.page_points())
    expect(page.locator("rp-queue .summary")).to_have_text("1 found · 0 accepted · 1 cannot be reached · 0 done")
    expect(page.locator("#start")).to_have_attribute("title", text_of(none))


def test_it_looks_accepted_again_once_the_plan_can_reach_it(page: Page, server: PlayedServer) -> None:
    expect(page.locator('rp-point[data-point-id="p2"] .point-state')).to_have_text("Cannot reach")
    near = msgspec.structs.replace(WAY, point_id="p2", order=1)
    server.points = (msgspec.structs.replace(point(2, "ACCEPTED"), plan=near), *server.points[::2])
    server.tell(server.page_points())
    expect(page.locator('rp-point[data-point-id="p2"] .point-state')).to_have_text("Accepted")
    expect(page.locator("rp-queue .summary")).to_have_text("3 found · 2 accepted · 0 done")
