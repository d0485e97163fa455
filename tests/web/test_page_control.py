"""On the page: who holds control, and how it changes hands."""

import time

import pytest
from playwright.sync_api import Page, expect

from rolling_panda import reasons
from rolling_panda.messages.page import Ping
from rolling_panda.reasons import text_of
from tests.support.page_host import STAND_STILL
from tests.support.page_parts import held, open_screen
from tests.support.played_page import until
from tests.support.played_server import PlayedServer

pytestmark = pytest.mark.browser


def test_alone_there_is_nothing_to_see_of_it(page: Page, server: PlayedServer) -> None:
    server.control = held("me", "Ada")
    expect(page.locator("#mode")).to_be_visible()
    until(page, lambda: server.number > 5)
    expect(page.locator("rp-lease")).to_be_hidden()
    expect(page.locator("rp-robots")).to_be_hidden()
    expect(page.locator("#stop small")).to_have_text(["software stop", "space bar"])


def test_where_there_is_no_view_it_is_said_only_if_there_is_something_to_press(
    page: Page, server: PlayedServer
) -> None:
    server.control = held("me", "Ada")
    server.viewers = 2
    expect(page.locator("rp-lease")).to_contain_text("You hold control")
    for name in ("report", "engineer"):
        open_screen(page, name)
        expect(page.locator("rp-lease")).to_be_hidden()
    server.control = held("me", "Ada", requested_by="Bob", requested_key="other")
    expect(page.locator("#grant-control")).to_be_visible()


@pytest.mark.long
def test_that_one_holds_control_is_said_for_a_moment_and_then_by_the_menu(page: Page, server: PlayedServer) -> None:
    server.control = held("other", "Bob")
    server.viewers = 2
    expect(page.locator("rp-lease")).to_contain_text("Bob holds control")
    server.control = held("me", "Ada")
    expect(page.locator("rp-lease")).to_contain_text("You hold control")
    expect(page.locator("rp-lease")).to_be_visible()
    expect(page.locator("rp-lease")).to_be_hidden(timeout=10_000)
    page.locator("#person").click()
    expect(page.locator("#person-menu")).to_contain_text("You hold control")
    page.keyboard.press("Escape")
    server.control = held("other", "Bob")
    expect(page.locator("#take-control")).to_be_visible()


def test_control_is_taken_from_somebody_only_by_a_second_press(page: Page, server: PlayedServer) -> None:
    open_screen(page, "drive")
    server.control = held("other", "Bob")
    control = page.locator("rp-lease")
    expect(control).to_contain_text("Bob holds control")
    page.locator("#take-control").click()
    expect(page.locator("#take-control")).to_have_text("Really take it?")
    assert not any(path == "/api/control/take" for path, _ in server.posted)
    for name in ("#home", "#teleop"):
        expect(page.locator(name)).to_have_attribute("aria-disabled", "true")
        expect(page.locator(name)).to_have_attribute("title", text_of(reasons.control_held("Bob")))
    page.locator("#take-control").click()
    until(page, lambda: ("/api/control/take", {"confirm": True}) in server.posted)


def test_a_request_is_shown_and_granted_and_who_gave_is_told(page: Page, server: PlayedServer) -> None:
    server.control = held("me", "Ada", requested_by="Bob", requested_key="other")
    expect(page.locator("rp-lease")).to_contain_text("Bob asks for control")
    page.locator("#grant-control").click()
    until(page, lambda: any(path == "/api/control/grant" for path, _ in server.posted))
    server.control = held("other", "Bob", notice=reasons.control_given_over("Bob", "Ada"), notice_number=3)
    expect(page.locator("rp-toasts")).to_contain_text("You no longer hold control")
    expect(page.locator("#request-control")).to_be_visible()


@pytest.mark.long
def test_who_holds_control_is_there_while_the_page_is_busy_but_not_when_it_hangs(
    page: Page, server: PlayedServer
) -> None:
    def pings() -> int:
        return sum(isinstance(message, Ping) for message in server.said)

    server.control = held("other", "Bob")
    expect(page.locator("rp-lease")).to_contain_text("Bob holds control")
    assert server.heres == 0
    server.control = held("me", "Ada")
    until(page, lambda: server.heres > 0)
    # The thread that draws stands still, for good as far as this test goes.
    page.evaluate(f"setTimeout({STAND_STILL}, 0, 4.5)")
    began = time.monotonic()
    before, spoken = server.heres, pings()
    told: list[float] = []
    while time.monotonic() < began + 4.0:
        page.wait_for_timeout(20)
        if server.heres > before:
            before = server.heres
            told.append(time.monotonic() - began)
    assert 1.2 < told[-1] < 2.8, told
    assert pings() <= spoken + 2
