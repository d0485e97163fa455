"""The preview on the page: asked for, played, approved, expired, and required."""

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages import page as p
from rolling_panda.messages.supervision import PreviewedCut, PreviewState
from rolling_panda.reasons import text_of
from tests.support.page_parts import open_screen
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer, controller, point
from tests.support.points import rolled_out

pytestmark = pytest.mark.browser


@pytest.fixture
def screen() -> str:
    return "review"


ALLOWED = ("RequestPreview", "ApprovePreview", "RequirePreview", "MoveInQueue")


def cut(name: str, begins: float) -> PreviewedCut:
    clearance = 0.072 - 0.01 * begins / 5.0
    return rolled_out(name, 4, begins_s=begins, cut_s=begins + 3.0, ends_s=begins + 5.0, clearance=clearance)


STATE = PreviewState(
    header=m.Header(),
    required=False,
    phase="ready",
    preview_hash="ab" * 32,
    duration_s=10.0,
    cuts=(cut("p1", 0.0), cut("p2", 5.0)),
    remaining=1,
)


@pytest.fixture
def server() -> PlayedServer:
    state = controller()
    state = msgspec.structs.replace(state, allowed=state.allowed | dict.fromkeys(ALLOWED))
    return PlayedServer(controller=state, points=(point(1, "ACCEPTED"), point(2, "ACCEPTED"), point(3, "PROPOSED")))


def told(server: PlayedServer, **changes: object) -> None:
    server.tell(p.PagePreview(preview=msgspec.structs.replace(STATE, **changes)))


def moments(server: PlayedServer) -> list[float | None]:
    return [message.time for message in server.said if isinstance(message, p.ShowPreview)]


@pytest.mark.parametrize(("before", "after"), [("review", "work"), ("engineer", "work"), ("drive", "drive")])
def test_a_preview_lies_over_the_large_view(page: Page, server: PlayedServer, before: str, after: str) -> None:
    told(server)
    open_screen(page, before)
    page.locator("#show-preview").click()
    expect(page.locator("rp-preview")).to_be_visible()
    expect(page.locator("main")).to_have_attribute("data-screen", after)


def test_beside_a_picture_its_controls_are_whole(page: Page, server: PlayedServer) -> None:
    told(server)
    page.locator("#show-preview").click()
    open_screen(page, "review")
    page.set_viewport_size({"width": 1440, "height": 900})
    panel = box_of(page.locator("rp-preview"))
    for button in page.locator("rp-preview button:visible").all():
        assert box_of(button)["x"] + box_of(button)["width"] <= panel["x"] + panel["width"]


def test_a_preview_is_asked_for_of_all_or_of_the_chosen_point(page: Page, server: PlayedServer) -> None:
    page.locator("#show-preview").click()
    until(page, lambda: server.posted == [("/api/preview", {"point_id": ""})])
    page.locator("#preview").click()
    until(page, lambda: server.posted[1:] == [("/api/preview", {"point_id": ""})])
    expect(page.locator("#preview-one")).to_have_attribute("title", text_of(reasons.none_chosen()))
    page.locator('[data-cut="p2"] button').click()
    page.locator("#preview-one").click()
    until(page, lambda: ("/api/preview", {"point_id": "p2"}) in server.posted)


def test_it_says_how_long_and_how_near_and_the_scrubber_shows_moments(page: Page, server: PlayedServer) -> None:
    page.locator("#show-preview").click()
    expect(page.locator("#preview")).to_be_visible()
    expect(page.locator(".preview-player")).to_be_hidden()
    told(server)
    words = page.locator(".preview-words")
    expect(words).to_have_text("2 of 3 cuts in 10.0 s · least 62 mm link 5–camera · ω 0.067 · joints 34°")
    slider = page.get_by_label("Moment of the preview")
    slider.fill("2")
    until(page, lambda: 2.0 in moments(server))
    expect(words).to_contain_text("Vine 1, spur 1: cut · least 72 mm")
    slider.fill("7")
    expect(words).to_contain_text("Vine 1, spur 1: cut · least 62 mm")
    page.locator("#preview-hide").click()
    until(page, lambda: moments(server)[-1] is None)
    # The ghost is out of the way of the work, too.
    slider.fill("2")
    until(page, lambda: moments(server)[-1] == 2.0)
    server.controller = controller("AUTO")
    until(page, lambda: moments(server)[-1] is None)


def test_it_plays_to_its_end(page: Page, server: PlayedServer) -> None:
    told(server, duration_s=0.6)
    page.locator("#show-preview").click()
    page.locator("#preview-play").click()
    until(page, lambda: moments(server)[-1:] == [0.6])
    shown = [moment for moment in moments(server) if moment is not None]
    assert shown == sorted(shown)
    expect(page.locator("#preview-play")).to_have_text("Play")


def test_it_is_approved_by_its_hash_and_what_changed_is_said_when_it_expires(page: Page, server: PlayedServer) -> None:
    told(server)
    page.locator("#show-preview").click()
    page.locator("#approve-preview").click()
    until(page, lambda: ("/api/preview/approve", {"preview_hash": "ab" * 32}) in server.posted)
    told(server, phase="approved", approved_by="Ada")
    expect(page.locator(".preview-words")).to_contain_text("Approved by Ada")
    told(server, phase="expired", reason=reasons.robot_elsewhere(0.31))
    expect(page.locator(".preview-words")).to_have_text("Expired: The robot stands 0.31 m from its start")
    expect(page.locator("#approve-preview")).to_have_attribute("aria-disabled", "true")


def test_where_it_is_required_start_says_what_is_missing(page: Page, server: PlayedServer) -> None:
    page.locator("#show-preview").click()
    box = page.get_by_label("Preview before each cut")
    box.click()
    until(page, lambda: ("/api/preview/required", {"required": True}) in server.posted)
    expect(box).not_to_be_checked()
    assert server.controller is not None
    told(server, required=True)
    expect(box).to_be_checked()
    for missing in (reasons.preview_not_approved(), reasons.preview_needed()):
        refused = server.controller.allowed | {"Start": missing}
        server.controller = msgspec.structs.replace(server.controller, allowed=refused)
        expect(page.locator("#start")).to_have_attribute("title", text_of(missing))


def test_who_may_not_operate_may_not_ask_or_approve(page: Page, server: PlayedServer) -> None:
    server.role = "viewer"
    told(server)
    page.locator("#show-preview").click()
    for name in ("preview", "approve-preview"):
        expect(page.locator(f"#{name}")).to_have_attribute("title", text_of(reasons.viewer_only()))
    expect(page.locator("#require-preview")).to_be_disabled()
