"""A survey as a person asks for it on the page: real processes, real browser, judged by the simulator's trace."""

from pathlib import Path

import pytest
from playwright.sync_api import expect

from bridge.sim.robot import trace
from tests.support.operator_page import operator_page
from tests.support.processes.live_robot import LiveRobot

pytestmark = [pytest.mark.browser, pytest.mark.alone, pytest.mark.slow]


def test_the_survey_drives_as_far_as_was_chosen_and_says_what_it_found(tmp_path: Path, chromium_path: str) -> None:
    """Slow: a metre there and perhaps back, at walking pace for a camera."""
    with LiveRobot(tmp_path, seed=6) as robot, operator_page(chromium_path, robot.link("ada")) as page:
        page.wait_for_selector('[data-cut][data-state="PROPOSED"]', timeout=90_000)
        before = len(robot.points())
        page.click("#arm")
        page.wait_for_selector('#mode[data-mode="READY"]', timeout=15_000)
        # With cuts to be reviewed a survey is not the next step.
        page.click("#more")
        page.select_option("#survey-distance", "1")
        page.click("#survey")
        page.wait_for_selector('#mode[data-mode="AUTO"]', timeout=15_000)
        page.wait_for_selector('#mode[data-mode="READY"]', timeout=90_000)
        expect(page.locator(".next-why")).to_contain_text("surveyed:")
        told = page.locator(".next-why").inner_text()
        assert "point" in told and "still unclear" in told
        assert len(robot.points()) > before
        record = trace.read(robot.trace)
    ahead = record.rows["base"][:, 0]
    assert 0.97 < ahead.max() < 1.05
    assert not [event for event in record.events if event["event"] == "cut"]
