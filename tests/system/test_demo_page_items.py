"""What the page offers, one thing after the other on real processes, at a desk and on a tablet.

1. Queue: `decide`, `order_and_turn`; what is accepted is cut in `test_main_job.py`; 2,000 points on a played server in
   `test_page_queue.py`.
2. Preview: `preview`; it is carried out in `test_page_preview_live.py`.
3. View: `look`; points by hand in `test_by_hand_live.py`.
4. Teleoperation: `drive_and_turn_joints`; the gizmo in `test_teleoperation_live.py`.
5. Camera: the end of `look`.
6. Charts and health: `charts_and_log`; a process that is killed in `test_lost_processes.py`.
7. People: `people`; several robots in `test_several_robots_live.py`.
8. Report: `report`.
9. Look: sizes, shifts, errors and other origins by the fixture `page`; axe-core in `test_page_access.py`.
"""

import json
import re
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from tests.support.operator_page import operator_page
from tests.support.page_parts import open_screen
from tests.support.processes.live_robot import LiveRobot
from tests.web.test_page_preview_live import asked

# Two minutes each, mostly of drawing the view in software.
pytestmark = [pytest.mark.browser, pytest.mark.alone, pytest.mark.slow]

SIZES = {"desk": (1280, 800, False), "tablet": (1024, 768, True)}
#: What moved by itself on the page once it was there, no press or key shortly before: the sum of its shares of it.
SHIFTS = """() => { window.shifts = []; new PerformanceObserver((list) => {
  for (const each of list.getEntries()) if (!each.hadRecentInput) window.shifts.push([each.value, each.startTime,
    each.sources.map((source) => source.node?.nodeName + "." + source.node?.className)]);
}).observe({ type: "layout-shift" }); }"""
MOST_SHIFT = 0.1
LONG_MS = 40_000


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveRobot]:
    with LiveRobot(tmp_path_factory.mktemp("robot")) as running:
        yield running


@pytest.fixture(params=SIZES)
def page(request: pytest.FixtureRequest, robot: LiveRobot, chromium_path: str) -> Iterator[Page]:
    """Opened by a link, as somebody new on each screen; nothing may go wrong or ask elsewhere while it is open."""
    width, height, touch = SIZES[request.param]
    wrong: list[str] = []
    with operator_page(chromium_path, robot.link(request.param), width=width, height=height, touch=touch) as opened:
        opened.on("pageerror", lambda error: wrong.append(str(error)))
        # A refusal is an answer, which the browser reports as an error all the same.
        opened.on(
            "console",
            lambda said: wrong.append(said.text) if said.type == "error" and "409" not in said.text else None,
        )
        opened.wait_for_selector("rp-scene iframe.loaded", timeout=LONG_MS)
        opened.evaluate(SHIFTS)
        yield opened
        shifts = opened.evaluate("window.shifts")
    assert wrong == []
    assert sum(share for share, *_ in shifts) < MOST_SHIFT, shifts


def entry(robot: LiveRobot, point_id: str) -> dict[str, Any]:
    (row,) = [row for row in robot.points() if row["entry"]["point_id"] == point_id]
    return dict(row)


def rows(page: Page, state: str) -> Locator:
    return page.locator(f'.strip-mark[data-state="{state}"]')


def row(page: Page, point_id: str) -> Locator:
    return page.locator(f'.strip-mark[data-point-id="{point_id}"]')


def look_at(page: Page, mark: Locator) -> str:
    """Look at a point until it may be decided about; returns its name."""
    name = str(mark.get_attribute("data-point-id"))
    row(page, name).click()
    expect(page.locator(f'rp-review[data-key="{name}"]:not([data-pictured="loading"])')).to_be_visible(timeout=LONG_MS)
    page.wait_for_timeout(800)
    return name


def pressed(page: Page, button: Locator, until: Callable[[], object], robot: LiveRobot, what: str) -> None:
    """Hold a button down until something has come of it."""
    button.scroll_into_view_if_needed()
    button.hover()
    page.mouse.down()
    try:
        robot.wait(until, 15, what)
    finally:
        page.mouse.up()


def test_every_part_of_the_page_does_its_work(page: Page, robot: LiveRobot) -> None:
    decide(page, robot)
    order_and_turn(page, robot)
    preview(page, robot)
    look(page)
    drive_and_turn_joints(page, robot)
    charts_and_log(page)
    people(page, robot)
    report(page)
    assert robot.refused() == []
    stop_and_reset(page, robot)


