"""The operator's page in a real browser, with a server that the test plays: fixtures of every test of the page."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import (
    Browser,
    ConsoleMessage,
    Error,
    FloatRect,
    Locator,
    Page,
    Playwright,
    expect,
    sync_playwright,
)

from rolling_panda import messages as m
from rolling_panda import reasons
from tests.support.chromium import FLAT_FLAGS
from tests.support.page_host import NOTHING, ORIGIN, page_host
from tests.support.played_server import PlayedServer, point

#: Keys that a test may leave pressed.
_PRESSED = ("h", "w", "s", "ArrowLeft", "Enter")


class _SharedBrowser:
    """One browser and one tab for successive tests: to start them takes longer than most tests of the page.

    Meanwhile this thread can neither start another Playwright nor run an event loop.
    """

    def __init__(self) -> None:
        self._playwright: Playwright | None = None
        self._browser: Browser | None = None
        self._tab: Page | None = None

    def browser(self, chromium_path: str) -> Browser:
        if self._browser is not None and not self._browser.is_connected():
            self.close()
        if self._browser is None:
            self._playwright = sync_playwright().start()
            flags = [*FLAT_FLAGS, *page_host().flags]
            self._browser = self._playwright.chromium.launch(executable_path=chromium_path, args=flags)
        return self._browser

    def tab(self, browser: Browser) -> Page:
        if self._tab is None:
            self._tab = browser.new_context(locale="en-US").new_page()
        return self._tab

    def close_tab(self) -> None:
        if self._tab is not None:
            self._tab.context.close()
        self._tab = None

    def close(self) -> None:
        if self._browser is not None:
            self._browser.close()
        if self._playwright is not None:
            self._playwright.stop()
        self._playwright = self._browser = self._tab = None


_SHARED = _SharedBrowser()
close_browser = _SHARED.close


@pytest.fixture
def browser(chromium_path: str) -> Iterator[Browser]:
    """The browser; a test fails if the server of its pages did."""
    problems = page_host().problems
    problems.clear()
    yield _SHARED.browser(chromium_path)
    assert problems == [], problems


@pytest.fixture
def server() -> PlayedServer:
    return PlayedServer(
        points=(
            point(1, "PROPOSED"),
            point(2, "ACCEPTED", user="Ada", reason="accepted by Ada"),
            point(3, "DONE", spur=2, cut_id="c1"),
        ),
        undecided_sites=(
            m.UndecidedSite(reasons.nodes_lacking(0, 2), "another look", 1, 3),
            m.UndecidedSite(reasons.wire_near_cut(6.0), "operator", 1, 4),
        ),
    )


@pytest.fixture
def tab(browser: Browser) -> Iterator[Page]:
    """The tab of all tests that need no other."""
    tab = _SHARED.tab(browser)
    tab.set_viewport_size({"width": 1280, "height": 800})
    yield tab
    try:
        if tab.url != NOTHING:
            leave(tab)
    except Error:
        _SHARED.close_tab()
        raise


def leave(tab: Page) -> None:
    """The next test finds the tab as if nobody had used it."""
    tab.mouse.up()
    for key in _PRESSED:
        tab.keyboard.up(key)
    # A page that is left still puts something into storage.
    tab.goto(NOTHING)
    tab.evaluate("localStorage.clear(); sessionStorage.clear()")
    tab.emulate_media(color_scheme="null", reduced_motion="null")


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
    expect(tab.locator("main .screen:visible:defined")).to_have_count(1)
    try:
        yield tab
    finally:
        leave(tab)
        tab.remove_listener("pageerror", failed)
        tab.remove_listener("console", said)
    assert problems == [], problems


@pytest.fixture
def screen() -> str:
    """The screen that the page opens with; a module about another one says so."""
    return "work"


@pytest.fixture
def page(tab: Page, server: PlayedServer, screen: str) -> Iterator[Page]:
    with opened(tab, server.attach, f"/#{screen}", 1280, 800) as page:
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
