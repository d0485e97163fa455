"""Points by hand as a person places them: the real page, the real 3-D view, real processes."""

import json
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page

from tests.support.operator_page import operator_page
from tests.support.processes.live_robot import LiveRobot

pytestmark = [pytest.mark.browser, pytest.mark.alone, pytest.mark.slow]
#: Of the lines that show which canes are known, in the 3-D view.
BLUE = np.array([84, 172, 224])
CLICKS = 5
#: Refusals of a click that is beside a cane, or on a point.
BESIDE = {"row_unseen_there", "click_beside_cane", "click_elsewhere", "picture_too_old", "point_there_already"}


def click_and_hear(page: Page, x: float, y: float) -> tuple[dict, dict]:
    """Click, and wait for what the page asked and was answered."""
    with page.expect_response(lambda response: "/api/points/by-hand" in response.url, timeout=15_000) as heard:
        page.mouse.click(x, y)
    return json.loads(heard.value.request.post_data or "{}"), heard.value.json()


def blue_places(page: Page) -> list[tuple[float, float]]:
    """Where lines of known canes are drawn in the 3-D view, clear of what lies over it (px of the page)."""
    box = page.locator("rp-scene iframe").bounding_box()
    assert box is not None
    image = np.asarray(Image.open(BytesIO(page.screenshot())).convert("RGB")).astype(int)
    row, col = np.nonzero(np.abs(image - BLUE).sum(axis=2) < 70)
    inside = (col > box["x"] + 5) & (col < box["x"] + box["width"] - 5)
    inside &= (row > box["y"] + 90) & (row < box["y"] + box["height"] - 5)
    return list(zip(col[inside].tolist(), row[inside].tolist(), strict=True))


def beside_line(point: list[float], line: dict) -> float:
    """Distance of a place from a line of sight (m)."""
    off = np.subtract(point, line["origin"])
    along = np.array(line["direction"])
    return float(np.linalg.norm(off - along * float(off @ along)))


def test_clicks_on_canes_in_the_view_and_in_the_image_place_points(tmp_path: Path, chromium_path: str) -> None:
    with LiveRobot(tmp_path, seed=4) as robot, operator_page(chromium_path, robot.link("ada"), scale=1.0) as page:
        page.wait_for_selector('[data-cut][data-state="PROPOSED"]', timeout=90_000)
        page.click('[data-tab="review"]')
        page.click("#add-by-hand")
        page.click('[data-tab="work"]')
        page.wait_for_function("document.querySelector('rp-scene iframe').classList.contains('loaded')")
        robot.wait(lambda: len(blue_places(page)) > 50, 30, "the known canes to be drawn")
        places = blue_places(page)
        chosen = np.linspace(0, len(places) - 1, CLICKS).astype(int)
        answers = [click_and_hear(page, *places[k]) for k in chosen]
        placed = [(line, answer["values"]["point"]) for line, answer in answers if answer["ok"]]
        assert len(placed) >= CLICKS - 2, answers

        def shown() -> dict[str, dict]:
            return {row["point"]["point_id"]: row["point"] for row in robot.points()}

        robot.wait(lambda: {name for _, name in placed} <= set(shown()), 10, "the placed points to be shown")
        points = shown()
        for line, name in placed:
            assert points[name]["kind"] == "by hand"
            assert beside_line(points[name]["position"], line) < 0.04
        for _, answer in answers:
            assert answer["ok"] or answer["code"] in BESIDE

        # In the camera image 50 px above the mark of a cut is the same cane, mostly.
        page.click("#swap")
        box = page.locator("rp-camera .picture svg").bounding_box()
        assert box is not None
        size = robot.client.get("/api/points").json()["image_size"]
        pixels = [row["pixel"] for row in robot.points() if row["pixel"] and row["point"]["kind"] == "spur cut"]
        asked = [(u / size[0], (v - 50.0) / size[1]) for u, v in pixels if 60 < v and 40 < u < size[0] - 40][:CLICKS]
        answers = [click_and_hear(page, box["x"] + u * box["width"], box["y"] + v * box["height"]) for u, v in asked]
        assert sum(answer["ok"] for _, answer in answers) >= len(asked) - 2 > 0, answers
        name = next(answer["values"]["point"] for _, answer in answers if answer["ok"])
        page.wait_for_selector(f'rp-work [data-cut="{name}"]', timeout=10_000, state="attached")