def decide(page: Page, robot: LiveRobot) -> None:
    """Reject with a reason, take back, accept, move along the cane."""
    expect(rows(page, "PROPOSED").nth(3)).to_be_attached(timeout=90_000)
    if robot.mode() == "IDLE":
        page.click("#arm")
    expect(page.locator("#mode")).to_have_attribute("data-mode", "READY", timeout=LONG_MS)
    open_screen(page, "review")
    name = look_at(page, rows(page, "PROPOSED").first)
    page.click("#review-leave")
    page.get_by_role("button", name="wrong cane").click()
    expect(row(page, name)).to_have_attribute("data-state", "REJECTED", timeout=LONG_MS)
    look_at(page, row(page, name))
    expect(page.locator(".review-why")).to_contain_text("wrong cane")
    page.click("#undo")
    expect(row(page, name)).to_have_attribute("data-state", "PROPOSED", timeout=LONG_MS)

    look_at(page, row(page, name))
    page.locator(".adjust summary").click()
    before = entry(robot, name)["point"]

    def told() -> list[str]:
        events = robot.client.get("/api/events").json()["events"]
        return [line["text"] for line in events if "MovePoint by" in line["text"]]

    began = len(told())
    # The other way where a node is too near.
    for number, button in enumerate(("+1", "−1"), 1):
        page.get_by_role("button", name=button, exact=True).click()
        robot.wait(lambda number=number: len(told()) == began + number, 20, "the cut to be moved or not")
        if "Moved by" in told()[-1]:
            break
    count = len(told())
    assert "Moved by" in told()[-1], told()

    def along() -> float:
        way = np.subtract(entry(robot, name)["point"]["position"], before["position"])
        return float(abs(way @ np.array(before["tangent"])))

    robot.wait(lambda: 0.0004 < along() < 0.0016, 10, "the cut to be a millimetre further on")
    page.click("#undo")
    robot.wait(lambda: len(told()) > count and "Moved by" in told()[-1], 20, "the cut to be moved back")

    def more_accepted() -> bool:
        """As a person does: what is refused, since it is seen otherwise by now, is looked at and accepted again."""
        accepted = rows(page, "ACCEPTED").count()
        look_at(page, rows(page, "PROPOSED").first)
        page.click("#review-accept")
        for _ in range(30):
            page.wait_for_timeout(100)
            if rows(page, "ACCEPTED").count() > accepted:
                return True
        return False

    tries = [more_accepted() for _ in range(3)]
    while tries.count(True) < 3:
        tries.append(more_accepted())
        assert len(tries) < 8, robot.logs()


def work_order(robot: LiveRobot) -> list[str]:
    return [each["entry"]["point_id"] for each in robot.points() if each["entry"]["state"] == "ACCEPTED"]


def order_and_turn(page: Page, robot: LiveRobot) -> None:
    """Another order by keys and by dragging, the plan's again; the approach turned and left to the search again."""
    expect(page.locator("rp-order")).to_be_visible(timeout=LONG_MS)
    page.locator("rp-order summary").click()
    expect(page.locator(".order-row").nth(2)).to_be_visible()
    first, second, *_ = work_order(robot)
    page.locator(f'.order-row[data-point-id="{first}"]').click()
    page.locator(".order-list").focus()
    page.keyboard.press("Alt+ArrowDown")
    robot.wait(lambda: work_order(robot)[:2] == [second, first], 20, "the first to be second")
    expect(page.locator(".order-row").first).to_have_attribute("data-point-id", second)

    last = work_order(robot)[-1]
    grip = page.locator(f'.order-row[data-point-id="{last}"] .order-grip')
    grip.scroll_into_view_if_needed()
    grip.hover()
    page.mouse.down()
    goal = page.locator(f'.order-row[data-point-id="{second}"]').bounding_box()
    assert goal is not None
    page.mouse.move(goal["x"] + 20, goal["y"] + 4, steps=4)
    expect(page.locator(".order-mark")).to_be_visible()
    page.mouse.up()
    robot.wait(lambda: work_order(robot)[0] == last, 20, "the dragged one to be first")
    page.click("#planners-order")
    expect(page.locator("rp-order summary")).to_contain_text("by the plan", timeout=LONG_MS)
    page.locator("rp-order summary").click()

    look_at(page, row(page, first))
    page.get_by_label("Turn of the approach").fill("15")
    robot.wait(
        lambda: entry(robot, first)["entry"]["azimuth"] == pytest.approx(0.2618, abs=1e-3), 20, "the approach to turn"
    )
    page.get_by_role("button", name="As found").click()
    robot.wait(lambda: entry(robot, first)["entry"]["azimuth"] is None, 20, "the approach to be the search's")


