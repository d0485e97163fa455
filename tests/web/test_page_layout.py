"""Where things are on the page, on screens of every size."""

import gzip
import json
import re
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.generate.languages import languages
from rolling_panda.messages import page as p
from rolling_panda.resources import resource
from server.api.page_files import minified
from tests.support.page_parts import held, open_screen
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer, bridge, controller, point

pytestmark = pytest.mark.browser


@pytest.mark.parametrize("size", [(1280, 800), (1024, 768)])
def test_after_a_stop_the_tool_stays_in_view(page: Page, server: PlayedServer, size: tuple[int, int]) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    server.bridge = bridge(stop_id="s1", stopped_by=reasons.software_stop("Ada", reasons.said("stop button")))
    server.controller = controller("ESTOP_LATCHED")
    view, banner = box_of(page.locator("rp-scene")), box_of(page.locator("rp-stop-banner"))
    assert banner["y"] >= view["y"] + view["height"] / 2
    assert banner["y"] + banner["height"] <= view["y"] + view["height"]


#: What moved on the page since it was ready, other than by a press: the layout shift, when (ms), and what from where to
#: where (px).
SHIFTS = """() => { window.shifts = []; new PerformanceObserver((list) => {
  for (const { value, startTime, sources } of list.getEntries())
    if (sources.some(({ node }) => !(node?.parentElement ?? node)?.closest?.(".notices")))
      window.shifts.push([value, Math.round(startTime), ...sources.map(({ node, previousRect: a, currentRect: b }) => {
      const each = node?.nodeType === Node.TEXT_NODE ? node.parentElement : node;
      const name = each ? [each.localName, ...each.classList].join(".") + (each.id && `#${each.id}`) : "removed";
      return `${name} ${[a.x, a.y, a.width, a.height]} -> ${[b.x, b.y, b.width, b.height]}`;
    })]);
}).observe({ type: "layout-shift" }); }"""


def a_whole_job(page: Page, server: PlayedServer) -> None:
    """Every point is worked off but one, which is refused; a pause and a stop come in between."""
    states: list[m.PointState] = ["ACCEPTED"] * 3
    told = 10

    def tell(mode: m.Mode, reason: str, **more: Any) -> None:
        nonlocal told
        told += 1
        # The pointer is on its way to a row of the list: none may move from under it.
        page.mouse.move(1000 + told, 600)
        server.controller = controller(mode, reason=reason, **more)
        server.points = tuple(point(k + 1, state, spur=k + 1) for k, state in enumerate(states))
        server.tell(p.PageEvents(events=(server.event(told, "warning", f"{mode}: {reason}"),)))
        server.tell(server.page_points())
        expect(page.locator("#mode")).to_have_attribute("data-mode", mode)

    ends: tuple[tuple[int, m.PointState], ...] = ((1, "DONE"), (2, "FAILED_NOT_CUT"), (3, "UNKNOWN"))
    for number, end in ends:
        name = f"p{number}"
        for phase in ("APPROACH", "ADVANCE", "CUT", "RETREAT"):
            states[number - 1] = "CUTTING" if phase == "CUT" else "ACCEPTED"
            tell("AUTO", f"{phase.lower()} of {name}, vine 1, spur {number}", phase=phase, active_point_id=name)
        states[number - 1] = end
        tell("PAUSED", f"{name} is {end}; a person has to look at it before the work goes on")
    server.bridge = bridge(stop_id="s1", stopped_by=reasons.software_stop("Ada", reasons.said("stop button")))
    tell("ESTOP_LATCHED", "stopped by Ada: stop button")
    expect(page.locator("rp-stop-banner")).to_be_visible()
    server.bridge = bridge()
    tell("IDLE", "the stop was released by Ada: all clear")
    expect(page.locator("rp-stop-banner")).to_be_hidden()
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def test_a_link_that_becomes_slow_moves_nothing_beside_it(page: Page) -> None:
    widths = page.evaluate("""() => {
        const link = document.querySelector("#link"), number = link.querySelector(".number");
        return [["5 ms", "good"], ["234 ms", "poor"], ["2345 ms", "bad"]].map(([text, quality]) => {
            number.textContent = text;
            link.dataset.quality = quality;
            return document.querySelector("rp-vines").getBoundingClientRect().width;
        });
    }""")
    assert len(set(widths)) == 1, widths


def test_what_is_accepted_who_comes_and_a_whole_job_move_nothing_on_the_page(page: Page, server: PlayedServer) -> None:
    """Neither a panel nor a button nor a row of the queue is elsewhere, so that no press meets another one."""
    parts = ("#stop", "#mode", "rp-vines", "main > .screen", ".stage", ".stage > *", "rp-bar", ".next", "[data-cut]")
    boxes = f"""() => [...document.querySelectorAll({json.dumps(", ".join(parts))})].map(each => {{
        const box = each.getBoundingClientRect();
        const name = each.id || each.dataset.pointId || "";
        return [each.localName, name, box.x, box.y, name === "mode" ? 0 : box.width];
    }})"""
    server.points = tuple(point(number, "PROPOSED", spur=number) for number in range(1, 4))
    page.reload()
    expect(page.locator("#mode")).to_have_attribute("data-mode", "READY")
    expect(page.locator("[data-cut]")).to_have_count(3)
    expect(page.locator("rp-camera img")).to_be_visible()
    before = page.evaluate(boxes)
    page.evaluate(SHIFTS)
    assert len(before) > 12
    server.points = (point(1, "ACCEPTED"), point(2, "ACCEPTED", spur=2), point(3, "UNREACHABLE", spur=3))
    server.tell(server.page_points())
    expect(page.locator(".next #start")).to_be_visible()
    assert page.evaluate(boxes) == before
    server.control = held("other", "Bob")
    expect(page.locator("#take-control")).to_be_visible()
    assert page.evaluate(boxes) == before
    a_whole_job(page, server)
    shifts = page.evaluate("window.shifts")
    seen = json.dumps(shifts, indent=1)
    assert sum(share for share, *_ in shifts) < 0.02, f"more than words beside one that has changed moved: {seen}"
    assert page.evaluate(boxes) == before


