"""No window is too small for a screen of the page: the stop, the view, the next step and every control are there."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.support.page_parts import choose, held, open_screen, show_mode, working
from tests.support.page_states import STATES
from tests.support.played_page import box_of
from tests.support.played_server import PlayedServer, controller, point

pytestmark = pytest.mark.browser

#: A laptop, a small one, a tablet, a small window, a telephone across and upright, and 1440×900 at 200 %; then tablets
#: upright and in a browser with bars, where one layout ends and the next begins.
SIZES = (
    *((1440, 900), (1280, 720), (1024, 768), (960, 600), (844, 390), (390, 844), (720, 450)),
    *((1024, 690), (768, 1024), (620, 900)),
)
SCREENS = ["work", "review", "drive", "report", "engineer"]
#: How much of a part is to be seen once it has been scrolled to: neither the screen nor what it lies in cuts it off.
SEEN = """each => {
  each.scrollIntoView({ block: "center" });
  const box = each.getBoundingClientRect();
  const edges = [new DOMRect(0, 0, innerWidth, innerHeight), box];
  for (let around = each.parentElement; around; around = around.parentElement)
    if (getComputedStyle(around).overflow !== "visible") edges.push(around.getBoundingClientRect());
  const [least, most] = [(of) => Math.min(...edges.map(of)), (of) => Math.max(...edges.map(of))];
  return [least(edge => edge.right) - most(edge => edge.left), least(edge => edge.bottom) - most(edge => edge.top)];
}"""
#: Controls of these screens that cannot be pressed, even once somebody has scrolled to them: less than all of one is in
#: sight, or a press at its middle or near a corner meets another part.
NOT_PRESSED = """async screens => {
  const nameOf = each => each && (each.id || each.className || each.textContent.trim().slice(0, 20) || each.localName);
  const frames = each => {
    const found = [];
    for (let one = each.parentElement; one; one = one.parentElement) {
      const { overflowX, overflowY } = getComputedStyle(one);
      if (overflowX !== "visible" || overflowY !== "visible") found.push({ one, overflowX, overflowY });
    }
    return found;
  };
  const faultOf = (each, around) => {
    const box = each.getBoundingClientRect();
    const edges = [new DOMRect(0, 0, innerWidth, innerHeight), ...around.map(({ one }) => one.getBoundingClientRect())];
    if (edges.some(edge => box.left < edge.left - 2 || box.right > edge.right + 2)) return "is cut at a side";
    if (edges.some(edge => box.top < edge.top - 2 || box.bottom > edge.bottom + 2)) return "is cut";
    const [x, y] = [Math.min(8, box.width / 4), Math.min(8, box.height / 4)];
    const points = [[box.left + x, box.top + y], [box.right - x, box.top + y], [box.left + x, box.bottom - y],
      [box.right - x, box.bottom - y], [box.x + box.width / 2, box.y + box.height / 2]];
    const hits = points.map(([x, y]) => document.elementFromPoint(x, y));
    const other = hits.find(hit => !each.contains(hit) && !each.closest("label")?.contains(hit));
    return other === undefined ? "" : `under ${nameOf(other)}`;
  };
  const scrollTo = (each, around) => {
    const places = around.map(({ one }) => [one.scrollLeft, one.scrollTop]);
    each.scrollIntoView({ block: "center", inline: "center" });
    // What nobody can scroll does not count.
    around.forEach(({ one, overflowX, overflowY }, index) => {
      if (overflowX === "hidden") one.scrollLeft = places[index][0];
      if (overflowY === "hidden") one.scrollTop = places[index][1];
    });
  };
  const faults = [];
  for (const name of screens) {
    location.hash = name;
    while (document.querySelector("main").dataset.screen !== name) await new Promise(requestAnimationFrame);
    for (const each of document.querySelectorAll("button, select, input, summary, a[href]")) {
      if (!each.checkVisibility({ visibilityProperty: true })) continue;
      const around = frames(each);
      if (!faultOf(each, around)) continue;
      scrollTo(each, around);
      const fault = faultOf(each, around);
      if (fault) faults.push(`${name}: ${nameOf(each)} ${fault}`);
    }
  }
  return faults;
}"""
#: Words that are cut off.
CUT = "all => all.filter(each => each.scrollWidth > each.clientWidth + 1).map(each => each.outerHTML.slice(0, 120))"
#: What scrolls sideways, other than tables, and the strip of all cuts, which is made for it.
SIDEWAYS = """() => [...document.querySelectorAll("main, main *")].filter(each => each.checkVisibility() &&
  ["auto", "scroll"].includes(getComputedStyle(each).overflowX) && !each.querySelector("table") &&
  each.localName !== "rp-point-strip" &&
  each.scrollWidth > each.clientWidth + 1).map(each => each.localName + "." + each.className)"""
#: Whether the next step takes a press: one that has just come does not at once.
SETTLED = "() => document.querySelector('rp-bar .next').getAnimations({ subtree: true }).length === 0"
TO_THE_END = "() => { for (const each of [document.documentElement, document.body]) each.scrollTo(0, 1e6); }"
TO_THE_TOP = "() => { for (const each of [document.documentElement, document.body]) each.scrollTo(0, 0); }"


def stop_is_in_sight(page: Page, width: int, height: int) -> None:
    for scroll in (TO_THE_END, TO_THE_TOP):
        page.evaluate(scroll)
        box = page.locator("#stop").bounding_box()
        assert box is not None and box["width"] >= 100 and box["height"] >= 64
        assert box["x"] >= 0 and box["x"] + box["width"] <= width
        assert box["y"] >= 0 and box["y"] + box["height"] <= height
        middle = [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
        assert page.evaluate("([x, y]) => Boolean(document.elementFromPoint(x, y)?.closest('#stop'))", middle)


def view_share(page: Page, width: int, height: int) -> float:
    """How much of the window the large view has."""
    box = page.locator("rp-scene").bounding_box()
    assert box is not None and box["x"] >= 0 and box["x"] + box["width"] <= width
    return box["width"] * box["height"] / (width * height)


def fits(page: Page, width: int, height: int) -> None:
    """Nothing is cut off, covered or beyond an edge."""
    stop_is_in_sight(page, width, height)
    page.wait_for_function(SETTLED)
    assert page.locator("rp-bar .next button").evaluate(SEEN)[1] >= 44, "the next step is in sight"
    across, down = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
    assert across <= width and down <= height, "the page itself scrolls"
    assert page.evaluate(SIDEWAYS) == []
    assert page.evaluate(NOT_PRESSED, [page.evaluate("location.hash.slice(1)")]) == []
    assert page.locator("button:visible, a.button:visible, rp-screens a:visible").evaluate_all(CUT) == []


@pytest.mark.long
def test_every_screen_fits_every_window(page: Page, server: PlayedServer, subtests: pytest.Subtests) -> None:
    working(page, server)
    for name in SCREENS:
        open_screen(page, name)
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            with subtests.test(screen=name, size=f"{width}x{height}"):
                fits(page, width, height)


@pytest.mark.long
def test_a_whole_vine_fits_every_window(page: Page, server: PlayedServer, subtests: pytest.Subtests) -> None:
    STATES["whole-vine"](page, server)
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        with subtests.test(size=f"{width}x{height}"):
            fits(page, width, height)
            assert page.locator("#vine-accept").evaluate(SEEN)[1] >= 44
            # A picture is whole in sight, so that it counts as seen.
            picture = page.locator(".vine-card rp-cut-picture").first
            assert picture.evaluate(SEEN)[1] >= 0.9 * box_of(picture)["height"]


def somebody_else(page: Page, server: PlayedServer) -> None:
    server.control, server.viewers = held("other", "Bob"), 2
    expect(page.locator("#take-control")).to_be_visible()


def told(page: Page, server: PlayedServer) -> None:
    """Two short notices, which stay for this test."""
    page.evaluate("""async () => {
      window.setTimeout = () => 0;
      const [{ showToast }, { reason, reasonText }] =
        await Promise.all(["/js/state/page-state.js", "/js/state/reasons.js"].map(each => import(each)));
      showToast("warning", reasonText(reason("hold_view_stale", { limit_s: 0.5 })));
      showToast("error", reasonText(reason("reset_unexplained")));
    }""")
    expect(page.locator(".toast")).to_have_count(2)


#: What a page tells, one after another; each state begins where the one before was left.
TOLD: dict[str, Callable[[Page, PlayedServer], None]] = {
    "idle": lambda page, server: None,
    "somebody else in control": somebody_else,
    "running": STATES["running"],
    "paused": STATES["paused"],
    "stopped": STATES["stopped"],
    "a short notice": told,
    "no link": STATES["link-lost"],
}


@pytest.mark.long
@pytest.mark.parametrize("language", ["de", "fr"])
def test_whatever_is_told_every_control_can_be_pressed(
    page: Page, server: PlayedServer, subtests: pytest.Subtests, language: str
) -> None:
    """In languages of long words."""
    page.evaluate("language => localStorage.setItem('setting.language', language)", language)
    page.reload()
    expect(page.locator("html")).to_have_attribute("lang", language)
    for name in reversed(SCREENS):
        open_screen(page, name)
    for state, bring in TOLD.items():
        server.bridge, server.stopped, server.control = PlayedServer().bridge, (), None
        working(page, server)
        bring(page, server)
        page.wait_for_function(SETTLED)
        for width, height in SIZES[:7]:
            page.set_viewport_size({"width": width, "height": height})
            with subtests.test(state=state, size=f"{width}x{height}"):
                assert page.evaluate(NOT_PRESSED, SCREENS) == []
                assert page.locator("button:visible, a.button:visible").evaluate_all(CUT) == []


@pytest.mark.long
def test_the_view_has_most_of_the_window_and_no_banner_takes_any_of_it(
    page: Page, server: PlayedServer, subtests: pytest.Subtests
) -> None:
    def at_every_size(state: str) -> None:
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            with subtests.test(state=state, size=f"{width}x{height}"):
                least = 0.45 if width >= 1024 and height >= 720 else 0.4 if (width, height) == (390, 844) else 0.3
                assert view_share(page, width, height) >= least
                fits(page, width, height)

    working(page, server)
    at_every_size("working")
    page.locator("#show-preview").click()
    expect(page.locator("rp-preview")).to_be_visible()
    at_every_size("preview")
    page.locator("#close-preview").click()
    STATES["stopped"](page, server)
    at_every_size("stopped")
    server.bridge, server.stopped = PlayedServer().bridge, ()
    show_mode(page, server, controller("PAUSED", reason="nobody has looked at the robot for 2.0 s, and there is " * 3))
    at_every_size("paused")
    server.online = False
    server.sockets[-1].close()
    expect(page.locator("rp-link-banner")).to_contain_text("No link to the server")
    at_every_size("no link")


@pytest.mark.long
@pytest.mark.parametrize("name", SCREENS)
def test_the_words_of_a_banner_have_room_on_every_screen(
    page: Page, server: PlayedServer, name: str, subtests: pytest.Subtests
) -> None:
    working(page, server)
    open_screen(page, name)
    show_mode(page, server, controller("PAUSED", reason="nobody has looked at the robot for 2.0 s"))
    words = page.locator("rp-alarms li:visible .alarm-words").first
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        with subtests.test(size=f"{width}x{height}"):
            assert box_of(words)["width"] >= 150


@pytest.mark.long
def test_on_a_telephone_a_pause_hides_little_of_what_is_decided_until_it_is_unfolded(
    page: Page, server: PlayedServer
) -> None:
    working(page, server)
    choose(page, "p3")
    page.set_viewport_size({"width": 390, "height": 844})
    show_mode(page, server, controller("PAUSED", reason="nobody has looked at the robot for 2.0 s, and there is " * 3))
    banner = page.locator("rp-alarms")
    expect(banner).to_contain_text("Paused")
    assert box_of(banner)["height"] <= 80
    expect(page.locator(".next #to-continue, .next #resume").first).to_be_visible()
    cut = "each => each.scrollHeight > each.clientHeight + 1"
    assert banner.locator("strong").evaluate(cut)
    banner.locator(".alarm-fold").click()
    expect(banner.locator(".act")).to_be_visible()
    assert not banner.locator("strong").evaluate(cut)
    banner.locator(".alarm-fold").click()
    expect(banner.locator(".act")).to_be_hidden()
    open_screen(page, "review")
    decide = box_of(page.locator("#review-accept"))
    assert decide["y"] + decide["height"] <= box_of(banner)["y"]


@pytest.mark.parametrize("name", ["review", "drive", "report", "engineer"])
def test_a_screen_that_is_left_and_opened_again_is_as_it_was(page: Page, name: str) -> None:
    """The 3-D view is never loaded anew, and the address names the screen."""
    page.frames[1].evaluate("() => { window.same = true; }")
    open_screen(page, name)
    assert page.evaluate("location.hash") == f"#{name}"
    open_screen(page, "work")
    page.go_back()
    expect(page.locator("main")).to_have_attribute("data-screen", name)
    assert page.frames[1].evaluate("() => window.same")


def test_on_a_telephone_the_tabs_have_words_too(page: Page) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    for tab in page.locator("rp-screens a").all():
        words, box = box_of(tab.locator("span").first), box_of(tab)
        assert words["width"] > 25 and words["height"] > 15, tab.inner_text()
        assert box["x"] <= words["x"] and words["x"] + words["width"] <= box["x"] + box["width"]
        assert words["y"] + words["height"] <= 844


def test_on_a_telephone_a_screen_has_one_scroller(page: Page, server: PlayedServer) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    server.points = tuple(point(number, "ACCEPTED", spur=number) for number in range(1, 30))
    server.tell(server.page_points())
    expect(page.locator("[data-cut]")).to_have_count(29)
    scrollers = """() => [...document.querySelectorAll("main .screen, main .screen *")].filter(each =>
      each.checkVisibility() && each.scrollHeight > each.clientHeight + 1 &&
      ["auto", "scroll"].includes(getComputedStyle(each).overflowY)).map(each => each.localName)"""
    assert page.evaluate(scrollers) == ["rp-work"]


@pytest.mark.long
@pytest.mark.parametrize("language", ["en", "de", "es", "fr", "it"])
def test_on_a_telephone_the_controls_that_drive_are_in_sight(page: Page, server: PlayedServer, language: str) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    page.evaluate("language => localStorage.setItem('setting.language', language)", language)
    for state, needed in {"base": "#drive-pad", "tool": "#hold, .arrows button", "joints": ".joint button"}.items():
        page.reload()
        STATES[f"teleoperate-{state}"](page, server)
        screen, foot = box_of(page.locator("rp-drive")), page.locator(".drive-foot:has(> #go:not([hidden]))")
        end = box_of(foot)["y"] if foot.is_visible() else screen["y"] + screen["height"]
        # Of the tool every axis.
        controls = page.locator(needed).all()
        for control in map(box_of, controls if state == "tool" else controls[:1]):
            assert screen["y"] <= control["y"] and control["y"] + control["height"] <= end, state
        assert view_share(page, 390, 844) >= 0.4


def test_large_letters_and_large_targets_where_somebody_works(page: Page, server: PlayedServer) -> None:
    STATES["alarms"](page, server)
    parts = "rp-work, rp-bar, rp-alarms, rp-screens"
    small = """parts => [...document.querySelectorAll(parts)].flatMap(part => [...part.querySelectorAll("*")])
      .filter(each => each.checkVisibility())
      .filter(each => [...each.childNodes].some(node => node.nodeType === 3 && node.data.trim()))
      .filter(each => parseFloat(getComputedStyle(each).fontSize) < (each.matches(".badge") ? 15 : 16))
      .map(each => each.outerHTML.slice(0, 90))"""
    assert page.evaluate(small, parts) == []
    low = """all => all.map(each => [each.outerHTML.slice(0, 80), each.getBoundingClientRect()])
      .filter(([, box]) => Math.min(box.width, box.height) < 47.5).map(([html]) => html)"""
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        pressed = page.locator(":is(header, main, rp-bar) :is(button, a, select, summary):visible")
        assert pressed.evaluate_all(low) == []


def test_on_a_telephone_the_preview_leaves_the_view_and_a_stop_is_seen_whole(page: Page, server: PlayedServer) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    working(page, server)
    page.locator("#show-preview").click()
    preview, view = box_of(page.locator("rp-preview")), box_of(page.locator("rp-scene"))
    assert preview["y"] >= view["y"] + 0.6 * view["height"]
    page.locator("#close-preview").click()
    STATES["stopped"](page, server)
    bar = box_of(page.locator("rp-bar"))
    for part in ("rp-stop-banner input", "#reset"):
        box = box_of(page.locator(part))
        assert box["y"] + box["height"] <= bar["y"]
        assert page.locator(part).evaluate(SEEN)[1] >= 44


@pytest.mark.long
@pytest.mark.parametrize("language", ["en", "de", "es", "fr", "it"])
def test_on_a_tablet_all_that_can_be_done_to_a_cut_is_in_sight(page: Page, server: PlayedServer, language: str) -> None:
    page.set_viewport_size({"width": 1024, "height": 768})
    page.evaluate("language => localStorage.setItem('setting.language', language)", language)
    page.reload()
    working(page, server)
    choose(page, "p1")
    strip = box_of(page.locator("rp-point-strip"))
    for each in page.locator(".review-decide button, .review-tools button").all():
        if each.is_visible():
            assert box_of(each)["y"] + box_of(each)["height"] <= strip["y"]


@pytest.mark.long
@pytest.mark.parametrize("language", ["en", "de", "es"])
def test_on_a_tablet_every_axis_of_the_tool_is_in_sight(page: Page, server: PlayedServer, language: str) -> None:
    page.set_viewport_size({"width": 1024, "height": 768})
    page.evaluate("language => localStorage.setItem('setting.language', language)", language)
    page.reload()
    STATES["teleoperate-tool"](page, server)
    foot = box_of(page.locator(".drive-foot"))
    for each in page.locator("rp-arrows button").all():
        box = box_of(each)
        assert box["y"] + box["height"] <= foot["y"]