def preview(page: Page, robot: LiveRobot) -> None:
    """Played as a ghost, scrubbed, approved on the controller."""
    shown = page.locator("rp-preview")
    asked(page, robot)
    expect(page.locator(".preview-words")).to_contain_text(re.compile(r"cuts? in \d+\.\d s"))
    page.locator("#preview-time").fill("2")
    expect(page.locator(".preview-time")).to_contain_text("2.0 /")
    page.click("#approve-preview")
    expect(shown).to_have_attribute("data-phase", "approved", timeout=LONG_MS)
    approved = robot.client.get("/api/preview").json()["state"]
    assert (approved["phase"], len(approved["preview_hash"])) == ("approved", 64)
    page.click("#preview-hide")


def pixels(page: Page) -> np.ndarray:
    image = Image.open(BytesIO(page.locator("rp-scene").screenshot())).convert("L")
    return np.asarray(image).astype(int)


def look(page: Page) -> None:
    """The camera's places, layers, a measure, and the image at the hand held still."""
    for name in ("Top", "Row", "Tool", "Follow"):
        before = pixels(page)
        page.get_by_role("button", name=name, exact=True).click()
        for _ in range(40):
            page.wait_for_timeout(250)
            if np.abs(pixels(page) - before).mean() > 4.0:
                break
        else:
            raise AssertionError(f"{name} does not move the camera")
    page.click("#show-layers")
    page.get_by_label("Camera and its image").check()
    page.keyboard.press("Escape")
    expect(page.locator("#layers")).to_be_hidden()
    page.click("#measure")
    words = page.locator("rp-view-tools .measured")
    expect(words).to_have_text("Click two places in the view.")
    box = page.locator("rp-scene").bounding_box()
    assert box is not None
    for _ in range(5):
        for share in (0.35, 0.6):
            page.mouse.click(box["x"] + share * box["width"], box["y"] + 0.8 * box["height"])
            page.wait_for_timeout(1500)
        if " m from " in str(words.text_content()):
            break
    expect(words).to_contain_text(" m from ")
    page.keyboard.press("Escape")
    expect(words).to_be_hidden()

    picture = page.locator("rp-camera img")
    assert picture.evaluate("each => each.naturalWidth") > 0
    page.click("#swap")
    page.click("#freeze")
    expect(page.locator("rp-camera")).to_contain_text("frozen")
    page.click("#freeze")
    expect(page.locator("rp-camera")).not_to_contain_text("frozen")
    page.click("#swap")


def drive_and_turn_joints(page: Page, robot: LiveRobot) -> None:
    """The base by keys and by the pad, a joint by its button; each only while held. The approval is gone after that."""
    open_screen(page, "drive")
    page.wait_for_selector('#teleop[aria-disabled="false"]', timeout=LONG_MS)
    page.click("#teleop")
    page.get_by_role("group", name="What moves").get_by_role("button", name="Base").click()
    at = robot.state()["base"]["x"]
    page.locator("h1").click()
    page.keyboard.down("w")
    try:
        robot.wait(lambda: robot.state()["base"]["x"] > at + 0.06, 15, "the base to drive")
    finally:
        page.keyboard.up("w")
    robot.wait(lambda: robot.mode() == "READY", 10, "the hold to end")
    expect(page.locator("rp-preview")).to_have_attribute("data-phase", "expired", timeout=LONG_MS)
    expect(page.locator(".preview-words")).to_contain_text("Expired")

    page.get_by_role("group", name="What moves").get_by_role("button", name="Joints").click()
    joint = robot.state()["joints"]["position"][8]
    pressed(
        page,
        page.get_by_role("button", name="Joint 7 up"),
        lambda: robot.state()["joints"]["position"][8] > joint + 0.05,
        robot,
        "joint 7 to turn",
    )
    robot.wait(lambda: robot.mode() == "READY", 10, "the hold to end")
    page.click("#teleop")
    page.click("#more")
    page.click("#home")
    robot.wait(
        lambda: robot.mode() == "READY" and abs(robot.state()["joints"]["position"][8] - joint) < 0.02, 60, "home"
    )


