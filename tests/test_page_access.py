"""What assistive technology, a finger and a tired eye need of the page, in every state that it has."""

from collections.abc import Callable
from typing import get_args

import pytest
from axe import axe, grave
from played_page import box_of
from played_server import ORIGIN, PlayedServer, bridge, controller, point
from playwright.sync_api import Browser, Page, expect

from rolling_panda import messages as m
from rolling_panda import page_messages as p

__all__ = ["axe"]
pytestmark = pytest.mark.browser


def _empty(page: Page, server: PlayedServer) -> None:
    server.points, server.abstained = (), ()
    server.tell(server.page_points())
    expect(page.locator("rp-point")).to_have_count(0)


def _chosen(page: Page, server: PlayedServer) -> None:
    states = enumerate(get_args(m.PointState), 1)
    server.points = tuple(point(number, state, spur=number) for number, state in states)
    server.tell(server.page_points())
    page.locator('[data-point-id="p1"]').click()
    expect(page.locator("rp-point-details")).to_be_visible()


def _running(page: Page, server: PlayedServer) -> None:
    server.controller = controller(
        "AUTO", phase="APPROACH", active_point_id="p2", joint_margin=0.05, position_error=0.02
    )
    expect(page.locator("#mode")).to_have_attribute("data-mode", "AUTO")
    page.locator("rp-telemetry summary").click()


def _stopped(page: Page, server: PlayedServer) -> None:
    server.bridge = bridge(stop_id="s1", stopped_by="Ada: stop button")
    server.controller = controller("ESTOP_LATCHED")
    expect(page.locator("rp-stop-banner")).to_be_visible()


def _link_lost(page: Page, server: PlayedServer) -> None:
    server.online = False
    server.sockets[-1].close()
    expect(page.locator("rp-link-banner")).to_be_visible()


def _rule(page: Page, server: PlayedServer) -> None:
    page.locator("rp-rule summary").click()
    expect(page.locator("rp-rule input").first).to_be_visible()


def _charts(page: Page, server: PlayedServer) -> None:
    page.locator('[data-opens="charts"]').click()
    expect(page.locator("rp-charts")).to_be_visible()


def _report(page: Page, server: PlayedServer) -> None:
    page.locator('[data-opens="report"]').click()
    expect(page.locator("rp-report")).to_contain_text("Nothing has been cut yet.")


STATES: dict[str, Callable[[Page, PlayedServer], None]] = {
    "empty": _empty,
    "a point chosen": _chosen,
    "running": _running,
    "stopped": _stopped,
    "link lost": _link_lost,
    "rule": _rule,
    "charts": _charts,
    "report": _report,
}


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_keeps_anybody_from_using_the_page(page: Page, server: PlayedServer, axe: str, scheme: str) -> None:
    page.emulate_media(color_scheme="dark" if scheme == "dark" else "light", reduced_motion="reduce")
    # Darkness changes colours and nothing else.
    rules = ["color-contrast"] if scheme == "dark" else []
    found: list[str] = []
    for name, reach in STATES.items():
        if name != "empty":
            server.points = (point(1, "PROPOSED"), point(2, "ACCEPTED"))
            server.tell(server.page_points())
        reach(page, server)
        found += [f"{name}: {problem}" for problem in grave(page, axe, *rules)]
        if name == "stopped":
            server.bridge, server.controller = bridge(), controller()
        if name == "link lost":
            server.online = True
            expect(page.locator("rp-link-banner")).to_be_hidden(timeout=10_000)
    assert not found, "\n".join(found)


def test_signing_in_needs_no_eyes(browser: Browser, server: PlayedServer, axe: str) -> None:
    context = browser.new_context(viewport={"width": 1024, "height": 768}, locale="en-US")
    page = context.new_page()
    server.attach(page)
    page.goto(f"{ORIGIN}/sign-in")
    expect(page.locator("h1")).to_be_visible()
    assert grave(page, axe) == []
    context.close()


@pytest.mark.parametrize("size", [(1024, 768), (820, 1180)])
def test_a_fingertip_hits_everything_that_can_be_pressed(
    browser: Browser, server: PlayedServer, size: tuple[int, int]
) -> None:
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, locale="en-US", has_touch=True)
    page = context.new_page()
    server.attach(page)
    page.goto(f"{ORIGIN}/")
    expect(page.locator("#mode")).to_have_attribute("data-mode", "READY")
    page.locator('[data-point-id="p1"]').click()
    page.locator("rp-rule summary").click()
    small = {}
    for pressed in page.locator("button:visible, select:visible, summary:visible, input:visible, a:visible").all():
        # A tick is pressed by its words too.
        ticked = pressed.get_attribute("type") == "checkbox"
        box = box_of(pressed.locator("xpath=ancestor::label") if ticked else pressed)
        if min(box["width"], box["height"]) < 43.5:
            small[pressed.evaluate("each => each.outerHTML.slice(0, 90)")] = (box["width"], box["height"])
    assert not small
    overflow = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
    assert overflow[0] <= size[0] and overflow[1] <= size[1]
    context.close()


def test_the_log_is_searched_by_severity_process_and_words(page: Page, server: PlayedServer) -> None:
    lines = [("bridge", "error", "the cutter is jammed"), ("controller", "info", "READY: armed by Ada")]
    lines.append(("controller", "warning", "p7 is refused: too near a wire"))
    events = [p.PageEvent(number, server.started + number, *line) for number, line in enumerate(lines, 2)]
    server.tell(p.PageEvents(events=tuple(events)))
    shown = page.locator("#log li:visible .text")
    expect(shown).to_have_count(4)
    page.locator("#log-process").select_option("controller")
    expect(shown).to_have_text(["Ready: armed by Ada", "p7 is refused: too near a wire"])
    page.locator("#log-filter").select_option("warning")
    expect(shown).to_have_text(["p7 is refused: too near a wire"])
    page.locator("#log-filter").select_option("info")
    page.locator("#log-words").fill("ready")
    expect(shown).to_have_text(["Ready: armed by Ada"])
    page.locator("#log-words").fill("no such thing")
    expect(page.locator("#log .empty")).to_have_text("Nothing in the log is like that.")
