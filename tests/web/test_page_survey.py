"""What the page asks for when the robot is to look: along the row, or at one place again."""

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import reasons
from rolling_panda.reasons import text_of
from tests.support.page_parts import choose, open_screen
from tests.support.played_page import until
from tests.support.played_server import PlayedServer, controller

pytestmark = pytest.mark.browser


def test_a_survey_goes_as_far_as_was_chosen(page: Page, server: PlayedServer) -> None:
    server.points = ()
    server.tell(server.page_points())
    server.controller = controller("READY", allowed={"Survey": None})
    expect(page.locator(".next #survey")).to_be_enabled()
    page.locator("#survey").click()
    until(page, lambda: bool(server.posted))
    page.locator("#survey-distance").select_option("15")
    page.locator("#survey").click()
    until(page, lambda: len(server.posted) == 2)
    assert server.posted == [("/api/survey", {"distance": 4}), ("/api/survey", {"distance": 15})]


def test_another_look_is_asked_for_only_where_a_place_is_known(page: Page, server: PlayedServer) -> None:
    server.controller = controller("READY", allowed={"LookAgain": None})
    unclear, deciding = server.undecided_sites
    server.undecided_sites = (msgspec.structs.replace(unclear, position=(1.0, 0.8, 0.9)), deciding)
    server.tell(server.page_points())
    choose(page, "place-1-4")
    expect(page.locator("#look-again")).to_be_hidden()
    choose(page, "place-1-3")
    page.locator("#look-again").click()
    until(page, lambda: bool(server.posted))
    assert server.posted == [("/api/look-again", {"vine": 1, "spur": 3})]
    server.controller = controller("AUTO", allowed={"Pause": None})
    expect(page.locator("#look-again")).to_be_disabled()


def test_an_unfamiliar_picture_is_told_to_the_operator(page: Page, server: PlayedServer) -> None:
    open_screen(page, "review")
    (site, *_) = server.undecided_sites
    reason = reasons.picture_unfamiliar(2.4, 1.2)
    told = msgspec.structs.replace(site, reason=reason, needs="operator", vine=0, spur=0, position=None)
    server.undecided_sites = (told,)
    server.tell(server.page_points())
    notes = page.locator(".review-notes")
    expect(notes).to_contain_text(text_of(reason))
    expect(notes).to_contain_text("decide yourself where to cut")
    expect(page.locator('.strip-mark[data-status="decide"]')).to_have_count(0)
