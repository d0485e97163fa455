"""The operator's page in a real browser, with a server that the test plays: fixtures of every test of the page."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Error, FloatRect, Locator, Page, expect, sync_playwright

from rolling_panda import messages as m
from tests.support.chromium import FLAT_FLAGS
from tests.support.played_server import ORIGIN, PlayedServer, point

#: Keys that a test may leave pressed.
_PRESSED = ("h", "w", "s", "ArrowLeft", "Enter")


@pytest.fixture(scope="module")
def browser(chromium_path: str) -> Iterator[Browser]:
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=chromium_path, args=list(FLAT_FLAGS))
        yield chromium
        chromium.close()


@pytest.fixture
def server() -> PlayedServer:
    return PlayedServer(
        points=(
            point(1, "PROPOSED"),
            point(2, "ACCEPTED", user="Ada", reason="accepted by Ada"),
            point(3, "DONE", spur=2, cut_id="c1"),
        ),
        undecided_sites=(
            m.UndecidedSite("no node seen above the cordon", "another look", 1, 3),
            m.UndecidedSite("a wire passes close to the cut", "operator", 1, 4),
        ),
    )


@pytest.fixture(scope="module")
def tab(browser: Browser) -> Iterator[Page]:
    """One tab for the tests of a file, one after the other: to load the page there again takes half as long."""
    context = browser.new_context(locale="en-US")
    yield context.new_page()
    context.close()


@contextmanager
def opened(tab: Page, attach: Callable[[Page], None], path: str, width: int, height: int) -> Iterator[Page]:
    """A page of what is attached to it, ready; leaving it fails if one of its scripts failed or broke the policy."""
    problems: list[str] = []

    def failed(error: Error) -> None:
        problems.append(str(error))

    def said(message: ConsoleMessage) -> None:
        if "Content Security Policy" in message.text:
            problems.append(message.text)

    tab.set_viewport_size({"width": width, "height": height})
    tab.on("pageerror", failed)
    tab.on("console", said)
    attach(tab)
    tab.goto(f"{ORIGIN}{path}")
    expect(tab.locator("#mode")).to_have_attribute("data-mode", "READY")
    try:
        yield tab
    finally:
        # The next test finds the tab as if nobody had used it. A page that is left still puts something into storage.
        tab.mouse.up()
        for key in _PRESSED:
            tab.keyboard.up(key)
        tab.route(f"{ORIGIN}/nothing", lambda route: route.fulfill(body="", content_type="text/html"))
        tab.goto(f"{ORIGIN}/nothing")
        tab.evaluate("localStorage.clear(); sessionStorage.clear()")
        tab.unroute_all(behavior="ignoreErrors")
        tab.emulate_media(color_scheme="null", reduced_motion="null")
        tab.remove_listener("pageerror", failed)
        tab.remove_listener("console", said)
    assert problems == [], problems


@pytest.fixture
def page(tab: Page, server: PlayedServer) -> Iterator[Page]:
    with opened(tab, server.attach, "/", 1280, 800) as page:
        expect(page.locator("rp-scene iframe")).to_have_class("loaded")
        yield page


def until(page: Page, condition: Callable[[], bool], seconds: float = 5.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        page.wait_for_timeout(20)


def box_of(part: Locator) -> FloatRect:
    """Where a part of the page is (px), once it is to be seen: what a click brings up is drawn a frame later."""
    expect(part).to_be_visible()
    box = part.bounding_box()
    assert box is not None
    return box
