"""Previewing, approving and cutting on the page: real processes, real browser, judged by the simulator's own trace."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page

from bridge.sim.robot import trace
from tests.support.operator_page import operator_page
from tests.support.processes.live_robot import LiveRobot
from tests.system.test_main_job import arm_and_accept, ended, start

pytestmark = [pytest.mark.browser, pytest.mark.alone, pytest.mark.slow]

#: Of the tool that was driven from the line that was shown (m).
BOUND = 0.01
#: How much longer it may take than was shown, as a share: pictures on a machine that draws the page too come late.
LONGER = 0.6


def preview(robot: LiveRobot) -> dict[str, Any]:
    told: dict[str, Any] = robot.client.get("/api/preview").json()
    return told


def asked(page: Page, robot: LiveRobot) -> None:
    """Ask for a preview, again where what the camera has seen since has made it another one."""
    heard: list[str] = []
    page.click("#preview")

    def ready() -> bool:
        state = preview(robot)["state"]
        said = f"{state['phase']}: {state['reason']}"
        if heard[-1:] != [said]:
            heard.append(said)
        if state["phase"] in ("expired", "none") and page.get_attribute("#preview", "aria-disabled") == "false":
            page.click("#preview")
        page.wait_for_timeout(200)
        return page.get_attribute("rp-preview", "data-phase") == state["phase"] == "ready"

    try:
        robot.wait(ready, 90, "the preview")
    finally:
        print("preview:", " | ".join(heard))


def tool_path(robot: LiveRobot, since: float, until: float) -> np.ndarray:
    """Where the tool truly was (n×3, m)."""
    rows = trace.read(robot.trace).rows
    return np.array(rows[(rows["clock"] >= since) & (rows["clock"] <= until)]["tool"][::20])


def distances(line: np.ndarray, places: np.ndarray) -> np.ndarray:
    """From each place (n×3) to a line through points (m×3)."""
    start, along = line[:-1], np.diff(line, axis=0)
    square = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((places[:, None] - start) * along).sum(axis=2) / square, 0.0, 1.0)
    return np.linalg.norm(places[:, None] - start - share[..., None] * along, axis=2).min(axis=1)


def test_what_was_previewed_and_approved_is_what_is_done(tmp_path: Path, chromium_path: str) -> None:
    """It takes half a minute of work by the real processes, so it is among the slow ones."""
    with LiveRobot(tmp_path) as robot, operator_page(chromium_path, robot.link("ada")) as page:
        chosen = arm_and_accept(page, 1, 2)
        page.get_by_label("Preview before each cut").click()
        page.wait_for_selector('#start[title^="A preview is required"]', timeout=20_000)
        asked(page, robot)
        page.click("#approve-preview")
        page.wait_for_selector('rp-preview[data-phase="approved"]', timeout=20_000)
        shown = preview(robot)
        began = time.monotonic()
        start(page, robot, lambda: ended(robot, chosen), "the points to end")
        robot.wait(lambda: robot.mode() == "READY", 60, "the work to end")
        took = time.monotonic() - began
        names = [cut["point_id"] for cut in shown["state"]["cuts"]]
        assert sorted(names) == sorted(chosen)
        assert [cut["result"] for cut in shown["state"]["cuts"]] == ["cut", "cut"]
        states = {row["entry"]["point_id"]: row["entry"]["state"] for row in robot.points()}
        assert "DONE" in {states[name] for name in chosen}, robot.logs()
        page.wait_for_selector('rp-preview[data-phase="expired"]', timeout=20_000)
    line = np.array([row["tool"] for row in shown["motion"]["rows"]])
    apart = distances(line, tool_path(robot, began, began + took))
    within, most = np.quantile(apart, [0.95, 1.0])
    expected = shown["state"]["duration_s"]
    print(f"apart: median {np.median(apart):.4f} m, 95 % {within:.4f} m, most {most:.4f} m")
    print(f"{took:.1f} s for {expected:.1f} s")
    assert within < BOUND
    assert took < (1.0 + LONGER) * expected