def charts_and_log(page: Page) -> None:
    """Five minutes of every reading with the value under the pointer, held still; the log by words."""
    open_screen(page, "engineer")
    chart = page.locator("rp-charts figure[data-chart] canvas").first
    expect(chart).to_be_visible()
    chart.hover()
    expect(page.locator("rp-charts .chart-value").first).not_to_be_empty()
    page.click("#pause-charts")
    expect(page.locator("#pause-charts")).to_have_attribute("aria-pressed", "true")
    page.click("#pause-charts")
    lines = page.locator("rp-log li:visible")
    page.fill("#log-words", "rejected")
    expect(lines.first).to_contain_text("reject", ignore_case=True, timeout=LONG_MS)
    page.fill("#log-words", "nothing says this")
    expect(lines).to_have_count(0)
    page.fill("#log-words", "")


def people(page: Page, robot: LiveRobot) -> None:
    """Somebody is invited, asks for control, is given it, and has it taken back by a second press."""
    page.click("#person")
    page.click("#invite")
    page.fill("#invite-user", "bob")
    page.select_option("#invite-role", "operator")
    page.click("#invite-make")
    expect(page.locator("#invite-link")).to_have_value(re.compile(r"/sign-in\?token="))
    link = page.locator("#invite-link").input_value()
    page.keyboard.press("Escape")
    browser = page.context.browser
    assert browser is not None
    context = browser.new_context(locale="en-US", device_scale_factor=0.1, viewport={"width": 1024, "height": 768})
    other = context.new_page()
    try:
        other.goto(link)
        expect(other.locator("#request-control")).to_be_visible(timeout=LONG_MS)
        expect(other.locator(".control-words")).to_contain_text("holds control")
        expect(page.locator("rp-lease")).to_be_visible(timeout=LONG_MS)
        other.click("#request-control")
        expect(page.locator(".control-words")).to_have_text("bob asks for control", timeout=LONG_MS)
        page.click("#grant-control")
        expect(other.locator(".control-words")).to_have_text("You hold control", timeout=LONG_MS)
        expect(page.locator("#arm, #start, #home").last).to_have_attribute("aria-disabled", "true", timeout=LONG_MS)
        page.click("#take-control")
        expect(page.locator("#take-control")).to_have_text("Really take it?")
        page.click("#take-control")
        expect(page.locator(".control-words")).to_have_text("You hold control", timeout=LONG_MS)
        expect(other.locator("rp-toasts")).to_contain_text("no longer hold control", timeout=LONG_MS)
    finally:
        context.close()
    robot.wait(lambda: robot.mode() in ("READY", "IDLE"), 20, "the robot to rest")


def report(page: Page) -> None:
    """On the page, and saved as CSV and as JSON."""
    open_screen(page, "report")
    expect(page.locator("rp-report .hint").first).to_contain_text("From the ledger", timeout=LONG_MS)
    expect(page.locator("rp-report")).to_contain_text("gave control to the person who had asked", timeout=LONG_MS)
    for words, name in (("CSV", "cuts.csv"), ("JSON", "report.json")):
        with page.expect_download() as saved:
            page.get_by_role("link", name=words).click()
        assert saved.value.suggested_filename == name
        text = Path(saved.value.path()).read_text(encoding="utf-8")
        assert "point" in text.splitlines()[0] if name == "cuts.csv" else json.loads(text)["control"]


def stop_and_reset(page: Page, robot: LiveRobot) -> None:
    """The stop says who pressed it and who has it; a reset needs a reason."""
    page.click("#stop")
    banner = page.locator("rp-stop-banner")
    expect(banner).to_be_visible(timeout=LONG_MS)
    expect(banner).to_contain_text("bridge")
    page.fill("#reset-reason", "seen to")
    page.click("#reset")
    expect(banner).to_be_hidden(timeout=LONG_MS)
    robot.wait(lambda: robot.mode() == "IDLE", 10, "IDLE")
