"""Every state that the operator's page has, and how a played server brings it there: for tests, and for pictures."""

import time
from collections.abc import Callable
from typing import get_args

import msgspec
import segno
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages import page as p
from rolling_panda.messages.supervision import (
    ControlReport,
    CutReport,
    PreviewState,
    RefusalReport,
    ReplayState,
    SessionReport,
    StopRecord,
    StopState,
    Timeline,
    VineReport,
)
from rolling_panda.reasons import said
from rolling_panda.timeline import TimelineBuilder
from server.api.responses import outcome
from tests.support.page_parts import (
    accepted,
    choose,
    guyot_vine,
    held,
    looking_at,
    mark,
    open_screen,
    planned,
    queue,
    ready,
    show,
    show_mode,
    working,
)
from tests.support.played_server import PlayedServer, bridge, controller, cut_picture, point
from tests.support.points import rolled_out

State = Callable[[Page, PlayedServer], None]
#: When the report's morning was (s since 1970).
MORNING = 1_763_800_000.0


# --- nothing yet, nothing there --------------------------------------------------------------------------------------


def _starting(page: Page, server: PlayedServer) -> None:
    server.controller = server.bridge = None
    server.gone = {"bridge": 4.0, "controller": 4.0, "perception": 4.0}
    server.rule, server.image = None, b""
    show(server)
    page.reload()
    expect(page.locator("#mode")).to_have_attribute("data-mode", "")


def _no_points(page: Page, server: PlayedServer) -> None:
    show_mode(page, server, controller("IDLE", reason=reasons.controller_started()))
    server.undecided_sites = ()
    show(server)
    open_screen(page, "review")
    expect(page.locator(".strip-mark")).to_have_count(0)


def _process_lost(page: Page, server: PlayedServer) -> None:
    working(page, server)
    open_screen(page, "review")
    server.gone = {"controller": 6.0}
    expect(page.locator("rp-review.stale .stale-note")).not_to_be_empty()


def _link_lost(page: Page, server: PlayedServer) -> None:
    working(page, server)
    server.online = False
    server.sockets[-1].close()
    expect(page.locator("rp-link-banner")).to_be_visible()


def _signed_out(page: Page, server: PlayedServer) -> None:
    working(page, server)
    server.answers["/api/me"] = (401, {"detail": "sign in first"})
    server.sockets[-1].close(code=4401, reason="signed out")
    expect(page.locator("rp-link-banner")).to_be_visible()


# --- points ----------------------------------------------------------------------------------------------------------


def _points(page: Page, server: PlayedServer) -> None:
    working(page, server)
    choose(page, "p3")


def _all_states(page: Page, server: PlayedServer) -> None:
    states = enumerate(get_args(m.PointState), 1)
    show_mode(page, server, ready())
    show(server, *(point(number, state, spur=number) for number, state in states))
    choose(page, "p1")


def _refused_plan(page: Page, server: PlayedServer) -> None:
    working(page, server)
    reason = reasons.no_clear_posture(reasons.too_near("at the cut", 4.0, "blades", "wire 2", 7.0))
    refused = planned(point(2, "UNREACHABLE", spur=2, user="Ada", reason=reason), 0, reason)
    show(server, queue()[0], refused, *queue()[2:])
    choose(page, "p2")


def _rule(page: Page, server: PlayedServer) -> None:
    working(page, server)
    server.rule = m.PruningRule(system="guyot")
    server.tell(server.page_points())
    server.answers["/api/rule/what-if"] = (200, outcome(True, reasons.rule_effect(17, 3, 5, 4)))
    open_screen(page, "review")
    page.locator("rp-rule summary").click()
    expect(page.locator("rp-rule input").first).to_be_visible()
    if server.role != "viewer":
        page.locator("#rule-offset").press("ArrowRight")
        expect(page.locator("#rule-apply")).to_be_enabled()


def _guyot(page: Page, server: PlayedServer) -> None:
    working(page, server)
    server.rule = m.PruningRule(system="guyot")
    show(server, *guyot_vine())
    choose(page, "p3")
    page.locator(".adjust summary").click()
    expect(page.locator("rp-adjust .moves")).to_be_visible()


def _order(page: Page, server: PlayedServer) -> None:
    show_mode(page, server, ready(order=m.QueueOrder(7, "Bob")))
    show(server, *(accepted(number, number) for number in range(1, 6)))
    open_screen(page, "review")
    page.locator("rp-order summary").click()
    expect(page.locator(".order-row").first).to_be_visible()
    page.locator(".order-row").nth(1).click()


def _why_rejected(page: Page, server: PlayedServer) -> None:
    working(page, server)
    open_screen(page, "review")
    choose(page, "p3")
    page.locator("#review-leave").click()
    expect(page.locator("#reject-reason")).to_be_visible()


