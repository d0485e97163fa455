"""Advice names the button that is the next step: what the alarm of each state says, and that it can be pressed."""

from dataclasses import dataclass, field
from typing import Any

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages import page as page_messages
from rolling_panda.messages import types as types_messages
from rolling_panda.messages.supervision import ControlState, PreviewState
from rolling_panda.reasons import text_of
from tests.support.page_parts import held, show
from tests.support.played_page import until
from tests.support.played_server import PlayedServer, controller, point

pytestmark = pytest.mark.browser

WAITS, TAKEN = point(1, "PROPOSED"), point(1, "ACCEPTED", user="Ada")
MINE, THEIRS = held("me", "Ada"), held("other", "Bob")


def needed(phase: str) -> PreviewState:
    return PreviewState(header=m.Header(), required=True, phase=phase, preview_hash="ab" * 32, duration_s=9.0)


def mode(name: m.Mode, interrupted: str = "", **changes: Any) -> m.ControllerState:
    state = controller(name, interrupted=interrupted, **changes)
    if name == "READY":
        return msgspec.structs.replace(state, allowed=state.allowed | {"Survey": None})
    return state


NO_PREVIEW = PreviewState(header=m.Header(), required=False, phase="none")


@dataclass
class Case:
    """A state of the robot and of this page; the steps of its alarm, and the button that comes first."""

    controller: m.ControllerState
    steps: str
    button: str = ""
    points: tuple[page_messages.PagePoint, ...] = (TAKEN,)
    role: types_messages.Role = "supervisor"
    control: ControlState | None = field(default_factory=lambda: MINE)
    preview: PreviewState | None = None


CASES = {
    "work": Case(mode("PAUSED", "work"), "resume_work", "#to-continue"),
    "work, nothing accepted": Case(mode("PAUSED", "work"), "press_resume accept_start", "#resume", points=(WAITS,)),
    "work, nothing found": Case(mode("PAUSED", "work"), "press_resume press_survey", "#resume", points=()),
    "survey": Case(mode("PAUSED", "survey"), "resume_survey", "#to-continue", points=(WAITS,)),
    "teleoperation": Case(mode("PAUSED", "teleoperation"), "press_resume hold_again", "#resume"),
    "preview wanted": Case(mode("PAUSED", "work"), "press_resume preview_start", "#resume", preview=needed("none")),
    "preview shown": Case(mode("PAUSED", "work"), "press_resume approve_start", "#resume", preview=needed("ready")),
    "preview approved": Case(mode("PAUSED", "work"), "resume_work", "#to-continue", preview=needed("approved")),
    "somebody else's": Case(mode("PAUSED", "work"), "control_held resume_work", "#request-control", control=THEIRS),
    "nobody's": Case(mode("PAUSED", "work"), "resume_work", "#to-continue", control=None),
    "looking on": Case(mode("PAUSED", "survey"), "ask_operator", role="viewer"),
    "resumed": Case(mode("READY", "work"), "press_start", "#start"),
    "resumed, preview shown": Case(mode("READY", "work"), "approve_start", preview=needed("ready")),
    "protective stop, cause there": Case(mode("PROTECTIVE_STOP", "work"), "mend_cause acknowledge_resume"),
    "protective stop, cause gone": Case(
        mode("PROTECTIVE_STOP", "work", allowed={"Acknowledge": None}), "cause_gone acknowledge_resume", "#acknowledge"
    ),
    "fault": Case(mode("FAULT", allowed={"Acknowledge": None}), "cause_gone acknowledge_arm", "#acknowledge"),
    "fault, an operator's page": Case(
        mode("FAULT", allowed={"Acknowledge": None}), "cause_gone supervisor_acknowledges", role="operator"
    ),
    "stopped": Case(mode("ESTOP_LATCHED"), "check_row press_reset"),
    "stopped, an operator's page": Case(mode("ESTOP_LATCHED"), "check_row supervisor_resets", role="operator"),
    "joint at its limit, ready": Case(mode("READY", joint_margin=0.02), "press_home", "#home"),
    "joint at its limit, idle": Case(mode("IDLE", joint_margin=0.02), "arm_and_home", "#arm"),
    "joint at its limit, at work": Case(mode("AUTO", joint_margin=0.02), "robot_leads_back", "#pause"),
    "joint at its limit, by hand": Case(mode("TELEOP", joint_margin=0.02), "lead_back"),
}


