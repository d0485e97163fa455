"""For hands: settings, gloves mode, sound and vibration, a screen that stays on, invitations as codes, hints, help."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import segno
from PIL import Image
from playwright.sync_api import Browser, BrowserContext, Page, expect

from rolling_panda import messages as m
from rolling_panda.resources import resource
from tests.support.axe import axe, grave
from tests.support.page_parts import open_screen, queue, show_mode, working
from tests.support.page_states import STATES
from tests.support.played_page import box_of, until
from tests.support.played_server import ORIGIN, PlayedServer, controller

__all__ = ["axe"]
pytestmark = pytest.mark.browser

#: What browsers offer, and Chromium without a screen or motor only pretends to.
STUBS = """() => {
  window.tones = []; window.patterns = []; window.locks = []; window.held = 0;
  window.AudioContext = class {
    currentTime = 0; state = "running"; destination = {};
    async resume() {}
    async suspend() {}
    createGain() {
      const gain = { setValueAtTime() {}, linearRampToValueAtTime() {} };
      return { gain, connect: (next) => next };
    }
    createOscillator() {
      const source = { frequency: { value: 0 }, connect: (next) => next, stop() {} };
      source.start = () => window.tones.push(source.frequency.value);
      return source;
    }
  };
  navigator.vibrate = (pattern) => window.patterns.push(pattern);
  Object.defineProperty(navigator, "wakeLock", { value: { request: async (kind) => {
    window.locks.push(kind);
    window.held += 1;
    return { release: async () => { window.held -= 1; } };
  } } });
}"""


@contextmanager
def opened(browser: Browser, server: PlayedServer, **options: Any) -> Iterator[Page]:
    """A page with those stubs, in a browser of its own."""
    context = browser.new_context(viewport={"width": 1280, "height": 800}, **({"locale": "en-US"} | options))
    context.add_init_script(f"({STUBS})()")
    page = context.new_page()
    server.attach(page)
    page.goto(f"{ORIGIN}/")
    expect(page.locator("#mode")).to_have_attribute("data-mode", "READY")
    yield page
    context.close()


@pytest.fixture
def own(browser: Browser, server: PlayedServer) -> Iterator[Page]:
    with opened(browser, server) as page:
        yield page


def open_settings(page: Page) -> None:
    page.locator("#person").click()
    page.locator("#open-settings").click()
    expect(page.locator("#settings")).to_be_visible()


def switch(page: Page, name: str) -> None:
    open_settings(page)
    page.locator(f"#setting-{name}").click()
    page.locator("#settings").press("Escape")
    expect(page.locator("#settings")).to_be_hidden()


def heard(page: Page) -> tuple[int, int]:
    """Numbers of tones and of vibrations."""
    tones, patterns = page.evaluate("[window.tones.length, window.patterns.length]")
    return tones, patterns


# --- settings --------------------------------------------------------------------------------------------------------


def test_colours_are_chosen_and_remembered(page: Page) -> None:
    page.emulate_media(color_scheme="light")
    background = "getComputedStyle(document.body).backgroundColor"
    light = page.evaluate(background)
    open_settings(page)
    page.locator("#setting-scheme").select_option("dark")
    dark = page.evaluate(background)
    assert dark != light
    page.reload()
    expect(page.locator("#mode")).to_have_attribute("data-mode", "READY")
    assert page.evaluate(background) == dark
    open_settings(page)
    page.locator("#setting-scheme").select_option("")
    assert page.evaluate(background) == light


def test_the_stop_can_be_pressed_while_settings_and_help_are_open(page: Page, server: PlayedServer) -> None:
    open_settings(page)
    page.locator("#stop").click()
    until(page, lambda: len(server.stops()) == 1)
    page.keyboard.press("?")
    expect(page.locator("#help")).to_be_visible()
    expect(page.locator("#settings")).to_be_hidden()
    page.locator("#stop").click()
    until(page, lambda: len(server.stops()) == 2)


def test_settings_and_help_are_used_with_the_keyboard_alone(page: Page) -> None:
    page.locator("#person").press("Enter")
    page.locator("#open-settings").press("Enter")
    switch = page.locator("#setting-gloves")
    expect(switch).to_have_attribute("aria-checked", "false")
    switch.press("Enter")
    expect(switch).to_have_attribute("aria-checked", "true")
    # A finger presses the words as well.
    page.get_by_text("Gloves and sunlight", exact=True).click()
    expect(switch).to_have_attribute("aria-checked", "false")
    switch.press("Escape")
    expect(page.locator("#settings")).to_be_hidden()
    page.keyboard.press("?")
    expect(page.locator("#help")).to_contain_text("Stop base and arm")
    page.keyboard.press("Escape")
    expect(page.locator("#help")).to_be_hidden()


def test_a_question_mark_in_a_text_field_is_text(page: Page) -> None:
    page.locator("#person").click()
    page.locator("#invite").click()
    page.locator("#invite-user").press("?")
    page.wait_for_timeout(200)
    assert page.locator("#help").count() == 0


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_settings_help_and_invitation_can_be_read_by_everybody(
    page: Page, server: PlayedServer, axe: str, scheme: Any
) -> None:
    page.emulate_media(color_scheme=scheme)
    open_settings(page)
    assert grave(page, axe) == []
    page.keyboard.press("?")
    expect(page.locator("#help")).to_be_visible()
    assert grave(page, axe) == []
    page.keyboard.press("Escape")
    STATES["invite"](page, server)
    assert grave(page, axe) == []


# --- gloves and sunlight ---------------------------------------------------------------------------------------------

#: Controls below 56 px, and texts below 18 px.
SMALL = """() => [...document.querySelectorAll("body *")].flatMap(each => {
  if (!each.checkVisibility({ visibilityProperty: true }) || each.closest("svg, .order-said")) return [];
  const name = `${each.localName}#${each.id}.${each.className} "${each.textContent.slice(0, 20)}"`;
  const { width, height } = each.getBoundingClientRect();
  const around = each.closest("label")?.getBoundingClientRect();
  const control = each.matches("button, select, a, summary, input");
  const [wide, tall] = [Math.max(width, around?.width ?? 0), Math.max(height, around?.height ?? 0)];
  const found = control && width > 0 && (wide < 55.5 || tall < 55.5) ? [`${name} is ${wide}×${tall}`] : [];
  const own = [...each.childNodes].some(node => node.nodeType === Node.TEXT_NODE && node.data.trim());
  const size = parseFloat(getComputedStyle(each).fontSize);
  return own && size < 18 ? [...found, `${name} in ${size} px`] : found;
})"""


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_with_gloves_everything_is_large_and_contrasts(
    page: Page, axe: str, subtests: pytest.Subtests, scheme: Any
) -> None:
    page.emulate_media(color_scheme=scheme)
    switch(page, "gloves")
    for name in ("points", "paused", "stopped", "teleoperate-joints", "report", "charts", "rule", "preview", "invite"):
        with subtests.test(name):
            played = PlayedServer(points=queue())
            played.attach(page)
            page.goto(f"{ORIGIN}/")
            expect(page.locator("#mode")).to_have_attribute("data-mode", "READY")
            STATES[name](page, played)
            assert page.evaluate(SMALL) == []
            assert grave(page, axe, "color-contrast", "color-contrast-enhanced") == []
            stop = box_of(page.locator("#stop"))
            assert 0 <= stop["y"] and stop["y"] + stop["height"] <= 800 and stop["x"] + stop["width"] <= 1280
            assert page.evaluate("document.documentElement.scrollWidth") <= 1280


# --- sound, vibration and a screen that stays on ---------------------------------------------------------------------


def test_a_pause_a_stop_and_the_end_of_the_work_are_heard_and_felt(own: Page, server: PlayedServer) -> None:
    working(own, server)
    own.keyboard.press("Shift")
    cues = []
    modes: tuple[m.Mode, ...] = ("AUTO", "PAUSED", "READY", "AUTO", "READY", "FAULT", "PAUSED")
    for mode in modes:
        before = heard(own)
        show_mode(own, server, controller(mode, reason="now"))
        own.wait_for_timeout(100)
        tones, patterns = heard(own)
        cues.append((mode, tones - before[0], patterns - before[1]))
    assert cues == [
        ("AUTO", 0, 0), ("PAUSED", 2, 1), ("READY", 0, 0), ("AUTO", 0, 0), ("READY", 3, 1), ("FAULT", 4, 1),
        ("PAUSED", 0, 0),
    ]  # fmt: skip
    assert len({str(pattern) for pattern in own.evaluate("window.patterns")}) == 3, "each is felt differently"


def test_a_lost_link_during_the_work_is_heard(own: Page, server: PlayedServer) -> None:
    working(own, server)
    own.keyboard.press("Shift")
    show_mode(own, server, controller("AUTO", reason="now"))
    assert heard(own) == (0, 0)
    server.online = False
    server.sockets[-1].close()
    until(own, lambda: heard(own) == (4, 1))


def test_before_a_press_nothing_is_heard(own: Page, server: PlayedServer) -> None:
    working(own, server)
    show_mode(own, server, controller("AUTO", reason="now"))
    show_mode(own, server, controller("PAUSED", reason="now"))
    own.wait_for_timeout(200)
    assert heard(own) == (0, 0)


@pytest.mark.parametrize(("name", "left"), [("sound", (0, 1)), ("vibration", (2, 0))])
def test_sound_and_vibration_can_be_switched_off(
    own: Page, server: PlayedServer, name: str, left: tuple[int, int]
) -> None:
    switch(own, name)
    show_mode(own, server, controller("AUTO", reason="now"))
    show_mode(own, server, controller("PAUSED", reason="now"))
    until(own, lambda: heard(own) == left)


def test_the_screen_stays_on_while_the_robot_works_and_is_looked_at(own: Page, server: PlayedServer) -> None:
    held = "window.held"
    working(own, server)
    assert own.evaluate(held) == 0
    show_mode(own, server, controller("AUTO", reason="now"))
    until(own, lambda: own.evaluate(held) == 1)
    hide = """hidden => {
      Object.defineProperty(document, "visibilityState", { value: hidden ? "hidden" : "visible", configurable: true });
      document.dispatchEvent(new Event("visibilitychange"));
    }"""
    own.evaluate(hide, True)
    until(own, lambda: own.evaluate(held) == 0)
    own.evaluate(hide, False)
    until(own, lambda: own.evaluate(held) == 1)
    show_mode(own, server, controller("PAUSED", reason="now"))
    until(own, lambda: own.evaluate(held) == 0)
    assert own.evaluate("window.locks") == ["screen", "screen"]


def test_a_browser_that_keeps_no_screen_on_does_no_harm(own: Page, server: PlayedServer) -> None:
    problems: list[str] = []
    own.on("pageerror", lambda error: problems.append(str(error)))
    own.evaluate(
        "() => { navigator.wakeLock.request = async () => { throw new DOMException('', 'NotAllowedError'); }; }"
    )
    show_mode(own, server, controller("AUTO", reason="now"))
    show_mode(own, server, controller("READY", reason="now"))
    own.wait_for_timeout(200)
    assert problems == []


# --- invitation, installation ----------------------------------------------------------------------------------------


def test_an_invitation_is_shown_as_a_code_that_leads_to_its_link(page: Page, server: PlayedServer) -> None:
    link = f"{ORIGIN}/sign-in?token=1s0n1y-4n-3x4mp13"
    rows = ["".join(str(module) for module in row) for row in segno.make_qr(link).matrix]
    server.answers["/api/invite"] = (200, {"ok": True, "reason": "", "link": link, "qr": rows})
    page.locator("#person").click()
    page.locator("#invite").click()
    page.locator("#invite-user").fill("Bob")
    page.locator("#invite-role").select_option("operator")
    page.locator("#invite-make").click()
    code = page.locator(".qr")
    expect(code).to_have_attribute("aria-label", "QR code of the link for Bob")
    expect(page.locator("#invitation")).to_contain_text("operator: moves the robot")
    drawn = code.locator("path").get_attribute("d") or ""
    quiet = 4
    dark = {(x + quiet, y + quiet) for y, row in enumerate(rows) for x, module in enumerate(row) if module == "1"}
    assert {tuple(map(int, each.split("h")[0].split())) for each in drawn.split("M")[1:]} == dark
    assert code.get_attribute("viewBox") == f"0 0 {len(rows) + 2 * quiet} {len(rows) + 2 * quiet}"
    page.locator("#invite-user").press("Escape")
    expect(code).to_have_count(0)


def test_the_page_can_be_installed(page: Page) -> None:
    manifest = resource("web/app.webmanifest")
    assert page.locator('link[rel="manifest"]').get_attribute("href") == manifest.name
    told = json.loads(manifest.read_text(encoding="utf-8"))
    assert told["display"] == "standalone" and told["start_url"] == "./"
    sizes = set()
    for icon in told["icons"]:
        file = manifest.parent / icon["src"]
        if file.suffix == ".png":
            with Image.open(file) as image:
                assert icon["sizes"] == f"{image.width}x{image.height}"
            sizes.add(icon["sizes"])
    assert {"192x192", "512x512"} <= sizes
    devtools = page.context.new_cdp_session(page)
    errors = devtools.send("Page.getAppManifest")["errors"]
    assert errors == [], "the browser reads it without complaint"


def test_a_device_without_a_network_is_told_so(page: Page, server: PlayedServer) -> None:
    page.evaluate("Object.defineProperty(navigator, 'onLine', { value: false })")
    server.online = False
    server.sockets[-1].close()
    expect(page.locator("rp-link-banner")).to_contain_text("This device is offline.")


# --- the first steps -------------------------------------------------------------------------------------------------


#: Names of the controls whose middle lies under a part of the page.
COVERED = """card => [...document.querySelectorAll("button, a, input, select")]
  .filter(each => !card.contains(each) && each.checkVisibility({ visibilityProperty: true }))
  .filter(each => {
    const { left, top, width, height } = each.getBoundingClientRect();
    return card.contains(document.elementFromPoint(left + width / 2, top + height / 2));
  }).map(each => each.id || each.className || each.textContent)"""


@pytest.mark.long
@pytest.mark.parametrize("size", [(1440, 900), (1280, 800), (1024, 768), (390, 844), (844, 390)])
def test_the_first_sign_in_is_followed_by_hints_that_cover_no_control(
    browser: Browser, server: PlayedServer, size: tuple[int, int]
) -> None:
    context: BrowserContext = browser.new_context(locale="en-US", viewport={"width": size[0], "height": size[1]})
    page = context.new_page()
    server.attach(page)
    page.goto(f"{ORIGIN}/sign-in?token=abc")
    page.wait_for_url(f"{ORIGIN}/")
    card = page.locator(".hint-card")
    seen = []
    for number in range(1, 5):
        expect(card.locator(".number")).to_have_text(f"{number} of 4")
        seen.append(card.locator("p").inner_text())
        box = box_of(card)
        assert 0 <= box["x"] and box["x"] + box["width"] <= size[0]
        assert 0 <= box["y"] and box["y"] + box["height"] <= size[1]
        expect(page.locator(".hinted")).to_have_count(1)
        assert card.evaluate(COVERED) == []
        card.locator(".primary").click()
    assert len(set(seen)) == 4
    expect(card).to_be_hidden()
    page.reload()
    expect(page.locator("#mode")).to_have_attribute("data-mode", "READY")
    page.wait_for_timeout(300)
    assert page.locator(".hint-card:visible").count() == 0, "once a browser"
    page.keyboard.press("?")
    page.get_by_role("button", name="Show the first steps").click()
    expect(card).to_be_visible()
    card.locator("button").first.press("Escape")
    expect(card).to_be_hidden()
    context.close()


def test_hints_wait_while_the_robot_moves(page: Page, server: PlayedServer) -> None:
    page.evaluate("localStorage.setItem('setting.hints', 'due')")
    page.reload()
    expect(page.locator(".hint-card")).to_be_visible()
    show_mode(page, server, controller("AUTO", reason="now"))
    expect(page.locator(".hint-card")).to_be_hidden()
    show_mode(page, server, controller("READY", reason="now"))
    expect(page.locator(".hint-card")).to_be_visible()
    open_screen(page, "review")
    expect(page.locator(".hint-card")).to_be_hidden()
    assert page.locator(".hinted").count() == 0, "nothing is pointed at without words"


def test_nobody_is_shown_hints_who_has_not_just_signed_in(page: Page) -> None:
    page.wait_for_timeout(300)
    assert page.locator(".hint-card").count() == 0


def test_help_leads_to_the_guide_in_the_language_of_the_page(page: Page) -> None:
    page.keyboard.press("?")
    guide = page.get_by_role("link", name="Operator's guide")
    with page.expect_popup() as opened:
        guide.click()
    expect(opened.value.locator("h1")).to_have_text("Operator's short guide")
    opened.value.close()
