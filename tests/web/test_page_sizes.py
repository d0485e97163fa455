"""No screen size hides the view, the queue or the stop: what does not fit at once is reached by scrolling."""

from collections.abc import Callable
from itertools import combinations

import pytest
from playwright.sync_api import Page, expect

from tests.support.page_parts import show_mode, working
from tests.support.page_states import STATES
from tests.support.played_server import PlayedServer, controller

pytestmark = pytest.mark.browser

#: A laptop, a small one, a tablet, a small window, a telephone across and upright, and 1440×900 at 200 %; then tablets
#: upright and in a browser with bars, where one layout ends and the next begins.
SIZES = (
    *((1440, 900), (1280, 720), (1024, 768), (960, 600), (844, 390), (390, 844), (720, 450)),
    *((1024, 690), (768, 1024), (620, 900)),
)
PANELS = (
    ".top", "rp-queue", "rp-scene", "rp-teleoperation", "rp-preview", "rp-camera", "rp-telemetry", "rp-alarms",
    "rp-log",
)  # fmt: skip
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
#: Controls that cannot be pressed where they are, once they have been scrolled to, and what lies over them.
COVERED = """() => [...document.querySelectorAll("button, select, input, summary")].flatMap(each => {
  if (!each.checkVisibility({ visibilityProperty: true }) || each.closest("[hidden]")) return [];
  each.scrollIntoView({ block: "center" });
  const box = each.getBoundingClientRect();
  const found = document.elementFromPoint((box.left + box.right) / 2, (box.top + box.bottom) / 2);
  const whole = box.left >= 0 && box.right <= innerWidth;
  if (whole && (each.contains(found) || each.closest("label")?.contains(found))) return [];
  return [`${each.id || each.className || each.textContent || each.type} under ${found?.id || found?.localName}`];
})"""
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


def all_is_reached(page: Page, width: int, height: int, view: int = 240) -> None:
    stop_is_in_sight(page, width, height)
    wide, tall = page.locator("rp-scene").evaluate(SEEN)
    assert wide >= 320 and tall >= view, f"{wide:.0f}×{tall:.0f} px of the view are to be seen"
    wide, tall = page.locator("rp-queue .groups").evaluate(SEEN)
    assert wide >= 280 and tall >= 190, f"{wide:.0f}×{tall:.0f} px of the queue's list are to be seen"
    for part in ("document.documentElement", "document.body"):
        across, seen = page.evaluate(f"[{part}.scrollWidth, {part}.clientWidth]")
        assert across <= seen <= width, "it scrolls sideways"
    page.evaluate(TO_THE_TOP)
    boxes = {name: page.locator(name).bounding_box() for name in PANELS if page.locator(name).is_visible()}
    for (one, a), (other, b) in combinations(boxes.items(), 2):
        assert a is not None and b is not None
        apart = (
            a["x"] + a["width"] <= b["x"] + 1 or b["x"] + b["width"] <= a["x"] + 1
            or a["y"] + a["height"] <= b["y"] + 1 or b["y"] + b["height"] <= a["y"] + 1
        )  # fmt: skip
        assert apart, f"{one} lies over {other}"
    assert page.evaluate(COVERED) == []


def test_view_queue_and_stop_are_there_and_every_control_can_be_reached(
    page: Page, server: PlayedServer, subtests: pytest.Subtests
) -> None:
    def at_every_size(state: str, check: Callable[[int, int], None]) -> None:
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            with subtests.test(state=state, size=f"{width}x{height}"):
                check(width, height)

    working(page, server)
    at_every_size("working", lambda width, height: all_is_reached(page, width, height))
    page.locator("#teleop").click()
    page.get_by_role("button", name="Base", exact=True).click()
    expect(page.locator("rp-drive-pad")).to_be_visible()
    at_every_size("base by hand", lambda width, height: all_is_reached(page, width, height, view=220))
    page.locator("#teleop").click()
    STATES["stopped"](page, server)
    at_every_size("stopped", lambda width, height: all_is_reached(page, width, height, view=220))
    server.bridge, server.stopped = PlayedServer().bridge, ()
    show_mode(page, server, controller("PAUSED", reason="nobody has looked at the robot for 2.0 s, and there is " * 3))
    at_every_size("paused", lambda width, height: all_is_reached(page, width, height))
    server.online = False
    server.sockets[-1].close()
    expect(page.locator("rp-link-banner")).to_contain_text("No link to the server")

    def without_a_link(width: int, height: int) -> None:
        stop_is_in_sight(page, width, height)
        assert page.locator("rp-scene").evaluate(SEEN)[1] >= 220

    at_every_size("no link", without_a_link)
