"""The operator's page in a real browser, with a server that the test plays: fixtures of every test of the page."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from operator_page import FLAT_FLAGS
from played_server import ORIGIN, PlayedServer, point
from playwright.sync_api import Browser, FloatRect, Locator, Page, expect, sync_playwright

from rolling_panda import messages as m


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
        abstained=(
            m.Abstention("no node seen above the cordon", "another look", 1, 3),
            m.Abstention("a wire passes close to the cut", "operator", 1, 4),
        ),
    )


@contextmanager
def opened(browser: Browser, attach: Callable[[Page], None], path: str, width: int, height: int) -> Iterator[Page]:
    """A page of what is attached to it, ready; leaving it fails if one of its scripts failed or broke the policy."""
    context = browser.new_context(viewport={"width": width, "height": height}, locale="en-US")
    page = context.new_page()
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on(
        "console",
        lambda message: problems.append(message.text) if "Content Security Policy" in message.text else None,
    )
    attach(page)
    page.goto(f"{ORIGIN}{path}")
    expect(page.locator("#mode")).to_have_attribute("data-mode", "READY")
    yield page
    context.close()
    assert problems == []


@pytest.fixture
def page(browser: Browser, server: PlayedServer) -> Iterator[Page]:
    with opened(browser, server.attach, "/", 1280, 800) as page:
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
