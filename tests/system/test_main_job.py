"""The main job as a person does it: real processes, real wire, real browser, judged by the simulator's own trace."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from playwright.sync_api import Page

from bridge.sim.robot import trace
from tests.support.operator_page import accept, operator_page
from tests.support.processes.live_robot import LiveRobot

pytestmark = [pytest.mark.browser, pytest.mark.alone]


def arm_and_accept(page: Page, *places: int) -> list[str]:
    """Wait for detections, arm, accept those at these places of the queue on the page; their ids."""
    page.wait_for_selector('[data-cut][data-state="PROPOSED"]', timeout=90_000)
    page.click("#arm")
    page.wait_for_selector('#mode[data-mode="READY"]', timeout=15_000)
    rows = page.locator('[data-cut][data-state="PROPOSED"]').all()
    chosen = [str(rows[place].get_attribute("data-cut")) for place in places]
    for point_id in chosen:
        accept(page, point_id)
        page.wait_for_selector(f'[data-cut="{point_id}"][data-state="ACCEPTED"]', timeout=40_000)
    return chosen


def start(page: Page, robot: LiveRobot, condition: Callable[[], object], what: str, mouse_stays: bool = False) -> None:
    """Start the work and wait for `condition()`, with nobody there to help should it stop by itself.

    With `mouse_stays` the mouse is not moved to Start: a browser that draws in software takes seconds to move it.
    """
    if mouse_stays:
        page.wait_for_selector('#start[aria-disabled="false"]')
        page.dispatch_event("#start", "click")
    else:
        page.click("#start")
    robot.wait(lambda: robot.mode() == "AUTO", 10, "the work to start")

    def met() -> bool:
        if condition():
            return True
        mode = robot.mode()
        assert mode in ("AUTO", "READY"), f"stopped by itself: {mode}, waiting for {what}\n{robot.logs()}"
        return False

    robot.wait(met, 120, what)


def ended(robot: LiveRobot, chosen: list[str]) -> bool:
    """Whether no chosen point is still to be cut."""
    states = {row["entry"]["point_id"]: row["entry"]["state"] for row in robot.points()}
    return not {states.get(point_id) for point_id in chosen} & {"ACCEPTED", "CUTTING"}


@dataclass
class Press:
    """A press of the mouse on a button, timed by the browser when it received it, not when the page got round to it."""

    page: Page
    selector: str

    def listen(self) -> None:
        """Note when a real press arrives at the button; before whatever listens there itself."""
        self.page.evaluate(
            """(selector) => window.addEventListener("pointerdown", (event) => {
                const at = performance.timeOrigin + event.timeStamp;
                if (event.isTrusted && event.target.closest(selector)) window.pressedAt = at / 1000;
            }, { capture: true })""",
            self.selector,
        )

    def reach(self) -> None:
        """Bring the mouse to the button."""
        box = self.page.locator(self.selector).bounding_box()
        assert box is not None
        self.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)

    def press(self) -> float:
        """Press where the mouse is; when that was, on the machine's monotonic clock (s)."""
        before = time.monotonic()
        self.page.mouse.down()
        after = time.monotonic()
        self.page.mouse.up()
        wall_ahead = time.time() - time.monotonic()
        pressed = float(self.page.evaluate("window.pressedAt")) - wall_ahead
        assert before - 0.01 < pressed < after + 0.01, "the browser's clock is not this machine's"
        return pressed


def stop_in_mid_approach(page: Page, robot: LiveRobot, stop: Press) -> float | None:
    """Start, press stop while the base drives; seconds from the press until base and arm are still, from the trace.

    None where the base had arrived before the press: the browser's mouse may come late to it.
    """
    stop.reach()
    start(page, robot, robot.driving, "the base to drive", mouse_stays=True)
    pressed = stop.press()
    page.wait_for_selector('#mode[data-mode="ESTOP_LATCHED"]', timeout=20_000)
    assert robot.state()["bridge"]["stop_id"]
    page.wait_for_timeout(1500)
    record = trace.read(robot.trace)
    last = record.rows[record.rows["clock"] <= pressed][-1]
    return record.stopping_time(pressed) if abs(last["base_velocity"][0]) > 0.02 else None


def reset_and_arm(page: Page, robot: LiveRobot) -> None:
    robot.post("reset", reason="pressed by this test")
    robot.wait(lambda: robot.mode() == "IDLE", 10, "IDLE")
    page.wait_for_selector('#mode[data-mode="IDLE"]', timeout=15_000)
    page.click("#arm")
    robot.wait(lambda: robot.mode() == "READY", 10, "READY")


def test_accepted_points_are_cut_where_they_were_accepted_and_the_page_stops_the_robot_on_the_way(
    tmp_path: Path, chromium_path: str
) -> None:
    """Two at least are cut; what cannot be, for a wire beside it for instance, is left alone and says why.

    Of three presses the median counts: a browser that draws in software now and then keeps a press waiting.
    """
    with LiveRobot(tmp_path) as robot:
        with operator_page(chromium_path, robot.link("ada")) as page:
            # The last ones in the row, so that the base has far to go, also when one of them turns out to be refused.
            chosen = arm_and_accept(page, -1, -2, -3)
            accepted = {row["entry"]["point_id"]: row["entry"]["accepted_position"] for row in robot.points()}
            stop = Press(page, "#stop")
            stop.listen()
            took: list[float] = []
            too_late = 0
            # Two on the same side of the limit settle the median.
            while len(took) < 2 or (len(took) < 3 and min(took) < 0.5 <= max(took)):
                if (seconds := stop_in_mid_approach(page, robot, stop)) is not None:
                    took.append(seconds)
                else:
                    too_late += 1
                    assert too_late < 3, "the base no longer drove when the button was pressed"
                reset_and_arm(page, robot)
            start(page, robot, lambda: ended(robot, chosen), "the points to end")
            entries = {row["entry"]["point_id"]: row["entry"] for row in robot.points()}
            done = [point_id for point_id in chosen if entries[point_id]["state"] == "DONE"]
            for point_id in done:
                page.wait_for_selector(f'[data-cut="{point_id}"][data-state="DONE"]', timeout=40_000)
            assert robot.refused() == []
    assert sorted(took)[(len(took) - 1) // 2] < 0.5, took
    assert max(took) < 1.0, took
    assert len(done) >= 2, [entries[point_id] for point_id in chosen]
    cuts = {event["point_id"]: event for event in trace.read(robot.trace).events if event["event"] == "cut"}
    for point_id in done:
        assert [piece for piece in cuts[point_id]["severed"] if piece["kind"] in ("cane", "node", "spur")]
        assert min(math.dist(accepted[point_id], piece["point"]) for piece in cuts[point_id]["severed"]) < 0.010
    for point_id in set(chosen) - set(done):
        assert entries[point_id]["reason"]
        assert entries[point_id]["state"] == "UNKNOWN" or not cuts.get(point_id, {}).get("severed")