@pytest.mark.long
def test_the_first_button_that_advice_names_can_be_pressed(
    page: Page, server: PlayedServer, subtests: pytest.Subtests
) -> None:
    before = ""
    for name, case in CASES.items():
        assert case.steps != before, "what is left of the case before would be taken for this one's"
        before = case.steps
        with subtests.test(name):
            server.controller, server.role, server.control = case.controller, case.role, case.control
            show(server, *case.points)
            server.tell(page_messages.PagePreview(preview=case.preview or NO_PREVIEW))
            act = page.locator("#alarms li:not(.gone) .act, rp-stop-banner:visible .act")
            expect(act).to_have_count(1)
            expect(act).to_have_attribute("data-steps", case.steps)
            for step in case.steps.split():
                expect(act).to_contain_text(reasons.CATALOGUE[step].text.format(user="Bob"))
            if case.button:
                expect(page.locator(case.button)).to_have_attribute("aria-disabled", "false")


@pytest.mark.long
def test_once_resume_is_pressed_nothing_advises_to_press_it(page: Page, server: PlayedServer) -> None:
    server.controller = mode("PAUSED", "teleoperation")
    show(server, WAITS)
    expect(page.locator("#alarms .act")).to_have_attribute("data-steps", "press_resume hold_again")
    server.controller = mode("READY", "teleoperation")
    expect(page.locator("#resume")).to_have_attribute("aria-disabled", "true")
    expect(page.locator("#alarms .act:visible")).to_have_count(0, timeout=1000)
    server.controller = mode("AUTO", phase="SURVEY")
    expect(page.locator("#alarms")).to_be_hidden()
    expect(page.locator("#alarms li")).to_have_count(0)


@pytest.mark.long
def test_a_robot_that_stands_for_a_picture_tells_so_and_asks_for_nothing(page: Page, server: PlayedServer) -> None:
    server.controller = mode("AUTO", phase="APPROACH", reason=reasons.waits_for_picture(6.0))
    show(server, TAKEN)
    expect(page.locator("#alarms li:not(.gone)")).to_contain_text("until a newer camera frame comes")
    expect(page.locator("#alarms .act:visible")).to_have_count(0)
    expect(page.locator("#pause")).to_have_attribute("aria-disabled", "false")
    server.controller = mode("AUTO", phase="APPROACH")
    show(server, TAKEN)
    expect(page.locator("#alarms")).to_be_hidden()


def asked(server: PlayedServer) -> list[str]:
    return [path for path, _ in server.posted if path in ("/api/resume", "/api/start", "/api/survey", "/api/continue")]


@pytest.mark.parametrize(
    ("now", "interrupted", "words"),
    [
        ("PAUSED", "work", "Resume 1 cut"),
        ("PAUSED", "survey", "Resume the survey"),
        ("READY", "survey", "Resume the survey"),
    ],
)
def test_one_press_leads_from_a_pause_back_to_work_or_survey(
    page: Page, server: PlayedServer, now: m.Mode, interrupted: str, words: str
) -> None:
    server.controller = mode(now, interrupted)
    show(server, TAKEN)
    expect(page.locator(".next #to-continue")).to_contain_text(words)
    page.locator("#to-continue").click()
    until(page, lambda: asked(server) == ["/api/continue"])


def test_going_on_is_greyed_with_its_reason_where_it_would_be_refused(page: Page, server: PlayedServer) -> None:
    why = reasons.process_gone("perception")
    state = mode("PAUSED", "work")
    server.controller = msgspec.structs.replace(state, allowed=state.allowed | {"Continue": why})
    show(server, TAKEN)
    go_on = page.locator(".next #to-continue")
    expect(go_on).to_have_attribute("aria-disabled", "true")
    expect(page.locator(".next-why")).to_have_text(text_of(why))
    go_on.click(force=True)
    page.wait_for_timeout(300)
    assert asked(server) == []


@pytest.mark.parametrize(
    ("interrupted", "points", "preview"),
    [
        ("teleoperation", (TAKEN,), None),
        ("work", (WAITS,), None),
        ("work", (TAKEN, point(2, "UNKNOWN", spur=2)), None),
        ("work", (TAKEN,), needed("ready")),
    ],
)
def test_resume_starts_no_work_where_something_else_was_interrupted_or_comes_first(
    page: Page, server: PlayedServer, interrupted: str, points: Any, preview: PreviewState | None
) -> None:
    server.controller = mode("PAUSED", interrupted)
    show(server, *points)
    server.tell(page_messages.PagePreview(preview=preview or NO_PREVIEW))
    page.locator(".next #resume").click()
    page.wait_for_timeout(300)
    assert asked(server) == ["/api/resume"]


def test_why_the_work_has_ended_is_not_told_any_more_once_there_is_more_to_cut(
    page: Page, server: PlayedServer
) -> None:
    ended = reasons.work_done_but(1.0)
    server.controller = msgspec.structs.replace(mode("READY"), reason=ended)
    show(server, WAITS)
    expect(page.locator(".next-why")).to_have_text(text_of(ended))
    show(server, TAKEN)
    expect(page.locator(".next-why")).to_be_empty()