def _by_hand(page: Page, server: PlayedServer) -> None:
    working(page, server)
    open_screen(page, "review")
    page.locator("#add-by-hand").click()
    expect(page.locator("rp-placing")).to_be_visible()


def _places(page: Page, server: PlayedServer) -> None:
    working(page, server)
    where = (1.4, 0.8, 0.9)
    server.undecided_sites = (
        m.UndecidedSite(reasons.nodes_lacking(0, 2), "another look", 3, 1, where),
        m.UndecidedSite(reasons.cane_base_hidden(), "another look", 3, 2, where),
        m.UndecidedSite(reasons.wire_near_cut(6.0), "operator", 3, 4, where),
    )
    server.tell(server.page_points())
    open_screen(page, "review")
    mark(page, "place-3-1").click()
    looking_at(page, "place-3-1")
    expect(page.locator("#look-again")).to_be_visible()


def _unknown_cut(page: Page, server: PlayedServer) -> None:
    unknown = point(1, "UNKNOWN", cut_id="c1", user="Ada", reason="the bridge went silent while the blades closed")
    show_mode(page, server, ready())
    show(server, unknown, *queue()[1:])
    choose(page, "p1")


# --- the robot moves -------------------------------------------------------------------------------------------------


def _running(page: Page, server: PlayedServer) -> None:
    working(page, server)
    state = controller("AUTO", phase="APPROACH", active_point_id="p1", reason=reasons.command_by("Start", "Ada"))
    show_mode(page, server, msgspec.structs.replace(state, joint_margin=0.05, position_error=0.02))


def _survey(page: Page, server: PlayedServer) -> None:
    working(page, server)
    show_mode(page, server, controller("AUTO", phase="SURVEY", reason=reasons.command_by("Survey", "Ada")))


def _paused(page: Page, server: PlayedServer) -> None:
    working(page, server)
    show_mode(page, server, controller("PAUSED", reason=reasons.unwatched(2.0, 1.5)))


def _whole_vine(page: Page, server: PlayedServer) -> None:
    _places(page, server)
    page.locator("#open-vine").click()
    expect(page.locator("rp-vine-sheet .vine-card").first).to_be_visible()


def _preview(page: Page, server: PlayedServer) -> None:
    working(page, server)
    cuts = tuple(
        rolled_out(
            f"p{number}", 4, begins_s=5.0 * number - 5.0, cut_s=5.0 * number - 2.0, ends_s=5.0 * number,
            clearance=0.08 - 0.009 * number,
        )
        for number in (1, 2)
    )  # fmt: skip
    state = PreviewState(
        header=m.Header(), required=True, phase="ready", preview_hash="ab" * 32, duration_s=10.0, cuts=cuts
    )
    server.tell(p.PagePreview(preview=state))
    page.locator("#show-preview").click()
    page.locator("#preview-time").fill("6.2")
    expect(page.locator(".preview-words")).to_contain_text("2: ")


def _preview_expired(page: Page, server: PlayedServer) -> None:
    _preview(page, server)
    state = PreviewState(
        header=m.Header(), required=True, phase="expired", preview_hash="ab" * 32, duration_s=10.0,
        reason=reasons.rule_undone("Bob"),
    )  # fmt: skip
    server.tell(p.PagePreview(preview=state))
    expect(page.locator("rp-preview")).to_have_attribute("data-phase", "expired")


def _by_hand_tool(page: Page, server: PlayedServer) -> None:
    working(page, server)
    open_screen(page, "drive")
    page.locator("#teleop").click()
    expect(page.locator('[data-choice="world"]')).to_be_visible()


def _by_hand_base(page: Page, server: PlayedServer) -> None:
    _by_hand_tool(page, server)
    page.locator('[data-choice="base"]').first.click()
    expect(page.locator("rp-drive-pad")).to_be_visible()


def _by_hand_joints(page: Page, server: PlayedServer) -> None:
    _by_hand_tool(page, server)
    page.locator('[data-choice="joints"]').click()
    expect(page.locator("rp-joints")).to_be_visible()


def _held_back(page: Page, server: PlayedServer) -> None:
    _by_hand_tool(page, server)
    near = m.Proximity(0.021, "blades – wire 3")
    server.controller = controller("TELEOP", limited_by="link6 – cane 2, vine 1, spur 3", proximity=near)
    page.locator("#hold").dispatch_event("pointerdown", {"button": 0, "isPrimary": True, "pointerId": 1})
    expect(page.locator("#hold.held")).to_be_visible()


# --- stops and alarms ------------------------------------------------------------------------------------------------


