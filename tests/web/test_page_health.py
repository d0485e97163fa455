"""Charts of the last minutes and alarms, in a real browser with a server that the test plays."""

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import reasons
from rolling_panda.messages.supervision import CutReport, RefusalReport, SessionReport, StopState, VineReport
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer, bridge, controller, point

pytestmark = pytest.mark.browser


def shown(page: Page, chart: str) -> str:
    return page.locator(f'[data-chart="{chart}"] .chart-value').inner_text()


def inked(page: Page, chart: str) -> int:
    """How many pixels of a chart are drawn."""
    count = "each => each.getContext('2d').getImageData(0, 0, each.width, each.height).data.filter(Boolean).length"
    return int(page.locator(f'[data-chart="{chart}"] canvas').evaluate(count))


def test_charts_show_what_was_and_stand_still_when_told_to(page: Page, server: PlayedServer) -> None:
    page.wait_for_timeout(1200)
    server.controller = controller("AUTO", position_error=0.0123)
    page.locator('[data-opens="charts"]').click()
    expect(page.locator("#drawer")).to_be_focused()
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
    expect(page.locator(".drawer-tools .hint")).to_have_text("2 min ago")
    page.keyboard.press("Escape")
    expect(page.locator("#drawer")).to_be_hidden()
    expect(page.locator('[data-opens="charts"]')).to_be_focused()


def test_a_gap_is_a_gap_and_who_was_gone_is_seen(page: Page, server: PlayedServer) -> None:
    server.gone = {"perception": 5.0}
    page.locator('[data-opens="charts"]').click()
    until(page, lambda: shown(page, "presence") == "3 of 4")
    server.gone = {"bridge": 5.0}
    until(page, lambda: shown(page, "position-error") == "–")
    assert shown(page, "page-round-trip") != "–", "the page's own link is there"


def test_alarms_come_worst_first_with_what_to_do_and_go(page: Page, server: PlayedServer) -> None:
    expect(page.locator("#alarms .empty")).to_have_text("No alarms")
    server.points = (point(1, "UNKNOWN"),)
    server.tell(server.page_points())
    server.bridge = bridge(cutter="jammed", real_time_factor=0.5)
    server.controller = controller("FAULT", reason="the ledger cannot be written")
    rows = page.locator("#alarms li strong")
    expect(rows).to_have_text(
        [
            "Fault: the ledger cannot be written",
            "The cutter is jammed",
            "1 cut ended unknown",
            "The simulation is slower than real time",
        ]
    )
    expect(page.locator("#alarms li .act").nth(1)).to_contain_text("free the blades")
    expect(page.locator(".alarm-count")).to_have_text("4 alarms")
    server.bridge, server.controller, server.points = bridge(), controller(), ()
    server.tell(server.page_points())
    expect(page.locator("#alarms .empty")).to_be_visible(timeout=5000)
    expect(page.locator("#alarms li")).to_have_count(0)
    server.controller = controller("PAUSED", reason="nothing was heard from them for 1 s")
    expect(rows).to_have_text(["Paused: nothing was heard from them for 1 s"])
    expect(page.locator("#alarms li .act")).to_contain_text("press Resume, then Survey")


def test_a_plain_wire_is_said_in_red(page: Page, server: PlayedServer, monkeypatch: pytest.MonkeyPatch) -> None:
    usual = server.state
    monkeypatch.setattr(server, "state", lambda: msgspec.structs.replace(usual(), plain_wire=True))
    row = page.locator("#alarms li")
    expect(row).to_have_attribute("data-severity", "error")
    expect(row.locator("strong")).to_contain_text("every program on its machine can move it")
    expect(row.locator(".act")).to_contain_text("without --plain-wire")


