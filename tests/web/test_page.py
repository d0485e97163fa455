"""The operator's page in a real browser, with a server that the test plays."""

import json

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from rolling_panda import reasons
from rolling_panda.messages import page as p
from rolling_panda.reasons import text_of
from server.api.responses import outcome
from tests.support.page_host import STAND_STILL
from tests.support.page_parts import choose, open_screen
from tests.support.played_page import box_of, until
from tests.support.played_server import ORIGIN, PlayedServer, bridge, controller

pytestmark = pytest.mark.browser


@pytest.fixture
def screen() -> str:
    return "review"


def test_only_what_the_controller_allows_is_enabled_and_the_rest_says_why(page: Page, server: PlayedServer) -> None:
    expect(page.locator("#start")).to_be_enabled()
    pause = page.locator("#pause")
    expect(pause).to_be_disabled()
    refused = reasons.impossible_in_ready("pause")
    server.controller = controller("READY", allowed=controller().allowed | {"Pause": refused})
    expect(pause).to_have_attribute("aria-description", text_of(refused))
    server.controller = controller("READY", allowed=controller().allowed | {"Start": refused})
    expect(page.locator("#start")).to_be_disabled()
    server.role = "viewer"
    expect(page.locator("#start")).to_have_attribute("title", text_of(reasons.viewer_only()))
    expect(page.locator("#stop")).to_be_enabled()


def test_a_greyed_button_does_nothing_and_says_why_to_a_finger(page: Page, server: PlayedServer) -> None:
    refused = reasons.preview_needed()
    server.controller = controller("READY", allowed=controller().allowed | {"Start": refused})
    start = page.locator("#start")
    expect(start).to_have_attribute("title", text_of(refused))
    expect(page.locator(".next-why")).to_have_text(text_of(refused))
    # A step that has just come takes no press.
    start.evaluate("each => Promise.all(each.closest('.step').getAnimations().map(({ finished }) => finished))")
    start.click(force=True)
    expect(page.locator(".toast")).to_contain_text(text_of(refused))
    choose(page, "p3")
    page.locator("#review-accept").click(force=True)
    expect(page.locator(".toast").last).to_contain_text("Vine 1, spur 2 is Done")
    server.controller = controller("ESTOP_LATCHED")
    expect(page.locator("#reset")).to_have_attribute("aria-disabled", "true")
    page.locator("#reset-reason").press("Enter")
    expect(page.locator(".toast").last).to_contain_text(text_of(reasons.reset_unexplained()))
    assert server.posted == []


def test_every_notice_ends_by_itself(page: Page, server: PlayedServer) -> None:
    # Twenty times as fast.
    page.evaluate("""() => {
      const later = window.setTimeout.bind(window);
      window.setTimeout = (act, ms) => later(act, ms / 20);
    }""")
    for status in (409, 503, 500):
        server.answers["/api/arm"] = (status, outcome(False, reasons.hold_interrupted()))
        page.evaluate("import('/js/link/api.js').then(({ ask }) => ask('Arm', 'api/arm'))")
        expect(page.locator(".toast")).to_be_visible()
        expect(page.locator(".toast")).to_have_count(0, timeout=2000)


def test_it_says_that_it_is_a_simulation(page: Page, server: PlayedServer) -> None:
    expect(page.locator("rp-camera .tag")).to_contain_text("simulation")
    server.bridge = bridge(kind="real")
    expect(page.locator("rp-camera .tag")).not_to_contain_text("simulation")


