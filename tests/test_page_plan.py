"""What the page's queue shows of the session's plan."""

from collections.abc import Iterator

import msgspec
import pytest
from operator_page import FLAGS
from played_server import ORIGIN, PlayedServer, point
from playwright.sync_api import Page, expect, sync_playwright

from rolling_panda.plan_messages import PointPlan

pytestmark = pytest.mark.browser
WAY = PointPlan(
    point_id="p1",
    revision=4,
    order=2,
    duration_s=3.14,
    clearance=0.122,
    between=("link5", "camera"),
    manipulability=0.07,
)
REFUSAL = PointPlan(point_id="p2", revision=4, order=0, reason="no posture of the arm reaches it")


@pytest.fixture
def page(chromium_path: str) -> Iterator[Page]:
    far = point(2, "ACCEPTED", reason="the plan refuses it: no posture of the arm reaches it")
    rows = (
        msgspec.structs.replace(point(1, "ACCEPTED"), plan=WAY),
        msgspec.structs.replace(far, plan=REFUSAL),
        point(3, "PROPOSED"),
    )
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=chromium_path, args=list(FLAGS))
        page = chromium.new_page(viewport={"width": 1280, "height": 800}, locale="en-US")
        PlayedServer(points=rows).attach(page)
        page.goto(f"{ORIGIN}/")
        yield page
        chromium.close()


def test_a_row_says_its_number_and_way_or_why_the_plan_refuses_it(page: Page) -> None:
    facts = page.locator('[data-point-id="p1"] .facts')
    expect(page.locator('[data-point-id="p1"] .reason')).to_contain_text("no. 2, way 3.1 s")
    assert "leaves 122 mm between link5 and camera, manipulability 0.070" in (facts.get_attribute("title") or "")
    expect(page.locator('[data-point-id="p2"] .reason')).to_contain_text("no posture of the arm reaches it")
    for other in ("p2", "p3"):
        expect(page.locator(f'[data-point-id="{other}"] .reason')).not_to_contain_text("way 3")