def _stop_pressed(page: Page, server: PlayedServer) -> None:
    working(page, server)
    page.locator("#stop").click()
    expect(page.locator('rp-stop-banner [data-acknowledged="false"]').first).to_be_visible()


def _stopped(page: Page, server: PlayedServer) -> None:
    working(page, server)
    records = tuple(
        StopRecord(
            stop_id=f"s{number}",
            source="server",
            user=user,
            reason=said("stop button"),
            wall_time=MORNING - 60 * number,
        )
        for number, user in ((1, "Ada"), (2, "Bob"))
    )
    server.stopped = (StopState(process="bridge", stops=records), StopState(process="controller", stops=records))
    server.bridge = bridge(stop_id="s1", stopped_by=reasons.software_stop("Ada", said("stop button")))
    show_mode(page, server, controller("ESTOP_LATCHED", reason=reasons.software_stop("Ada", said("stop button"))))
    expect(page.locator("rp-stop-banner")).to_be_visible()


def _fault(page: Page, server: PlayedServer) -> None:
    working(page, server)
    state = controller("FAULT", reason=reasons.ledger_silent(6.0))
    show_mode(page, server, msgspec.structs.replace(state, allowed={"Acknowledge": None}))


def _alarms(page: Page, server: PlayedServer) -> None:
    working(page, server)
    show(server, point(1, "UNKNOWN"), *queue()[1:])
    server.bridge = bridge(cutter="jammed", real_time_factor=0.5)
    show_mode(page, server, controller("PROTECTIVE_STOP", reason=reasons.tracking_error("joint 4", 0.21, 0.15)))
    expect(page.locator("#alarms li")).to_have_count(4)


# --- people ----------------------------------------------------------------------------------------------------------


def _asked_for_control(page: Page, server: PlayedServer) -> None:
    working(page, server)
    server.control = held("me", "Ada", requested_by="Bob", requested_key="other")
    expect(page.locator("#grant-control")).to_be_visible()


def _other_has_control(page: Page, server: PlayedServer) -> None:
    working(page, server)
    server.control = held("other", "Bob", requested_by="Ada", requested_key="me")
    expect(page.locator("#request-control")).to_have_attribute("aria-disabled", "true")


def _viewer(page: Page, server: PlayedServer) -> None:
    working(page, server)
    server.role = "viewer"
    server.control = held("other", "Bob")
    expect(page.locator("rp-invite")).to_be_hidden()


def _invite(page: Page, server: PlayedServer) -> None:
    working(page, server)
    link = "http://127.0.0.1:8000/sign-in?token=1s0n1y-4n-3x4mp13"
    rows = ["".join(str(module) for module in row) for row in segno.make_qr(link).matrix]
    server.answers["/api/invite"] = (200, {"ok": True, "reason": "", "link": link, "qr": rows})
    page.locator("#person").click()
    page.locator("#invite").click()
    page.locator("#invite-user").fill("Bob")
    page.locator("#invite-make").click()
    expect(page.locator("#invite-link")).to_be_visible()


def _settings(page: Page, server: PlayedServer) -> None:
    working(page, server)
    page.locator("#person").click()
    page.locator("#open-settings").click()
    expect(page.locator("#settings")).to_be_visible()


def _help(page: Page, server: PlayedServer) -> None:
    working(page, server)
    page.keyboard.press("?")
    expect(page.locator("#help")).to_be_visible()


def _refused(page: Page, server: PlayedServer) -> None:
    working(page, server)
    server.answers["/api/points/p3/accept"] = (409, outcome(False, reasons.point_revised("p3", 1, 2)))
    open_screen(page, "review")
    choose(page, "p3")
    page.locator("#review-accept").click()
    expect(page.locator(".toast")).to_be_visible()


def a_timeline(began: float = MORNING) -> Timeline:
    """Ten minutes of work with cuts, a pause, a stop and a refusal."""
    lines: list[tuple[float, m.Reason]] = [
        (5.0, reasons.mode_changed("IDLE", "READY", reasons.command_by("Arm", "Ada"))),
        (40.0, reasons.command_refused("Bob", "start", reasons.control_held("Ada"))),
        (60.0, reasons.mode_changed("READY", "AUTO", reasons.command_by("Start", "Ada"))),
        *((70.0 + 12.0 * n, reasons.cut_done(f"p{n}", reasons.cut_and_gone())) for n in range(12)),
        (220.0, reasons.cut_ended("p20", reasons.stands_not_cut(reasons.cutter_missed()))),
        (230.0, reasons.robot_halted("AUTO", "PAUSED", said("a person beside the row"))),
        (300.0, reasons.mode_changed("PAUSED", "READY", reasons.command_by("Resume", "Ada"))),
        (310.0, reasons.mode_changed("READY", "AUTO", reasons.command_by("Start", "Ada"))),
        *((325.0 + 14.0 * n, reasons.cut_done(f"p{30 + n}", reasons.cut_and_gone())) for n in range(8)),
        (450.0, reasons.robot_halted("AUTO", "ESTOP_LATCHED", said("stop button"))),
        (520.0, reasons.mode_changed("ESTOP_LATCHED", "IDLE", reasons.command_by("Reset", "Ada"))),
    ]
    builder = TimelineBuilder()
    for at, reason in lines:
        builder.add(began + at, m.LogEvent(header=m.Header(), process="controller", reason=reason))
    return builder.timeline(began, began + 600.0)


