"""What somebody sees in the first seconds: no alarm before there can be one, and one where nothing comes for good."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.page_host import STAND_STILL, PlayedSocket
from tests.support.played_page import until
from tests.support.played_server import ORIGIN, PlayedServer

pytestmark = pytest.mark.browser

#: Everything that looks like an alarm, as long as it is on the screen, is noted.
WATCH = """
  window.alarming = [];
  const chips = ".health[data-present=false], .link[data-quality=bad]";
  const look = () => {
    for (const part of document.querySelectorAll(`#alarms li strong, rp-link-banner, .stale-note, ${chips}`))
      if (part.textContent && part.checkVisibility()) window.alarming.push(part.textContent);
  };
  new MutationObserver(look).observe(document, {subtree: true, childList: true, attributes: true, characterData: true});
"""


class LateServer(PlayedServer):
    """It takes its sockets, and says nothing until it is told to."""

    waits = True

    def greet(self, socket: PlayedSocket) -> None:
        if not self.waits:
            super().greet(socket)

    def hear(self, socket: PlayedSocket, text: str) -> None:
        if not self.waits:
            super().hear(socket, text)

    def begin(self) -> None:
        self.waits = False
        self.greet(self.sockets[-1])


class BusyServer(PlayedServer):
    """It refuses its first socket."""

    refused = 0

    def accept(self, socket: PlayedSocket) -> bool:
        if self.refused:
            return super().accept(socket)
        self.refused += 1
        return False


@pytest.fixture
def fresh(browser: Browser) -> Iterator[Page]:
    context = browser.new_context(locale="en-US", viewport={"width": 1280, "height": 800})
    page = context.new_page()
    page.add_init_script(WATCH)
    yield page
    context.close()


@pytest.mark.long
def test_a_server_that_takes_two_seconds_for_its_first_word_is_no_alarm(fresh: Page) -> None:
    server = LateServer()
    server.attach(fresh)
    fresh.goto(f"{ORIGIN}/")
    expect(fresh.locator("#link")).to_have_text("connecting…")
    # What there is to cut is not known yet.
    expect(fresh.locator("rp-vines")).to_have_text("Loading…")
    fresh.wait_for_timeout(2000)
    server.begin()
    expect(fresh.locator("rp-vines")).not_to_contain_text("Loading…")
    expect(fresh.locator("#mode")).to_have_attribute("data-mode", "READY")
    expect(fresh.locator("#link")).to_contain_text("ms")
    assert fresh.evaluate("alarming") == []


def test_a_first_try_that_fails_is_no_alarm(fresh: Page) -> None:
    server = BusyServer()
    server.attach(fresh)
    fresh.goto(f"{ORIGIN}/")
    expect(fresh.locator("#mode")).to_have_attribute("data-mode", "READY")
    assert server.refused == 1 and fresh.evaluate("alarming") == []


@pytest.mark.long
def test_while_the_browser_itself_is_busy_the_server_is_not_said_to_be_silent(fresh: Page) -> None:
    server = PlayedServer()
    server.attach(fresh)
    fresh.goto(f"{ORIGIN}/")
    expect(fresh.locator("#mode")).to_have_attribute("data-mode", "READY")
    for _ in range(4):
        # As while a browser takes the 3-D view apart.
        fresh.evaluate(STAND_STILL, 1.4)
        fresh.wait_for_timeout(300)
    assert not [text for text in fresh.evaluate("alarming") if "server" in text]


@pytest.mark.long
def test_a_server_that_never_says_anything_is_an_alarm(fresh: Page) -> None:
    LateServer().attach(fresh)
    fresh.goto(f"{ORIGIN}/")
    expect(fresh.locator("rp-link-banner")).to_contain_text("No link to the server", timeout=15_000)
    expect(fresh.locator("#link")).to_have_attribute("data-quality", "bad")


def test_a_link_that_was_had_and_lost_is_an_alarm_at_once(fresh: Page) -> None:
    server = PlayedServer()
    server.attach(fresh)
    fresh.goto(f"{ORIGIN}/")
    expect(fresh.locator("#mode")).to_have_attribute("data-mode", "READY")
    server.online = False
    server.sockets[-1].close()
    until(fresh, lambda: bool(fresh.evaluate("alarming.some(words => words.includes('No link to the server'))")))
    expect(fresh.locator("rp-link-banner")).to_be_visible()
