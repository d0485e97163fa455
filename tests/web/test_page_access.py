"""What assistive technology, a finger and a tired eye need of the page, in every state that it has."""

from typing import Literal

import pytest
from playwright.sync_api import Browser, Page, expect

from rolling_panda import reasons
from rolling_panda.messages import page as p
from rolling_panda.reasons import text_of
from tests.support.axe import axe, grave, violations
from tests.support.page_parts import leave, open_screen
from tests.support.page_states import STATES
from tests.support.played_page import box_of
from tests.support.played_server import ORIGIN, PlayedServer

__all__ = ["axe"]
pytestmark = pytest.mark.browser
#: Greyed controls that give no reason, or that no keyboard comes to: the reason is told to whoever hovers, presses, or
#: comes there by keys. A row of the queue is reached by arrows, and its buttons by Tab from there.
_UNEXPLAINED = """all => all.filter(each => each.matches(":disabled") || each.tabIndex < 0 ||
    !each.title || each.getAttribute("aria-description") !== each.title).map(each => each.outerHTML.slice(0, 160))"""


def unexplained(page: Page) -> list[str]:
    greyed = page.locator(':is(button, input, select):is(:disabled, [aria-disabled="true"]):visible')
    return [f"no reason: {each}" for each in greyed.evaluate_all(_UNEXPLAINED)]


#: One after the other on one page, as a person would come to them.
USUAL = (
    "no-points", "rule", "all-states", "preview", "charts", "report-empty", "teleoperate-joints", "viewer", "stopped",
    "link-lost",
)  # fmt: skip


@pytest.mark.long
def test_nothing_keeps_anybody_from_using_the_page(page: Page, server: PlayedServer, axe: str) -> None:
    found: list[str] = []
    for name in USUAL:
        page.emulate_media(color_scheme="light", reduced_motion="reduce")
        leave(page, server)
        STATES[name](page, server)
        found += [f"{name}: {problem}" for problem in grave(page, axe) + unexplained(page)]
        # Darkness changes colours and nothing else.
        page.emulate_media(color_scheme="dark", reduced_motion="reduce")
        found += [f"{name}, dark: {problem}" for problem in grave(page, axe, "color-contrast")]
    assert not found, "\n".join(found)


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_on_any_screen(
    page: Page, server: PlayedServer, axe: str, scheme: Literal["light", "dark"]
) -> None:
    page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
    found: list[str] = []
    STATES["alarms"](page, server)
    for name in ("work", "review", "drive", "report", "engineer"):
        open_screen(page, name)
        for width, height in ((1280, 800), (390, 844)):
            page.set_viewport_size({"width": width, "height": height})
            found += [f"{name}, {width}: {problem}" for problem in violations(page, axe)]
    assert not found, "\n".join(found)


# A page of its own for each state takes a minute; these two have the most in the least room.
@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=() if n in ("all-states", "teleoperate-base") else pytest.mark.slow) for n in STATES],
)
def test_every_state_fits_a_tablet_and_keeps_nobody_out(
    browser: Browser, server: PlayedServer, axe: str, name: str
) -> None:
    context = browser.new_context(viewport={"width": 1024, "height": 768}, locale="en-US", has_touch=True)
    page = context.new_page()
    server.attach(page)
    page.goto(f"{ORIGIN}/")
    expect(page.locator("rp-scene iframe")).to_have_class("loaded")
    STATES[name](page, server)
    assert grave(page, axe) + unexplained(page) == []
    cut = "all => all.filter(each => each.scrollWidth > each.clientWidth + 1).map(each => each.outerHTML)"
    assert page.locator("button:visible").evaluate_all(cut) == []
    overflow = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
    assert overflow[0] <= 1024 and overflow[1] <= 768
    context.close()


def test_a_greyed_control_does_nothing_and_says_why_to_keyboard_and_finger(page: Page, server: PlayedServer) -> None:
    STATES["rule"](page, server)
    server.posted.clear()
    server.role = "viewer"
    slider, why = page.locator("#rule-nodes_kept"), page.locator(".why")
    expect(slider).to_be_disabled()
    page.locator("#system-guyot").focus()
    page.keyboard.press("Tab")
    expect(slider).to_be_focused()
    expect(why).to_have_text(text_of(reasons.viewer_only()))
    before = slider.input_value()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("End")
    box = box_of(slider)
    page.mouse.click(box["x"] + 0.9 * box["width"], box["y"] + box["height"] / 2)
    expect(page.locator(".toast")).to_have_text(f"{text_of(reasons.viewer_only())}×")
    page.keyboard.press("Tab")
    page.keyboard.press("Shift+Tab")
    expect(why).to_be_visible()
    page.keyboard.press("Escape")
    expect(why).to_be_hidden()
    assert slider.input_value() == before
    assert server.posted == []


def test_signing_in_needs_no_eyes(tab: Page, server: PlayedServer, axe: str) -> None:
    tab.set_viewport_size({"width": 1024, "height": 768})
    server.attach(tab)
    tab.goto(f"{ORIGIN}/sign-in")
    expect(tab.locator("h1")).to_be_visible()
    assert grave(tab, axe) == []


#: What is smaller than a fingertip; a tick is pressed by its words too.
SMALL = """all => all.flatMap(each => {
  const box = (each.type === "checkbox" ? each.closest("label") : each).getBoundingClientRect();
  return Math.min(box.width, box.height) < 47.5 ? [`${each.outerHTML.slice(0, 90)}: ${box.width}×${box.height}`] : [];
})"""


@pytest.mark.long
def test_a_fingertip_hits_everything_that_can_be_pressed(browser: Browser, server: PlayedServer) -> None:
    context = browser.new_context(viewport={"width": 1024, "height": 768}, locale="en-US", has_touch=True)
    page = context.new_page()
    server.attach(page)
    page.goto(f"{ORIGIN}/")
    expect(page.locator("#mode")).to_have_attribute("data-mode", "READY")
    for name in ("review", "drive", "report", "engineer", "work"):
        open_screen(page, name)
        for width, height in ((1024, 768), (820, 1180)):
            page.set_viewport_size({"width": width, "height": height})
            pressed = page.locator("button:visible, select:visible, summary:visible, input:visible, a:visible")
            assert pressed.evaluate_all(SMALL) == [], name
            overflow = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
            assert overflow[0] <= width and overflow[1] <= height
    context.close()


def test_the_log_is_searched_by_severity_process_and_words(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    armed = reasons.said("READY")
    lines = [("bridge", "error", reasons.robot_cutter_jammed()), ("controller", "info", armed)]
    lines.append(("controller", "warning", reasons.said("p7 is refused: too near a wire")))
    events = [
        p.PageEvent(number, server.started + number, process, severity, "for scripts", reason)
        for number, (process, severity, reason) in enumerate(lines, 2)
    ]
    server.tell(p.PageEvents(events=tuple(events)))
    shown = page.locator("#log li:visible .text")
    expect(shown).to_have_count(4)
    page.locator("#log-process").select_option("controller")
    expect(shown).to_have_text(["Ready", "p7 is refused: too near a wire"])
    page.locator("#log-filter").select_option("warning")
    expect(shown).to_have_text(["p7 is refused: too near a wire"])
    page.locator("#log-filter").select_option("info")
    page.locator("#log-words").fill("ready")
    expect(shown).to_have_text(["Ready"])
    page.locator("#log-words").fill("no such thing")
    expect(page.locator("#log .empty")).to_have_text("Nothing in the log is like that.")
