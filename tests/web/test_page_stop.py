"""On the page after a stop: who pressed, who has latched it since when, and what has to come before the reset."""

import msgspec
import pytest
from playwright.sync_api import Page, Route, expect

from rolling_panda import reasons
from rolling_panda.messages import page as p
from rolling_panda.messages.supervision import StopRecord, StopState
from rolling_panda.reasons import said, text_of
from tests.support.page_parts import open_screen, ready, show_mode, working
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer, bridge, controller

pytestmark = pytest.mark.browser

ADA = StopRecord("s1", "server", "Ada", said("branch"), 1_700_000_000.0)
BOB = StopRecord("s2", "server", "Bob", said("space bar"), 1_700_000_100.0)


def clock(page: Page, record: StopRecord) -> str:
    """The record's time as this browser's page writes it."""
    words: str = page.evaluate("(at) => new Date(at * 1000).toLocaleTimeString('en-GB')", record.wall_time)
    return words


def test_who_has_latched_it_is_told_with_the_time(page: Page, server: PlayedServer) -> None:
    banner = page.locator("rp-stop-banner")
    server.bridge = bridge(stop_id="s1", stopped_by=reasons.software_stop("Ada", said("branch")))
    server.stopped = (StopState(process="bridge", stops=(ADA,)),)
    expect(banner.locator('[data-by="bridge"]')).to_contain_text(f"latched at {clock(page, ADA)}")
    expect(banner.locator('[data-by="controller"]')).to_contain_text("not confirmed yet")
    late = msgspec.structs.replace(ADA, wall_time=ADA.wall_time + 2.0)
    server.stopped += (StopState(process="controller", stops=(late,)),)
    server.controller = controller("ESTOP_LATCHED", reason="stopped by Ada")
    expect(banner.locator('[data-by="controller"]')).to_contain_text(f"latched at {clock(page, late)}")
    expect(banner.locator(".earlier")).to_be_hidden()


def test_a_second_stop_does_not_hide_the_first(page: Page, server: PlayedServer) -> None:
    banner = page.locator("rp-stop-banner")
    server.bridge = bridge(stop_id="s2", stopped_by=reasons.software_stop("Bob", said("space bar")))
    server.controller = controller("ESTOP_LATCHED")
    server.stopped = tuple(StopState(process=process, stops=(BOB, ADA)) for process in ("bridge", "controller"))
    expect(banner.locator(".who")).to_contain_text(text_of(reasons.software_stop("Bob", said("space bar"))))
    expect(banner.locator(".earlier")).to_have_text(f"Before that: Ada, {clock(page, ADA)}")
    assert banner.inner_text().count("Software stop") == 1


def test_a_pressed_button_on_the_robot_comes_before_the_reset(page: Page, server: PlayedServer) -> None:
    server.bridge = bridge(stop_id="s1", stopped_by=reasons.software_stop("Ada", said("branch")))
    server.controller = controller("ESTOP_LATCHED")
    server.stopped = (StopState(process="bridge", stops=(ADA,), hardware=True),)
    page.locator("#reset-reason").fill("row is clear")
    expect(page.locator("#reset")).to_be_disabled()
    expect(page.locator("#reset")).to_have_attribute("title", text_of(reasons.emergency_stop_pressed()))
    server.stopped = (StopState(process="bridge", stops=(ADA,)),)
    expect(page.locator("#reset")).to_be_enabled()
    page.locator("#reset").click()
    until(page, lambda: ("/api/reset", {"reason": "row is clear", "stop_id": "s1"}) in server.posted)


def test_a_viewer_has_no_button_that_leads_to_a_reset_and_an_operator_is_told_whose_it_is(
    page: Page, server: PlayedServer
) -> None:
    server.bridge = bridge(stop_id="s1", stopped_by=reasons.software_stop("Ada", said("branch")))
    server.controller = controller("ESTOP_LATCHED")
    release, reset = page.locator("#to-reset"), page.locator("#reset")
    server.role = "operator"
    for button in (release, reset):
        expect(button).to_have_attribute("title", text_of(reasons.supervisor_needed()))
    server.role = "viewer"
    for button in (release, reset):
        expect(button).to_be_hidden()
    expect(page.locator("rp-stop-banner")).to_contain_text("supervisor")
    server.role = "supervisor"
    expect(release).to_have_attribute("aria-disabled", "false")


def test_a_fault_is_acknowledged_by_a_supervisor(page: Page, server: PlayedServer) -> None:
    state = controller("FAULT")
    server.controller = msgspec.structs.replace(state, allowed=state.allowed | {"Acknowledge": None})
    server.role = "operator"
    expect(page.locator("#acknowledge")).to_have_attribute("title", text_of(reasons.supervisor_needed()))
    server.role = "supervisor"
    expect(page.locator("#acknowledge")).to_have_attribute("aria-disabled", "false")


@pytest.mark.parametrize("size", [(1280, 800), (1024, 768)])
def test_no_notice_lies_over_the_field_for_the_reason(page: Page, server: PlayedServer, size: tuple[int, int]) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    open_screen(page, "drive")
    page.locator("#teleop").click()
    page.keyboard.down("h")
    until(page, lambda: server.holds()[-1:] == [True])
    server.tell(p.HoldEnded(reason=reasons.hold_stopped()))
    server.bridge = bridge(stop_id="s1", stopped_by=reasons.software_stop("Ada", said("stop button")))
    server.controller = controller("ESTOP_LATCHED", reason="stopped by Ada")
    field = box_of(page.locator("rp-stop-banner input"))
    notice = box_of(page.locator(".toast").first)
    assert notice["y"] + notice["height"] <= field["y"]


def test_an_answer_that_comes_after_the_reset_forbids_nothing(page: Page, server: PlayedServer) -> None:
    working(page, server)
    start, held = page.locator("#start"), list[Route]()
    # The page would give each request up after a second, which a busy machine may need for the reset.
    page.evaluate("AbortSignal.timeout = () => new AbortController().signal")
    page.route("**/api/stop", lambda route: held.append(route))
    page.locator("#stop").click()
    expect(start).to_be_disabled()
    server.bridge = bridge(stop_id="s1", stopped_by=reasons.software_stop("Ada", said("stop button")))
    show_mode(page, server, controller("ESTOP_LATCHED", reason="stopped by Ada"))
    server.bridge = bridge()
    show_mode(page, server, ready())
    with page.expect_response("**/api/stop"):
        (request,) = held
        request.fulfill(json={"ok": True})
    page.wait_for_timeout(300)
    expect(start).to_be_enabled()


def test_nothing_starts_between_the_press_and_its_confirmation(page: Page, server: PlayedServer) -> None:
    working(page, server)
    start = page.locator("#start")
    expect(start).to_be_enabled()
    page.locator("#stop").click()
    expect(start).to_be_disabled()
    expect(start).to_have_attribute("title", text_of(reasons.stop_asked()))
    server.bridge = bridge(stop_id="s1", stopped_by=reasons.software_stop("Ada", said("stop button")))
    show_mode(page, server, controller("ESTOP_LATCHED", reason="stopped by Ada"))
    server.bridge = bridge()
    show_mode(page, server, ready())
    expect(start).to_be_enabled()
