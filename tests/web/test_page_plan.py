"""What the page's queue shows of the session's plan."""

import re

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import reasons
from rolling_panda.messages.supervision import PointPlan
from rolling_panda.reasons import text_of
from tests.support.page_parts import choose, mark
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


def test_what_the_plan_says_of_a_cut_is_told_or_why_it_refuses_it(page: Page) -> None:
    review = choose(page, "p1")
    expect(review.locator(".review-robot")).to_have_text(
        "Cut no. 2 of the work: 3.1 s, 122 mm between link 5 and camera."
    )
    review = choose(page, "p2")
    expect(review.locator(".review-why")).to_contain_text("No posture of the arm reaches it")
    expect(review.locator(".review-robot")).to_be_empty()
    review = choose(page, "p3")
    expect(review.locator(".review-robot")).to_be_empty()


def test_what_the_plan_refuses_neither_looks_accepted_nor_is_counted_so(page: Page, server: PlayedServer) -> None:
    expect(page.locator("rp-order summary")).to_contain_text("1 point, by the plan, 3 s · 1 cannot be reached")
    signs = page.locator(".strip-mark[data-point-id] .body").evaluate_all(
        "all => all.map(each => [getComputedStyle(each).fill, each.getAttribute('d')])"
    )
    assert len({color for color, _ in signs}) == len({shape for _, shape in signs}) == 3
    marks = page.locator("rp-camera .mark .sign").evaluate_all("all => all.map(each => each.getAttribute('d'))")
    assert len(set(marks)) == 3, "nor does it in the picture"
    review = choose(page, "p2")
    expect(review.locator(".review-state")).to_have_text("Cannot reach")
    expect(page.locator("#review-accept")).to_have_attribute(
        "title", re.compile("^Vine 1, spur 1 is accepted, and cannot be reached: No posture of the arm reaches it")
    )
    # It can be taken off; where it is the only one nothing can be started, for that reason.
    page.locator("#review-leave").click()
    until(page, lambda: bool(server.posted))
    assert server.posted[-1] == ("/api/points/p2/reject", {"reason": ""})
    none = reasons.none_reachable(1)
    server.controller = controller("READY", allowed={"Start": none})
    server.points = server.points[1:2]
    server.tell(server.page_points())
    expect(page.locator(".strip-mark[data-point-id]")).to_have_count(1)
    expect(mark(page, "p2")).to_have_attribute("data-status", "unreachable")
    expect(page.locator("#start")).to_have_attribute("title", text_of(none))


def test_it_looks_accepted_again_once_the_plan_can_reach_it(page: Page, server: PlayedServer) -> None:
    expect(mark(page, "p2")).to_have_attribute("data-status", "unreachable")
    near = msgspec.structs.replace(WAY, point_id="p2", order=1)
    server.points = (msgspec.structs.replace(point(2, "ACCEPTED"), plan=near), *server.points[::2])
    server.tell(server.page_points())
    expect(mark(page, "p2")).to_have_attribute("data-status", "accepted")
    expect(page.locator("rp-order summary")).to_contain_text("2 points")
