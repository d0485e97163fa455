"""The labelling page in a real browser, with its own server."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page, expect

from perception.dataset.dataset import FAR, UNLABELLED, read_dataset
from perception.segmentation.frame import CANE, TRUNK
from tests.support.axe import axe, grave
from tests.support.labelling_page import labelling_page, vines

pytestmark = pytest.mark.browser
__all__ = ["axe"]


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    return vines(tmp_path / "vines")


@pytest.fixture
def tab(browser: Browser, dataset: Path) -> Iterator[Page]:
    with labelling_page(dataset) as link:
        context = browser.new_context(viewport={"width": 1024, "height": 700})
        page = context.new_page()
        page.set_default_timeout(10_000)
        opened(page, link)
        yield page
        context.close()


def opened(page: Page, link: str) -> None:
    page.goto(link)
    expect(page.locator(".label-name")).to_have_text("v0.jpg")
    expect(page.locator("#label-take")).to_have_attribute("aria-disabled", "false")


def labels(dataset: Path, name: str = "v0.jpg") -> NDArray[np.uint8]:
    return read_dataset(dataset).load(name)[1]


def until(holds: Callable[[], bool]) -> None:
    ends = time.monotonic() + 10
    while not holds():
        assert time.monotonic() < ends, "it did not come about"
        time.sleep(0.05)


def place(page: Page, x: float, y: float) -> tuple[float, float]:
    """On the screen, of a point of the picture, which fills the view's width or height but for its margin."""
    box = page.locator("rp-label-canvas canvas").bounding_box()
    assert box is not None
    scale = min((box["width"] - 24) / 96, (box["height"] - 24) / 64)
    left, top = box["x"] + (box["width"] - 96 * scale) / 2, box["y"] + (box["height"] - 64 * scale) / 2
    return left + x * scale, top + y * scale


def stroke(page: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    page.mouse.move(*place(page, *start))
    page.mouse.down()
    page.mouse.move(*place(page, *end), steps=6)
    page.mouse.up()


def test_a_stroke_is_saved_at_once_undone_with_z_and_there_again_after_a_reload(tab: Page, dataset: Path) -> None:
    tab.keyboard.press("5")
    for _ in range(2):
        tab.keyboard.press("[")
    expect(tab.locator("rp-label-tools output")).to_have_text("3 px")
    stroke(tab, (30.5, 20.5), (60.5, 20.5))
    expect(tab.locator(".label-saved")).to_contain_text("Saved")
    painted = labels(dataset) == TRUNK
    assert painted[19:22, 30:61].all() and not painted[:18].any() and not painted[23:].any()
    assert (labels(dataset)[~painted] == UNLABELLED).all()
    expect(tab.locator('[data-picture="v0.jpg"]')).to_contain_text("% labelled")
    tab.keyboard.press("z")
    until(lambda: bool((labels(dataset) == UNLABELLED).all()))
    tab.keyboard.press("y")
    until(lambda: bool(((labels(dataset) == TRUNK) == painted).all()))
    tab.reload()
    expect(tab.locator("#label-take")).to_have_attribute("aria-disabled", "false")
    # A stroke after the reload adds to what is there; the eraser takes it off.
    tab.keyboard.press("0")
    stroke(tab, (45.5, 10.5), (45.5, 30.5))
    until(lambda: labels(dataset)[20, 45] == UNLABELLED)
    assert labels(dataset)[20, 32] == TRUNK


def test_the_proposed_wood_is_taken_where_nothing_is_labelled_and_the_rest_is_far(tab: Page, dataset: Path) -> None:
    tab.keyboard.press("5")
    stroke(tab, (5.5, 20.5), (25.5, 20.5))
    until(lambda: labels(dataset)[20, 15] == TRUNK)
    tab.keyboard.press("t")
    until(lambda: labels(dataset)[50, 15] == CANE)
    assert labels(dataset)[20, 15] == TRUNK and labels(dataset)[50, 40] == UNLABELLED
    tab.keyboard.press("r")
    until(lambda: labels(dataset)[50, 40] == FAR)
    expect(tab.locator('[data-picture="v0.jpg"]')).to_contain_text("100 % labelled")
    # One key takes each of them back as a whole.
    for _ in range(2):
        tab.keyboard.press("z")
    until(lambda: labels(dataset)[50, 15] == UNLABELLED and labels(dataset)[20, 15] == TRUNK)


def test_keys_turn_the_pages_hide_the_proposal_and_choose_the_brush(tab: Page, dataset: Path, axe: str) -> None:
    tab.keyboard.press("ArrowRight")
    expect(tab.locator(".label-name")).to_have_text("v1.jpg")
    tab.keyboard.press("ArrowLeft")
    expect(tab.locator(".label-name")).to_have_text("v0.jpg")
    expect(tab.locator("#label-proposal")).to_be_checked()
    before = pixel(tab, 15, 40)
    tab.keyboard.press(" ")
    expect(tab.locator("#label-proposal")).not_to_be_checked()
    tab.wait_for_timeout(100)
    assert pixel(tab, 15, 40) != before
    for key, name in (("1", "cane"), ("9", "far"), ("e", "unlabelled"), ("p", "proposal")):
        tab.keyboard.press(key)
        expect(tab.locator(f'[data-tool="{name}"]')).to_have_attribute("aria-pressed", "true")
    tab.locator('[data-split="held-out"]').click()
    expect(tab.locator('[data-picture="v0.jpg"] .label-out')).to_be_visible()
    until(lambda: read_dataset(dataset).names("held-out") == ["v0.jpg", "v2.jpg"])
    assert grave(tab, axe) == []


def pixel(page: Page, x: float, y: float) -> list[int]:
    """Mean colour of a part of the view."""
    box = page.locator("rp-label-canvas canvas").bounding_box()
    assert box is not None
    left, top = place(page, x, y)
    return page.evaluate(
        """([x, y]) => {
            const canvas = document.querySelector("rp-label-canvas canvas");
            const data = canvas.getContext("2d").getImageData(x - 12, y - 12, 24, 24).data;
            return [0, 1, 2].map((at) => data.filter((_, index) => index % 4 === at).reduce((a, b) => a + b, 0));
        }""",
        [left - box["x"], top - box["y"]],
    )


@pytest.mark.long
def test_strokes_made_while_the_program_is_away_are_saved_when_it_is_back(browser: Browser, dataset: Path) -> None:
    context = browser.new_context(viewport={"width": 1024, "height": 700})
    try:
        page = context.new_page()
        with labelling_page(dataset) as link:
            opened(page, link)
        tab_port = int(link.split(":")[2].split("/")[0])
        stroke(page, (30.5, 20.5), (60.5, 20.5))
        expect(page.locator(".label-saved")).to_contain_text("Not saved: the program does not answer")
        page.keyboard.press("ArrowRight")
        page.wait_for_timeout(200)
        # The stroke is not left behind.
        expect(page.locator(".label-name")).to_have_text("v0.jpg")
        with labelling_page(dataset, tab_port) as again:
            expect(page.locator(".label-saved")).to_contain_text("signed out")
            context.new_page().goto(again)
            expect(page.locator(".label-saved")).to_contain_text("Saved", timeout=10_000)
            assert labels(dataset)[20, 45] == CANE
    finally:
        context.close()
