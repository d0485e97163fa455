"""Charts of the last minutes and alarms, in a real browser with a server that the test plays."""

from typing import Any

import pytest
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CameraMount, CameraState
from rolling_panda.messages.supervision import StopState
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer, bridge, controller, point

pytestmark = pytest.mark.browser


@pytest.fixture
def screen() -> str:
    return "engineer"


def shown(page: Page, chart: str) -> str:
    return page.locator(f'[data-chart="{chart}"] .chart-value').inner_text().replace("\u00a0", " ")


def inked(page: Page, chart: str) -> int:
    """How many pixels of a chart are drawn."""
    count = "each => each.getContext('2d').getImageData(0, 0, each.width, each.height).data.filter(Boolean).length"
    return int(page.locator(f'[data-chart="{chart}"] canvas').evaluate(count))


def codes(page: Page) -> list[str]:
    """The alarms, from the top."""
    return page.locator("#alarms li").evaluate_all("rows => rows.map(row => row.dataset.code)")


@pytest.mark.long
def test_charts_show_what_was_and_stand_still_when_told_to(page: Page, server: PlayedServer) -> None:
    page.wait_for_timeout(1200)
    server.controller = controller("AUTO", position_error=0.0123)
    until(page, lambda: shown(page, "position-error") == "12.3 mm")
    assert shown(page, "arm-speed") == "50 %" and shown(page, "wheel-speed") == "20 %"
    assert shown(page, "presence") == "4 of 4"
    assert inked(page, "position-error") > 0 and inked(page, "presence") > 0
    canvas = page.locator('[data-chart="position-error"] canvas')
    expect(canvas).to_have_attribute("aria-label", "Tool error: 12.3 mm, beyond its limit")
    page.locator("#pause-charts").click()
    server.controller = controller("AUTO", position_error=0.0031)
    page.wait_for_timeout(700)
    assert shown(page, "position-error") == "12.3 mm", "it was paused"
    page.locator("#pause-charts").click()
    until(page, lambda: shown(page, "position-error") == "3.1 mm")
    # A moment in the past, by keys and by pointing; outside of what was seen there is nothing.
    box = box_of(canvas)
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 10)
    until(page, lambda: shown(page, "position-error") == "–")
    expect(page.get_by_text("2 min ago")).to_be_visible()


def test_a_gap_is_a_gap_and_who_was_gone_is_seen(page: Page, server: PlayedServer) -> None:
    server.gone = {"perception": 5.0}
    until(page, lambda: shown(page, "presence") == "3 of 4")
    server.gone = {"bridge": 5.0}
    until(page, lambda: shown(page, "position-error") == "–")
    assert shown(page, "page-round-trip") != "–", "the page's own link is there"


def test_alarms_come_worst_first_with_what_to_do_and_go(page: Page, server: PlayedServer) -> None:
    expect(page.locator("#alarms")).to_be_hidden()
    server.points = (point(1, "UNKNOWN"),)
    server.tell(server.page_points())
    server.bridge = bridge(cutter="jammed", real_time_factor=0.5)
    server.controller = controller("FAULT", reason="the ledger cannot be written")
    expect(page.locator("#alarms li")).to_have_count(4)
    assert codes(page) == ["cutter_jammed", "mode_fault", "cuts_unknown", "simulation_slow"]
    rows = page.locator("#alarms li strong")
    expect(rows.nth(1)).to_have_text("Fault: the ledger cannot be written")
    expect(page.locator("#alarms li .act").first).to_contain_text("free the blades")
    expect(page.locator("#alarms li:visible")).to_have_count(1)
    page.locator("#more-alarms").click()
    expect(page.locator("#alarms li:visible")).to_have_count(4)
    page.locator("#more-alarms").click()
    server.bridge, server.controller, server.points = bridge(), controller(), ()
    server.tell(server.page_points())
    expect(page.locator("#alarms")).to_be_hidden(timeout=5000)
    expect(page.locator("#alarms li")).to_have_count(0)
    server.controller = controller("PAUSED", reason="nothing was heard from them for 1 s")
    expect(rows).to_have_text(["Paused: nothing was heard from them for 1 s"])
    expect(page.locator("#alarms li .act")).to_have_attribute("data-steps", "press_resume press_survey")


RELAXED = (reasons.limit_raised("[bridge] deadline_s", 0.195, 0.19, 0.2), reasons.safeguard_off("[controller] x"))
#: A state in which each alarm is present; a stop, the link and the server have tests of their own.
STATES: dict[str, dict[str, Any]] = {
    "bridge_gone": {"gone": {"bridge": 3.0}},
    "controller_gone": {"gone": {"controller": 3.0}},
    "perception_gone": {"gone": {"perception": 3.0}},
    "emergency_stop_pressed": {"stopped": (StopState(process="bridge", stops=(), hardware=True),)},
    "mode_protective_stop": {"controller": controller("PROTECTIVE_STOP")},
    "mode_fault": {"controller": controller("FAULT")},
    "mode_paused": {"controller": controller("PAUSED")},
    "work_waits": {"controller": controller(interrupted="work")},
    "commands_missing": {"controller": controller("AUTO"), "bridge": bridge(watchdog=True)},
    "cutter_jammed": {"bridge": bridge(cutter="jammed")},
    "simulation_slow": {"bridge": bridge(real_time_factor=0.5)},
    "control_late": {"controller": controller(ticks=2000, late_ticks=90)},
    "joint_near_limit": {"controller": controller(joint_margin=0.02)},
    "arm_stretched": {"controller": controller(manipulability=0.01)},
    "wire_plain": {"plain_wire": True},
    "limits_relaxed": {"relaxed_limits": RELAXED},
    **{
        old.code: {"bridge": bridge(calibration_warnings=(old,))}
        for old in (
            reasons.base_calibration_old(91.0),
            reasons.arm_calibration_old(91.0),
            reasons.timing_calibration_old(91.0),
        )
    },
    "cuts_unknown": {"points": (point(1, "UNKNOWN"),)},
}


