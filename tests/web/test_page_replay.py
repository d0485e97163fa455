"""The bar of a recording on the page."""

import pytest
from playwright.sync_api import Page, expect

from rolling_panda.messages.supervision import ReplayState
from tests.support.played_page import until
from tests.support.played_server import PlayedServer

pytestmark = pytest.mark.browser


def test_a_recording_is_named_moved_in_and_tells_who_accepted_which(page: Page, server: PlayedServer) -> None:
    bar = page.locator("rp-replay")
    expect(bar).to_be_hidden()
    server.replay = ReplayState(name="row.mcap", begins_at=1.8e9, duration_s=120.0, position_s=30.0, playing=True)
    expect(bar).to_be_visible()
    expect(bar).to_contain_text("Recording row.mcap: nothing here moves a robot")
    expect(bar).to_contain_text("30.0 of 120.0 s")
    page.click("#replay-toggle")
    slider = page.locator("#replay-position")
    expect(slider).to_have_value("30")
    slider.fill("90")
    until(page, lambda: len(server.posted) >= 2)
    assert [body for path, body in server.posted if path == "/api/replay"] == [
        {"playing": False},
        {"position_s": 90, "playing": True},
    ]
    page.click("rp-replay summary")
    expect(page.locator("#replay-accepted li")).to_have_text(["p2: Ada · Accepted"])
    expect(page.locator("rp-scene")).to_be_in_viewport()