def _replay(page: Page, server: PlayedServer) -> None:
    working(page, server)
    server.timeline = a_timeline()
    server.replay = ReplayState(name="row.mcap", begins_at=MORNING, duration_s=600.0, position_s=150.0, playing=True)
    expect(page.locator("rp-replay .time-mark").first).to_be_visible()


# --- sheets ----------------------------------------------------------------------------------------------------------


def _charts(page: Page, server: PlayedServer) -> None:
    working(page, server)
    open_screen(page, "engineer")
    expect(page.locator("rp-charts")).to_be_visible()


def _empty_report(page: Page, server: PlayedServer) -> None:
    working(page, server)
    open_screen(page, "report")
    expect(page.locator("rp-report [role=status]").nth(1)).not_to_be_empty()


def _report(page: Page, server: PlayedServer) -> None:
    working(page, server)
    outcomes: tuple[m.Outcome, ...] = ("DONE", "DONE", "FAILED_NOT_CUT", "DONE", "UNKNOWN")
    why: dict[m.Outcome, m.Reason] = {
        "DONE": reasons.cut_and_gone(),
        "FAILED_NOT_CUT": reasons.stands_not_cut(reasons.cutter_missed()),
        "UNKNOWN": reasons.interrupted(),
    }
    began = time.time() - 600.0
    server.timeline = a_timeline(began)
    for number, ended in enumerate(outcomes[:4], 1):
        server.cut_pictures[f"c{number}", "before"] = cut_picture(False)
        server.cut_pictures[f"c{number}", "after"] = cut_picture(ended == "DONE")
    cuts = tuple(
        CutReport(
            cut_id=f"c{number}", point_id=f"p{number}", vine=1 + number // 4, spur=1 + number % 4, outcome=outcome,
            reason=why[outcome], user="Ada", ended_at=began + 60.0 + 5.0 * number, seconds=3.2 + 0.3 * number,
            wrong_by="Bob" if number == 2 else "",
        )
        for number, outcome in enumerate(outcomes, 1)
    )  # fmt: skip
    server.report = SessionReport(
        began_at=began,
        written_at=began + 600.0,
        cuts=cuts,
        cut_count=len(cuts),
        vines=(VineReport(vine=1, done=2, not_cut=1, seconds=11.4), VineReport(vine=2, done=1, unknown=1, seconds=9.1)),
        refusals=(RefusalReport(at=began + 70.0, user="Bob", asked="Start", reason=reasons.control_held("Ada")),),
        refusal_count=1,
        control=(ControlReport(at=began + 5.0, user="Ada", asked="TakeControl"),),
    )
    open_screen(page, "report")
    expect(page.locator("rp-report .cut-card").first).to_be_visible()


#: By name, in the order of a morning's work.
STATES: dict[str, State] = {
    "starting": _starting,
    "no-points": _no_points,
    "points": _points,
    "all-states": _all_states,
    "refused-plan": _refused_plan,
    "rule": _rule,
    "guyot": _guyot,
    "order": _order,
    "why-rejected": _why_rejected,
    "by-hand": _by_hand,
    "places": _places,
    "whole-vine": _whole_vine,
    "preview": _preview,
    "preview-expired": _preview_expired,
    "running": _running,
    "survey": _survey,
    "paused": _paused,
    "unknown-cut": _unknown_cut,
    "teleoperate-tool": _by_hand_tool,
    "teleoperate-base": _by_hand_base,
    "teleoperate-joints": _by_hand_joints,
    "held-back": _held_back,
    "stop-pressed": _stop_pressed,
    "stopped": _stopped,
    "fault": _fault,
    "alarms": _alarms,
    "asked-for-control": _asked_for_control,
    "other-has-control": _other_has_control,
    "viewer": _viewer,
    "invite": _invite,
    "settings": _settings,
    "help": _help,
    "refused": _refused,
    "process-lost": _process_lost,
    "link-lost": _link_lost,
    "signed-out": _signed_out,
    "charts": _charts,
    "report-empty": _empty_report,
    "report": _report,
    "replay": _replay,
}