def test_what_is_set_wider_than_usual_is_an_alarm_for_as_long_as_it_is(
    page: Page, server: PlayedServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = server.state
    line = "[bridge] deadline_s = 0.195, usually 0.19 (allowed: more than 0, at most 0.2)"
    monkeypatch.setattr(server, "state", lambda: msgspec.structs.replace(usual(), relaxed_limits=(line,)))
    expect(page.locator("#alarms li strong")).to_have_text([f"Set wider than usual: {line}"])
    expect(page.locator("#alarms li .act")).to_contain_text("have the configuration changed back")
    monkeypatch.setattr(server, "state", usual)
    expect(page.locator("#alarms .empty")).to_be_visible(timeout=5000)


def test_without_a_link_that_is_the_one_alarm_until_it_is_back(page: Page, server: PlayedServer) -> None:
    server.gone = {"controller": 3.0}
    expect(page.locator("#alarms strong")).to_contain_text(["controller gone"])
    server.online = False
    server.sockets[-1].close()
    expect(page.locator("#alarms strong")).to_have_text(["This page has no link to the server"], timeout=6000)
    expect(page.locator("rp-telemetry .stale-note")).to_contain_text("no link — last state")
    server.online, server.gone = True, {}
    expect(page.locator("#alarms .empty")).to_be_visible(timeout=10_000)
    expect(page.locator("rp-telemetry .stale-note")).to_be_hidden()


def test_what_the_page_itself_has_not_heard_is_no_alarm_of_a_process(page: Page, server: PlayedServer) -> None:
    server.heard_s = 0.8
    page.wait_for_timeout(300)
    page.evaluate("""() => {
      const list = document.querySelector("#alarms");
      window.alarmed = "";
      const looking = new MutationObserver(() => (window.alarmed += list.textContent));
      looking.observe(list, { childList: true, subtree: true });
    }""")
    server.silent = True
    expect(page.locator("#alarms strong").first).to_have_text("The server is silent", timeout=6000)
    assert "gone" not in page.evaluate("alarmed")
    server.silent, server.heard_s = False, 0.03
    expect(page.locator("#alarms .empty")).to_be_visible(timeout=10_000)


def test_the_report_tells_cuts_by_outcome_and_vine_and_what_was_refused(page: Page, server: PlayedServer) -> None:
    page.locator('[data-opens="report"]').click()
    expect(page.locator("rp-report")).to_contain_text("Nothing has been cut yet.")
    cuts = [CutReport(cut_id="c1", point_id="p1", vine=1, spur=1, outcome="DONE", ended_at=2e9, seconds=3.0)]
    cuts.append(CutReport(cut_id="c2", point_id="p2", vine=1, spur=2, outcome="UNKNOWN", ended_at=2e9, seconds=5.0))
    server.report = SessionReport(
        began_at=1.9e9,
        written_at=2e9,
        cuts=tuple(cuts),
        cut_count=2,
        vines=(VineReport(vine=1, done=1, unknown=1, seconds=8.0),),
        refusals=(RefusalReport(at=2e9, user="Bob", asked="Start", reason=reasons.control_held("Ada")),),
        refusal_count=1,
    )
    page.keyboard.press("Escape")
    page.locator('[data-opens="report"]').click()
    expect(page.locator(".sums dd")).to_have_text(["1", "0", "1", "0", "4.0", "1", "1"])
    expect(page.locator("rp-report tbody tr")).to_have_count(4)
    expect(page.locator("rp-report")).to_contain_text("Ada holds control")
    expect(page.locator('a[download="cuts.csv"]')).to_have_attribute("href", "api/report.csv")


def test_the_robots_own_button_and_a_joint_at_its_limit_are_alarms(page: Page, server: PlayedServer) -> None:
    server.stopped = (StopState(process="bridge", stops=(), hardware=True),)
    server.controller = msgspec.structs.replace(controller(), joint_margin=0.02, manipulability=0.01)
    expect(page.locator("#alarms li strong")).to_have_text(
        [
            "The emergency stop on the robot is pressed",
            "A joint of the arm is near its limit",
            "The arm is nearly stretched out",
        ]
    )
