"""Two robots on the page: a picker, the other one's alarm, and nothing that reaches the wrong one."""

from collections.abc import Iterator
from typing import Any

import msgspec
import pytest
from playwright.sync_api import Page, expect
from starlette.responses import JSONResponse, Response

from rolling_panda import reasons
from rolling_panda.messages import Reason
from server.robots.summary import RobotSummary
from tests.support.axe import axe, grave
from tests.support.page_host import PlayedRequest, PlayedSocket, page_host
from tests.support.page_parts import choose, open_screen
from tests.support.played_page import box_of, opened, until
from tests.support.played_server import ORIGIN, PlayedServer, controller, page_file, point

__all__ = ["axe"]
pytestmark = pytest.mark.browser


class PlayedHall:
    """What is at the root of a server with two robots; the robots are played beside it."""

    def __init__(self) -> None:
        self.robots = {
            name: PlayedServer(base=f"/robots/{name}", points=(point(number, "PROPOSED"),))
            for number, name in enumerate(("panda-1", "panda-2"), 1)
        }
        self.alarms: dict[str, Reason] = {}
        self.stops: list[Any] = []
        self.online = True

    def attach(self, page: Page) -> None:
        page_host().show(page, self)

    def robot(self, path: str) -> PlayedServer | None:
        return next((robot for robot in self.robots.values() if path.startswith(f"{robot.base}/")), None)

    def answer(self, request: PlayedRequest) -> Response | None:
        robot = self.robot(request.path)
        if robot is not None:
            return robot.answer(request)
        if request.path == "/api/robots" and self.online:
            return JSONResponse([self.summarize(name, robot).model_dump() for name, robot in self.robots.items()])
        if request.path == "/api/stop":
            self.stops.append(request.body)
            return JSONResponse({"ok": True, "reason": ""})
        return page_file(request.path) if request.path.startswith("/js/scene/") else None

    def accept(self, socket: PlayedSocket) -> bool:
        robot = self.robot(socket.path)
        return robot is not None and robot.accept(socket)

    def hear(self, socket: PlayedSocket, text: str) -> None:
        robot = self.robot(socket.path)
        assert robot is not None
        robot.hear(socket, text)

    def summarize(self, name: str, robot: PlayedServer) -> RobotSummary:
        alarm = self.alarms.get(name)
        mode = None if robot.controller is None else robot.controller.mode
        return RobotSummary.model_validate(
            {
                "name": name,
                "path": f"{robot.base}/",
                "mode": mode,
                "severity": "" if alarm is None else reasons.CATALOGUE[alarm.code].severity,
                "alarm": None if alarm is None else msgspec.to_builtins(alarm),
                "holder": "Ada" if name == "panda-1" else "Bob",
                "yours": name == "panda-1",
                "pages": 1,
            }  # fmt: skip
        )


@pytest.fixture
def hall() -> PlayedHall:
    return PlayedHall()


@pytest.fixture
def pages(tab: Page, hall: PlayedHall) -> Iterator[Page]:
    with opened(tab, hall.attach, "/robots/panda-1/", 1024, 768) as page:
        yield page


def samples(page: Page) -> list[float]:
    """When the samples of the charts were taken (ms from when this page was loaded)."""
    at: list[float] = page.evaluate(
        "() => import(`${location.pathname}js/views/history.js`).then(({ history }) => "
        "history.of(history.names[0]).map((sample) => sample.at))"
    )
    return at