def test_each_alarm_comes_with_its_state_and_goes(page: Page, server: PlayedServer, subtests: pytest.Subtests) -> None:
    usual = PlayedServer(points=(point(1, "ACCEPTED"),))
    for code, changes in STATES.items():
        with subtests.test(code):
            for name in ("gone", "stopped", "controller", "bridge", "points", "plain_wire", "relaxed_limits"):
                setattr(server, name, changes.get(name, getattr(usual, name)))
            server.tell(server.page_points())
            row = page.locator("#alarms li:not(.gone)")
            expect(row.and_(page.locator(f'[data-code="{code}"]'))).to_be_attached()
            if (more := page.locator('#more-alarms[aria-expanded="false"]')).is_visible():
                more.click()
            expect(row.and_(page.locator(f'[data-code="{code}"]'))).to_be_visible()
            expect(row).to_have_count(1)
            expect(row).to_have_attribute("data-severity", reasons.CATALOGUE[code].severity)
            if act := reasons.CATALOGUE[code].act:
                expect(row.locator(".act")).to_contain_text(act[1:])


def test_what_halts_the_work_comes_before_what_stands_as_long_as_the_program_runs(
    page: Page, server: PlayedServer
) -> None:
    server.plain_wire = True
    visible = page.locator("#alarms li:not(.gone):visible")
    expect(visible).to_have_attribute("data-code", "wire_plain")
    server.controller = controller("PAUSED")
    expect(visible).to_have_attribute("data-code", "mode_paused")
    expect(page.locator("#more-alarms")).to_be_visible()


@pytest.mark.long
def test_a_camera_that_is_found_turned_is_told_and_its_correction_is_a_press_away(
    page: Page, server: PlayedServer
) -> None:
    offer = CameraMount(position=(0.0, -0.07, 0.04), quat_xyzw=(0.0, 0.0, 0.0, 1.0), source="work", made_at=1.8e9)
    told = CameraState(header=m.Header(), offer=offer, warning=reasons.camera_looks_left(0.6, 0.2))
    server.controller, server.camera = controller("AUTO"), told
    row = page.locator('#alarms [data-code="camera_looks_left"]')
    expect(row).to_be_visible()
    expect(row).to_contain_text("0.6° (± 0.2°) to the left")
    expect(row.locator(".act")).to_contain_text("Pause")
    expect(row.locator(".alarm-press")).to_be_hidden()
    server.controller = controller("READY")
    row.locator(".alarm-press").click()
    until(page, lambda: ("/api/camera/use", {"made_at": 1.8e9}) in server.posted)
    server.camera = CameraState(header=m.Header(), mount=offer)
    expect(row).to_have_count(0)


def test_every_limit_that_is_set_wider_than_usual_is_told(page: Page, server: PlayedServer) -> None:
    server.relaxed_limits = RELAXED
    for each in RELAXED:
        expect(page.locator('#alarms [data-code="limits_relaxed"] strong')).to_contain_text(reasons.text_of(each))


@pytest.mark.long
def test_without_a_link_that_is_the_one_alarm_until_it_is_back(page: Page, server: PlayedServer) -> None:
    server.gone = {"controller": 3.0}
    expect(page.locator('#alarms li[data-code="controller_gone"]')).to_be_visible()
    server.online = False
    server.sockets[-1].close()
    expect(page.locator("rp-link-banner")).to_be_visible(timeout=6000)
    expect(page.locator("#alarms li:not(.gone)")).to_have_count(0)
    expect(page.locator("rp-telemetry .stale-note")).to_contain_text("no link — last state")
    server.online, server.gone = True, {}
    expect(page.locator("#alarms")).to_be_hidden(timeout=10_000)
    expect(page.locator("rp-telemetry .stale-note")).to_be_hidden()


@pytest.mark.long
def test_what_the_page_itself_has_not_heard_is_no_alarm_of_a_process(page: Page, server: PlayedServer) -> None:
    server.heard_s = 0.8
    page.wait_for_timeout(300)
    page.evaluate("""() => {
      const list = document.querySelector("#alarms");
      window.alarmed = [];
      const note = () => list.querySelectorAll("li").forEach(row => window.alarmed.push(row.dataset.code));
      const looking = new MutationObserver(note);
      looking.observe(list, { childList: true, subtree: true });
    }""")
    server.silent = True
    expect(page.locator("#alarms li").first).to_have_attribute("data-code", "server_silent", timeout=6000)
    assert set(page.evaluate("alarmed")) == {"server_silent"}
    server.silent, server.heard_s = False, 0.03
    expect(page.locator("#alarms")).to_be_hidden(timeout=10_000)
