"""A whole vine accepted in one press: real processes, real wire, real browser."""

from pathlib import Path

import pytest
from playwright.sync_api import Request, expect

from tests.support.operator_page import operator_page
from tests.support.processes.live_robot import LiveRobot

#: More pictures come to be seen while a test looks, so that the page itself tells which cuts were seen at the press.
NOTE_SEEN_AT_PRESS = """() => addEventListener("keydown", () => {
    const seen = document.querySelector(".vine-cards").querySelectorAll('.vine-card[data-seen="yes"]:not([hidden])');
    window.seenAtPress = [...seen].map((card) => card.dataset.key);
}, { capture: true, once: true })"""

pytestmark = [pytest.mark.browser, pytest.mark.alone]


@pytest.mark.long
def test_what_one_press_accepts_is_what_was_shown_and_one_press_takes_it_back(
    tmp_path: Path, chromium_path: str
) -> None:
    sent: dict[str, str] = {}

    def look(request: Request) -> None:
        if request.url.endswith("/accept"):
            sent[request.url.split("/")[-2]] = request.post_data_json["digest"]

    def states() -> dict[str, tuple[str, str]]:
        entries = [row["entry"] for row in robot.points()]
        return {each["point_id"]: (each["state"], each["digest"]) for each in entries if each["point_id"] in seen}

    with LiveRobot(tmp_path) as robot, operator_page(chromium_path, robot.link("ada")) as page:
        page.on("request", look)
        page.wait_for_selector('[data-cut][data-state="PROPOSED"]', timeout=90_000)
        page.click('[data-tab="review"]')
        expect(page.locator("#open-vine")).to_be_enabled(timeout=30_000)
        page.keyboard.press("v")
        expect(page.locator("#vine-accept")).to_be_enabled(timeout=30_000)
        page.evaluate(NOTE_SEEN_AT_PRESS)
        page.keyboard.press("a")
        seen = page.evaluate("window.seenAtPress")
        assert seen
        robot.wait(lambda: {state for state, _ in states().values()} == {"ACCEPTED"}, 20, "all to be accepted")
        accepted = states()
        page.keyboard.press("z")
        robot.wait(lambda: {state for state, _ in states().values()} == {"PROPOSED"}, 20, "all to be proposed")
        assert accepted == {name: ("ACCEPTED", digest) for name, digest in sent.items()}
        assert robot.refused() == []