@pytest.mark.long
def test_the_other_robot_is_seen_and_chosen_and_nothing_reaches_the_wrong_one(pages: Page, hall: PlayedHall) -> None:
    page, (one, two) = pages, hall.robots.values()
    first, second = (page.locator(f'[data-robot="{name}"]') for name in hall.robots)
    expect(first).to_have_attribute("aria-current", "page")
    expect(first).to_contain_text("You hold control")
    expect(second).to_contain_text("Bob holds control")
    expect(page).to_have_title("panda-1 · Rolling Panda")
    two.controller = controller("ESTOP_LATCHED")
    hall.alarms["panda-2"] = reasons.robot_stopped(reasons.said("by Bob"))
    expect(second).to_contain_text("Stopped: by Bob")
    expect(second.locator(".robot-mode")).to_have_text("")
    expect(page.locator("rp-toasts")).to_contain_text("panda-2: Stopped: by Bob")
    # A hold ends with the choice of another robot, and that other robot is told nothing of it.
    open_screen(page, "drive")
    page.locator("#teleop").click()
    page.keyboard.down("KeyH")
    until(page, lambda: one.holds()[-1:] == [True])
    until(page, lambda: len(samples(page)) > 4)
    second.click()
    expect(second).to_have_attribute("aria-current", "page")
    expect(page.locator('[data-cut="p2"]')).to_be_visible()
    expect(page.locator('[data-cut="p1"]')).to_have_count(0)
    until(page, lambda: one.holds()[-1:] == [False])
    assert two.holds() == []
    until(page, lambda: len(samples(page)) > 0)
    assert min(samples(page)) >= 0, "the other robot's readings are no readings of this one"
    page.keyboard.up("KeyH")
    # What is pressed now is for the robot that is shown, except the stop.
    choose(page, "p2")
    page.keyboard.press("KeyA")
    until(page, lambda: any(path == "/api/points/p2/accept" for path, _ in two.posted))
    assert one.posted == []
    expect(page.locator("#stop")).to_contain_text("all robots")
    page.keyboard.press("Space")
    until(page, lambda: [stop["reason"] for stop in hall.stops] == ["space bar"])
    assert not one.stops() + two.stops()
    # On the way back the charts of the first one go on where they were left.
    first.click()
    expect(first).to_have_attribute("aria-current", "page")
    expect(page.locator("#mode")).to_have_attribute("data-mode", "READY")
    until(page, lambda: sum(at < 0 for at in samples(page)) > 4)
    times = samples(page)
    assert times == sorted(times)
    hall.online = False
    expect(page.locator("rp-robots")).to_have_class("panel stale")
    expect(second).to_be_visible()


@pytest.mark.long
def test_a_notice_of_another_robot_hides_none_of_them(pages: Page, hall: PlayedHall) -> None:
    page = pages
    hall.alarms["panda-2"] = reasons.robot_stopped(reasons.said("by Bob"))
    expect(page.locator("rp-toasts .toast")).to_be_visible()
    for width, height in ((1280, 800), (1024, 768), (844, 390), (390, 844)):
        page.set_viewport_size({"width": width, "height": height})
        toast, robots = (box_of(page.locator(part)) for part in ("rp-toasts .toast", "rp-robots ul"))
        assert toast["y"] >= robots["y"] + robots["height"], (width, height)
        assert toast["x"] >= 0 and toast["x"] + toast["width"] <= width


@pytest.mark.long
def test_the_picker_is_for_fingers_keys_and_those_who_do_not_see_it(pages: Page, hall: PlayedHall, axe: str) -> None:
    page, names = pages, list(hall.robots)
    hall.alarms["panda-2"] = reasons.robot_stopped(
        reasons.said("for a cause that goes on for longer than there is room for it")
    )
    expect(page.locator('[data-robot="panda-2"]')).to_contain_text("Stopped: for a cause")
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        assert grave(page, axe) == []
    for width, height in ((1024, 768), (1280, 800), (820, 1180), (390, 844)):
        page.set_viewport_size({"width": width, "height": height})
        boxes = [page.locator(f'[data-robot="{name}"]').bounding_box() for name in names]
        for box in boxes:
            assert box is not None and box["height"] >= 44 and box["x"] >= 0 and box["x"] + box["width"] <= width
        stop = page.locator("#stop").bounding_box()
        assert stop is not None and stop["width"] >= 100
        assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    page.locator('[data-robot="panda-1"]').focus()
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    expect(page).to_have_url(f"{ORIGIN}/robots/panda-2/")