def test_the_log_has_the_words_of_the_page(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    changed = reasons.mode_changed("READY", "AUTO", reasons.said("start by Ada"))
    server.tell(p.PageEvents(events=(server.event(2, "info", changed),)))
    expect(page.locator("#log li .text").last).to_have_text("Ready → Automatic: start by Ada")


def test_a_reading_beyond_its_limit_is_told_in_words(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    warning = page.locator('[data-gauge="manipulability"] .gauge-warning')
    expect(warning).to_have_text("")
    server.controller = controller(manipulability=0.01)
    expect(warning).to_have_text("▾ low")


def test_a_supervisor_makes_a_link_for_somebody_else(page: Page, server: PlayedServer) -> None:
    server.answers["/api/invite"] = (200, {"ok": True, "reason": "", "link": f"{ORIGIN}/sign-in?token=abc", "qr": []})
    expect(page.locator("#invite-user")).to_be_hidden()
    page.locator("#person").click()
    page.locator("#invite").click()
    page.locator("#invite-user").fill("a script")
    page.locator("#invite-role").select_option("operator")
    page.locator("#invite-make").click()
    expect(page.locator("#invite-link")).to_have_value(f"{ORIGIN}/sign-in?token=abc")
    assert server.posted == [("/api/invite", {"user": "a script", "role": "operator"})]
    expect(page.locator("#stop")).to_be_visible()
    page.locator("#invite-user").press("Escape")
    page.locator("#invite").click()
    expect(page.locator("#invite-link")).to_have_value("")
    server.answers["/api/invite"] = (503, {"ok": False, "reason": "no more today"})
    page.locator("#invite-make").click()
    expect(page.locator("#invitation")).to_contain_text("No link was made: no more today")
    server.role = "operator"
    expect(page.locator("#invite")).to_be_hidden()


def test_a_refusal_is_a_notice_and_a_line_of_the_log(page: Page, server: PlayedServer) -> None:
    server.answers["/api/start"] = (409, {"ok": False, "reason": "the base has not settled"})
    open_screen(page, "engineer")
    page.locator("#start").click()
    words = "Start refused: the base has not settled"
    expect(page.locator(".toast")).to_contain_text(words)
    # The server logs what the controller refuses; what never reached it is logged by the page.
    server.tell(p.PageEvents(events=(server.event(2, "warning", "Start by Ada refused"),)))
    expect(page.locator("#log li").last).to_contain_text("Start by Ada refused")
    server.answers["/api/home"] = (403, {"ok": False, "reason": "a viewer may look and stop, not operate"})
    page.locator("#more").click()
    page.locator("#home").click()
    expect(page.locator("#log li").last).to_contain_text("Home refused: a viewer may look and stop")
    server.tell(p.PageEvents(events=(server.event(3, "info", "nothing to worry about"),)))
    expect(page.locator("#log li").last).to_be_visible()
    page.locator("#log-filter").select_option("error")
    expect(page.locator("#log li").last).to_be_hidden()


def test_a_pressed_step_shows_it_until_the_robot_has_answered(page: Page, server: PlayedServer) -> None:
    held: list[Route] = []
    page.route("**/api/start", lambda route: held.append(route), times=1)
    start = page.locator("#start")
    start.click()
    expect(start).to_have_attribute("aria-busy", "true")
    until(page, lambda: len(held) == 1)
    held[0].continue_()
    expect(start).not_to_have_attribute("aria-busy", "true")


def test_space_stops_even_on_a_focused_button_and_inside_the_view(page: Page, server: PlayedServer) -> None:
    page.locator("#start").focus()
    page.keyboard.press("Space")
    until(page, lambda: len(server.stops()) == 1)
    assert [stop["reason"] for stop in server.stops()] == ["space bar"]
    page.frame_locator("rp-scene iframe").locator("button").focus()
    page.keyboard.press("Space")
    until(page, lambda: len(server.stops()) == 2)
    page.locator("#stop").click()
    until(page, lambda: len(server.stops()) == 3)
    assert [path for path, _ in server.posted] == ["/api/stop"] * 3


def test_a_stop_says_who_and_who_latched_it_and_is_reset_with_a_reason(page: Page, server: PlayedServer) -> None:
    banner = page.locator("rp-stop-banner")
    expect(banner).to_be_hidden()
    server.bridge = bridge(stop_id="s1", stopped_by=reasons.software_stop("Ada", reasons.said("space bar")))
    expect(banner).to_contain_text(text_of(reasons.software_stop("Ada", reasons.said("space bar"))))
    expect(banner.locator('[data-by="bridge"]')).to_have_attribute("data-acknowledged", "true")
    expect(banner.locator('[data-by="controller"]')).to_have_attribute("data-acknowledged", "false")
    server.controller = controller("ESTOP_LATCHED", reason="stopped by Ada")
    expect(banner.locator('[data-by="controller"]')).to_have_attribute("data-acknowledged", "true")
    expect(page.locator("#reset")).to_be_disabled()
    page.locator("#reset-reason").press_sequentially("row is clear")
    page.locator("#reset").click()
    until(page, lambda: ("/api/reset", {"reason": "row is clear", "stop_id": "s1"}) in server.posted)
    assert server.stops() == [], "a space in the reason is a character"


def test_a_stop_that_does_not_get_through_says_so(page: Page, server: PlayedServer) -> None:
    server.answers["/api/stop"] = (503, {"ok": False, "reason": "no wire"})
    page.locator("#stop").click()
    expect(page.locator(".toast")).to_contain_text("Use the emergency stop on the robot")
    assert len(server.stops()) == 2
    server.answers["/api/stop"] = (500, {"ok": False, "reason": "something broke"})
    page.locator("#stop").click()
    until(page, lambda: len(server.stops()) == 6)
    # One press has one id. By it the server does not stop again for a repetition that comes after the reset.
    presses = [stop["press"] for stop in server.stops()]
    assert (len(set(presses[:2])), len(set(presses[2:])), len(set(presses))) == (1, 1, 2)


def test_the_tool_moves_only_while_held(page: Page, server: PlayedServer) -> None:
    open_screen(page, "drive")
    expect(page.locator("#hold")).to_be_disabled()
    page.locator("#teleop").click()
    until(page, lambda: p.ShowGizmo(visible=True) in server.said)
    page.locator("#hold").hover()
    page.mouse.down()
    until(page, lambda: len(server.holds()) >= 5)
    page.mouse.up()
    until(page, lambda: not server.holds()[-1])
    count = len(server.holds())
    assert server.holds() == [True] * (count - 1) + [False]
    page.wait_for_timeout(200)
    assert len(server.holds()) == count
    sequences = [message.sequence for message in server.said if isinstance(message, p.Hold)]
    assert sequences == sorted(set(sequences))


@pytest.mark.parametrize("end", ["blur", "hidden", "mode", "link"])
def test_a_hold_ends_when_the_operator_can_no_longer_mean_it(page: Page, server: PlayedServer, end: str) -> None:
    open_screen(page, "drive")
    page.locator("#teleop").click()
    page.locator("h1").click()
    page.keyboard.down("h")
    until(page, lambda: server.holds()[-1:] == [True])
    if end == "blur":
        page.evaluate("window.dispatchEvent(new Event('blur'))")
    elif end == "hidden":
        page.evaluate(
            "Object.defineProperty(document, 'hidden', {value: true});"
            "document.dispatchEvent(new Event('visibilitychange'))"
        )
    elif end == "mode":
        server.controller = controller("PAUSED", reason="perception gone")
    else:
        server.sockets[-1].close()
        expect(page.locator("#hold")).not_to_have_class("held")
        expect(page.locator("#teleop")).to_have_attribute("aria-pressed", "false")
        return
    until(page, lambda: not server.holds()[-1])
    expect(page.locator("#hold")).not_to_have_class("held")


def test_a_hold_that_the_server_ended_goes_on_only_when_pressed_again(page: Page, server: PlayedServer) -> None:
    open_screen(page, "drive")
    page.locator("#teleop").click()
    page.locator("h1").click()
    page.keyboard.down("h")
    until(page, lambda: server.holds()[-1:] == [True])
    server.tell(p.HoldEnded(reason=reasons.hold_interrupted()))
    expect(page.locator(".toast")).to_contain_text(reasons.text_of(reasons.hold_interrupted()))
    until(page, lambda: not server.holds()[-1])
    count = len(server.holds())
    page.keyboard.down("h")
    page.wait_for_timeout(300)
    assert len(server.holds()) == count, "the key that is still down moves nothing"
    expect(page.locator("#hold")).not_to_have_class("held")
    page.keyboard.up("h")
    page.keyboard.down("h")
    until(page, lambda: server.holds()[-1])
    page.keyboard.up("h")


def test_dragging_in_the_view_counts_as_holding(page: Page, server: PlayedServer) -> None:
    open_screen(page, "drive")
    box = box_of(page.locator("rp-scene iframe"))
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.up()
    assert server.holds() == [], "nothing is held while Teleoperate is off"
    page.locator("#teleop").click()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    until(page, lambda: server.holds()[-1:] == [True])
    page.mouse.up()
    until(page, lambda: not server.holds()[-1])


@pytest.mark.long
@pytest.mark.parametrize(
    ("renderer", "smooth", "ratio"),
    [
        ("ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero)), SwiftShader driver)", False, "1"),
        ("ANGLE (Intel, Mesa Intel(R) UHD Graphics 620 (KBL GT2), OpenGL 4.6)", True, "1.5"),
    ],
)
def test_the_view_costs_what_the_browser_can_draw(
    browser: Browser, server: PlayedServer, renderer: str, smooth: bool, ratio: str
) -> None:
    context = browser.new_context(locale="en-US", device_scale_factor=2)
    page = context.new_page()
    page.add_init_script(
        "const real = WebGL2RenderingContext.prototype.getParameter;"
        "WebGL2RenderingContext.prototype.getParameter = function (name) {"
        f"  return name === 0x9246 ? {json.dumps(renderer)} : real.call(this, name); }};"
    )
    server.attach(page)
    page.goto(f"{ORIGIN}/")
    expect(page.locator("rp-scene iframe")).to_have_class("loaded")
    view = page.frames[1]
    assert view.evaluate("new URLSearchParams(location.search).get('fixedDpr')") == ratio
    drawn = "document.createElement('canvas').getContext('webgl2', {antialias: true}).getContextAttributes().antialias"
    assert view.evaluate(drawn) is smooth
    pause = view.evaluate(
        "new Promise((done) => { const times = []; const draw = () => { times.push(performance.now());"
        "  if (times.length <= 21) requestAnimationFrame(draw);"
        "  else done(times.slice(1).map((time, i) => time - times[i]).sort((a, b) => a - b)[10]); };"
        "  requestAnimationFrame(draw);"
        "  cancelAnimationFrame(requestAnimationFrame(() => { done(Infinity); })); })"
    )
    assert (pause < 60.0) is smooth, f"{pause:.0f} ms between two pictures"
    assert pause < 300.0
    context.close()


def test_a_gone_process_leaves_its_last_state_grey_and_aged(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    server.gone = {"bridge": 3.2}
    expect(page.locator('.presence[data-process="bridge"]')).to_have_attribute("data-present", "false")
    note = page.locator("rp-telemetry .stale-note")
    expect(note).to_contain_text("bridge gone — last state 3.")
    expect(page.locator('[data-gauge="real-time-factor"] .value')).to_have_text("0.99")
    server.gone = {}
    expect(note).to_have_text("")


def test_a_lost_link_is_said_and_mended_by_itself(page: Page, server: PlayedServer) -> None:
    open_screen(page, "engineer")
    open_screen(page, "review")
    server.online = False
    server.sockets[-1].close()
    banner = page.locator("rp-link-banner")
    expect(banner).to_contain_text("No link to the server")
    expect(page.locator('.strip-mark[data-point-id="p1"]')).to_be_visible()
    expect(page.locator("#start")).to_be_disabled()
    server.online = True
    expect(banner).to_be_hidden(timeout=10000)
    expect(page.locator("#start")).to_be_enabled()
    expect(page.locator("#log li")).to_have_count(1)


def test_echoes_the_state_that_it_has_drawn(page: Page, server: PlayedServer) -> None:
    until(page, lambda: any(isinstance(message, p.Ping) and message.rendered > 3 for message in server.said))


def test_says_what_it_waits_for_before_there_is_anything(tab: Page) -> None:
    server = PlayedServer(controller=None, bridge=None, gone={"controller": 9.0, "bridge": 9.0, "perception": 9.0})
    server.attach(tab)
    tab.goto(f"{ORIGIN}/#review")
    expect(tab.locator("#mode")).to_have_text("No state yet")
    expect(tab.locator("rp-review > .empty")).to_contain_text("No pruning point in 12 images so far")
    expect(tab.locator("#start")).to_be_disabled()
    expect(tab.locator("#stop")).to_be_enabled()
    server.controller, server.gone = controller("IDLE"), {}
    expect(tab.locator("rp-review > .empty")).to_contain_text("press Arm, then Survey")


def test_the_sign_in_link_is_used_once_and_leaves_the_address(tab: Page) -> None:
    server = PlayedServer(answers={"/api/sign-in": (401, {"ok": False, "reason": "this token was used"})})
    server.attach(tab)
    tab.goto(f"{ORIGIN}/sign-in?token=secret")
    expect(tab.locator("#progress")).to_have_text("Not signed in: this token was used")
    assert tab.url == f"{ORIGIN}/sign-in"
    assert server.posted == [("/api/sign-in", {"token": "secret"})]
    del server.answers["/api/sign-in"]
    tab.locator("#token").fill("another")
    tab.get_by_role("button", name="Sign in").click()
    expect(tab.locator("#mode")).to_have_attribute("data-mode", "READY")


@pytest.mark.long
def test_a_busy_page_does_not_take_its_own_pause_for_a_lost_link(page: Page, server: PlayedServer) -> None:
    page.evaluate(STAND_STILL, 3.5)
    page.wait_for_timeout(500)
    assert len(server.sockets) == 1


@pytest.mark.long
def test_a_silent_link_is_given_up_and_tried_again(page: Page, server: PlayedServer) -> None:
    server.silent = True
    until(page, lambda: len(server.sockets) > 1, seconds=10.0)
