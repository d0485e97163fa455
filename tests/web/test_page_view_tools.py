"""Cameras, layers and measure of the 3-D view, by the page's buttons and keys."""

import pytest
from playwright.sync_api import Page, expect

from rolling_panda import reasons
from rolling_panda.messages import page as p
from rolling_panda.reasons import text_of
from tests.support.page_parts import open_screen
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer

pytestmark = pytest.mark.browser


def presets(server: PlayedServer) -> list[str]:
    return [message.preset for message in server.said if isinstance(message, p.PlaceCamera)]


def layers(server: PlayedServer) -> list[set[str]]:
    return [set(message.layers) for message in server.said if isinstance(message, p.ShowLayers)]


def test_the_camera_is_placed_by_buttons_and_by_keys_also_inside_the_view(page: Page, server: PlayedServer) -> None:
    page.get_by_role("button", name="Top", exact=True).click()
    until(page, lambda: presets(server) == ["top"])
    page.locator("h1").click()
    page.keyboard.press("2")
    until(page, lambda: presets(server)[1:] == ["row"])
    page.locator("#start").focus()
    page.frame_locator("rp-scene iframe").locator("#root").click()
    page.keyboard.press("3")
    until(page, lambda: presets(server)[2:] == ["tool"])
    page.keyboard.press("Control+1")
    page.keyboard.press("9")
    page.wait_for_timeout(100)
    assert len(presets(server)) == 3


def test_little_is_shown_until_it_is_chosen_and_the_choice_is_kept(page: Page, server: PlayedServer) -> None:
    until(page, lambda: layers(server) == [{"plant", "points", "trail"}])
    expect(page.locator("#layers")).to_be_hidden()
    page.locator("#show-layers").click()
    page.get_by_label("Point cloud").check()
    page.get_by_label("Trail of the tool").uncheck()
    until(page, lambda: layers(server)[-1] == {"plant", "points", "cloud"})
    page.keyboard.press("Escape")
    expect(page.locator("#layers")).to_be_hidden()
    server.said.clear()
    page.reload()
    until(page, lambda: layers(server) == [{"plant", "points", "cloud"}])


def test_two_clicks_are_measured_and_said_and_escape_ends_it(page: Page, server: PlayedServer) -> None:
    page.locator("#measure").click()
    until(page, lambda: p.Measure(active=True) in server.said)
    words = page.locator("rp-view-tools .measured")
    expect(words).to_have_text("Click two places in the view.")
    server.tell(p.Measured(offset=(0.3, 0.0, -0.4), between=("cane", "ground")))
    expect(words).to_have_text("0.500 m from cane to ground: 0.300 along, 0.000 across, −0.400 up")
    page.keyboard.press("Escape")
    until(page, lambda: p.Measure(active=False) in server.said)
    expect(words).to_be_hidden()


def test_points_are_placed_or_places_measured_never_both(page: Page, server: PlayedServer) -> None:
    page.locator("#measure").click()
    until(page, lambda: p.Measure(active=True) in server.said)
    open_screen(page, "review")
    page.locator("#add-by-hand").click()
    until(page, lambda: p.Measure(active=False) in server.said)
    open_screen(page, "work")
    expect(page.locator("rp-view-tools")).to_be_hidden()


def test_a_viewer_looks_around_and_is_told_why_measuring_is_not_for_them(page: Page, server: PlayedServer) -> None:
    server.role = "viewer"
    measure = page.locator("#measure")
    expect(measure).to_have_attribute("title", text_of(reasons.viewer_only()))
    expect(page.get_by_role("button", name="Row", exact=True)).to_have_attribute("aria-disabled", "false")
    for button in page.locator("rp-view-tools .tools button:visible").all():
        box = box_of(button)
        assert min(box["width"], box["height"]) >= 44
