"""The page of a recording: what it shows, how one moves in it, and that it has no control of a robot."""

import re

import pytest
from playwright.sync_api import Page, expect

from rolling_panda.messages.supervision import ReplayState, Timeline
from tests.support.page_parts import open_screen
from tests.support.page_states import MORNING, a_timeline
from tests.support.played_page import until
from tests.support.played_server import PlayedServer

pytestmark = pytest.mark.browser
DURATION = 600.0


def play(page: Page, server: PlayedServer, **changes: object) -> None:
    """The robot is a recording from now on."""
    usual = {"name": "row.mcap", "begins_at": MORNING, "duration_s": DURATION, "position_s": 150.0, "playing": True}
    server.replay = ReplayState(**(usual | changes))
    expect(page.locator("rp-replay .replay-time")).to_be_visible()


def asked(server: PlayedServer) -> list[object]:
    return [body for path, body in server.posted if path == "/api/replay"]


def test_a_recording_has_a_frame_and_a_name_and_no_control_of_a_robot(page: Page, server: PlayedServer) -> None:
    expect(page.locator("rp-replay")).to_be_hidden()
    expect(page.locator("#stop")).to_be_visible()
    play(page, server)
    expect(page.locator("rp-replay")).to_contain_text("Recording")
    expect(page.locator("rp-replay")).to_contain_text("row.mcap: nothing here moves a robot")
    expect(page).to_have_title("row.mcap – Rolling Panda")
    border = page.locator("body").evaluate("each => getComputedStyle(each).borderTopWidth")
    assert border == "4px"
    for name in ("Stop", "Start", "Arm", "Pause work", "Survey", "Take control", "I've checked", "Home"):
        expect(page.get_by_role("button", name=re.compile(rf"^{name}\b")).locator("visible=true")).to_have_count(0)
    for part in ("#stop", "rp-bar", "rp-lease", "rp-alarms", '[data-tab="drive"]'):
        expect(page.locator(part)).to_be_hidden()
    # The space bar plays and pauses; there is nothing to stop.
    page.locator("body").press(" ")
    until(page, lambda: asked(server) == [{"playing": False}])
    assert server.stops() == []
    for screen in ("review", "report", "engineer", "work"):
        open_screen(page, screen)
        expect(page.locator("#stop")).to_be_hidden()


def test_it_begins_when_somebody_looks_and_not_again_after_a_pause(page: Page, server: PlayedServer) -> None:
    play(page, server, position_s=0.0, playing=False)
    until(page, lambda: asked(server) == [{"playing": True}])
    play(page, server, position_s=0.0, playing=True)
    play(page, server, position_s=0.0, playing=False)
    page.wait_for_timeout(600)
    assert asked(server) == [{"playing": True}]


def test_one_moves_in_it_by_slider_keys_and_speed(page: Page, server: PlayedServer) -> None:
    play(page, server)
    expect(page.locator(".replay-time")).to_contain_text("2:30 of 10:00")
    slider = page.locator("#replay-position")
    expect(slider).to_have_value("150")
    slider.fill("90")
    until(page, lambda: asked(server) == [{"playing": True, "position_s": 90}])
    page.locator("#replay-speed").select_option(label="4×")
    until(page, lambda: len(asked(server)) == 2)
    server.replay = ReplayState(
        name="row.mcap", begins_at=MORNING, duration_s=DURATION, position_s=598.0, playing=False, speed=4.0
    )
    expect(page.locator("#replay-toggle")).to_have_text("Play")
    expect(page.locator("#replay-speed")).to_have_value("4")
    page.keyboard.press("+")
    page.keyboard.press("-")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Home")
    until(page, lambda: len(asked(server)) == 7)
    assert asked(server)[1:] == [
        {"playing": True, "speed": 4},
        {"playing": False, "speed": 8},
        {"playing": False, "speed": 2},
        {"playing": False, "position_s": 600},
        {"playing": False, "position_s": 593},
        {"playing": False, "position_s": 0},
    ]
    # Keys that are meant for a control or a text do nothing else.
    open_screen(page, "engineer")
    page.locator("#log-words").press(" ")
    page.locator("#log-words").press("ArrowLeft")
    page.wait_for_timeout(200)
    assert len(asked(server)) == 7


def test_the_keys_count_after_a_button_was_pressed_too(page: Page, server: PlayedServer) -> None:
    play(page, server)
    page.locator("#replay-toggle").click()
    page.keyboard.press("Home")
    page.keyboard.press(" ")
    until(page, lambda: len(asked(server)) >= 3)
    page.wait_for_timeout(300)
    assert asked(server) == [{"playing": False}, {"playing": True, "position_s": 0}, {"playing": False}]
    # Its own key presses it.
    page.keyboard.press("Enter")
    until(page, lambda: len(asked(server)) == 4)


def test_at_its_end_it_begins_again(page: Page, server: PlayedServer) -> None:
    play(page, server, position_s=DURATION, playing=False)
    page.click("#replay-toggle")
    until(page, lambda: asked(server) == [{"playing": True, "position_s": 0}])


def test_events_are_on_the_scrubber_and_are_jumped_to(page: Page, server: PlayedServer) -> None:
    server.timeline = a_timeline()
    play(page, server)
    marks = page.locator("rp-replay .time-mark")
    stop = marks.and_(page.locator('[data-kind="ESTOP_LATCHED"]'))
    assert stop.get_attribute("aria-label") == "08:34:10 Automatic → Stopped: stop button" or "Stopped" in str(
        stop.get_attribute("aria-label")
    )
    # It is where the slider's thumb comes to be at that time.
    mark, track = stop.bounding_box(), page.locator("rp-replay .time-track").bounding_box()
    assert mark and track
    assert abs((mark["x"] + mark["width"] / 2 - track["x"]) / track["width"] - 450.0 / DURATION) < 0.01
    stop.click()
    until(page, lambda: asked(server) == [{"playing": True, "position_s": 450}])
    # From where it stands to the next event, and to the one before.
    page.locator('[data-step="1"]').click()
    page.locator('[data-step="-1"]').click()
    until(page, lambda: len(asked(server)) == 3)
    assert [body["position_s"] for body in asked(server)[1:]] == [154, 142]  # type: ignore[index]


def test_a_recording_without_events_can_be_moved_in(page: Page, server: PlayedServer) -> None:
    server.timeline = Timeline(began_at=MORNING, ended_at=MORNING + DURATION)
    play(page, server)
    expect(page.locator("rp-replay .time-words")).to_have_text("No cut, stop, pause or refusal so far.")
    expect(page.locator("rp-replay .time-mode")).to_have_text(["Ready"])
    page.locator('[data-step="1"]').click()
    page.locator("#replay-position").fill("90")
    until(page, lambda: asked(server) == [{"playing": True, "position_s": 90}])


def test_a_recording_that_was_cut_short_says_so(page: Page, server: PlayedServer) -> None:
    play(page, server, complete=False)
    expect(page.locator("rp-replay")).to_contain_text("It was cut short")