def test_the_list_has_room_for_five_cuts(page: Page, server: PlayedServer) -> None:
    server.points = tuple(point(number, "PROPOSED", spur=number) for number in range(1, 12))
    server.tell(server.page_points())
    fifth, list_ = box_of(page.locator("[data-cut]").nth(4)), box_of(page.locator(".work-rest"))
    assert fifth["y"] + fifth["height"] <= list_["y"] + list_["height"]


@pytest.mark.long
def test_the_log_follows_its_newest_line_when_the_screen_is_turned(page: Page, server: PlayedServer) -> None:
    def at_end() -> bool:
        past = "each => each.scrollHeight - each.scrollTop - each.clientHeight"
        return bool(page.locator("#log ol").evaluate(past) < 2)

    open_screen(page, "engineer")
    long = "a line that is long enough to need a second one where there is little room for it, " * 2
    server.tell(p.PageEvents(events=tuple(server.event(number, "info", long) for number in range(2, 42))))
    expect(page.locator("#log li")).to_have_count(41)
    for width, height in ((820, 1180), (1280, 800), (390, 844), (1024, 768)):
        page.set_viewport_size({"width": width, "height": height})
        until(page, at_end)
    page.locator("#log ol").evaluate("each => { each.scrollTop = 0; }")
    page.wait_for_timeout(100)
    server.tell(p.PageEvents(events=(server.event(42, "info", "while somebody reads older ones"),)))
    expect(page.locator("#log li")).to_have_count(42)
    assert page.locator("#log ol").evaluate("each => each.scrollTop") == 0


def test_the_page_is_small_and_keeps_to_its_own_files() -> None:
    folder = resource("web/index.html").parent.resolve()
    scripts = [*folder.rglob("*.js")]
    sent = {script: minified(script.read_text(encoding="utf-8")) for script in scripts}
    first, waiting = set[Path](), [folder / "js" / "app.js"]
    while waiting:
        script = waiting.pop()
        if script not in first:
            first.add(script)
            imported = re.findall(r'^(?:import|export) [^;]*?"(\.[^"]+)";', sent[script], re.MULTILINE)
            waiting += [(script.parent / name).resolve() for name in imported]
    assert sum(len(sent[script].encode()) for script in first) < 150_000, "what the page fetches before it is used"
    for language in languages(folder / "text"):
        texts = [
            gzip.compress((folder / "text" / f"{name}.{language}.json").read_bytes()) for name in ("page", "reasons")
        ]
        # Builds of zlib differ by some hundred bytes.
        assert sum(map(len, texts)) < 36_000, "and the texts, compressed"
    opened = [
        "rp-review.js",
        "rp-drive.js",
        "rp-report.js",
        "rp-engineer.js",
        "rp-preview.js",
        "rp-replay.js",
        "rp-robots.js",
        "rp-invite.js",
    ]
    later = set[Path](folder / "components" / name for name in opened) | {folder / "js/control/lease-worker.js"}
    later |= {folder / "js" / "views" / name for name in ("settings-sheet.js", "help-sheet.js", "hints.js")}
    waiting = list(later)
    while waiting:
        script = waiting.pop()
        later.add(script)
        imported = re.findall(r'^(?:import|export) [^;]*?"(\.[^"]+)";', sent[script], re.MULTILINE)
        waiting += [found for name in imported if (found := (script.parent / name).resolve()) not in later]
    elsewhere = {"sign-in.js", "frame.js", "offscreen-framebuffer.js"}
    # The page to label pictures is a page of its own.
    elsewhere |= {script.name for script in scripts if script.parent.name == "label"}
    elsewhere |= {script.name for script in scripts if script.name.startswith(("rp-label-", "label."))}
    assert {script.name for script in set(scripts) - first - later} == elsewhere, "what it fetches when opened"
    # Their indentation is not sent, so that none may lie within a text.
    assert [line for script in sent.values() for line in script.splitlines() if line.count("`") % 2] == []
    for file in [*scripts, *folder.rglob("*.css"), *folder.glob("*.html")]:
        text = file.read_text(encoding="utf-8")
        assert "innerHTML" not in text
        assert "https://" not in text
    for html in folder.glob("*.html"):
        text = html.read_text(encoding="utf-8")
        assert " style=" not in text
        assert "<style" not in text
        assert text.count("<script") == text.count(' src="')
    assert json.loads((folder / "jsconfig.json").read_text(encoding="utf-8"))["compilerOptions"]["strict"] is True


#: Imports of the page's scripts go to the left alone.
FOLDERS = ("js/state", "js/link", "js/control", "js/views", "js/label", "components", "js")


def test_imports_between_the_folders_of_the_page_go_one_way() -> None:
    folder = resource("web/index.html").parent.resolve()
    place = {folder / name: number for number, name in enumerate(FOLDERS)}
    for script in folder.rglob("*.js"):
        text = script.read_text(encoding="utf-8")
        for name in re.findall(r'^(?:import|export) [^;]*?"(\.[^"]+)";', text, re.MULTILINE):
            other = (script.parent / name).resolve()
            assert other.exists(), f"{script.name} imports {name}"
            if other.parent != script.parent:
                assert place[other.parent] < place[script.parent], f"{script.name} imports {name}"
