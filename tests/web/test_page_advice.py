"""Advice names the button that is the next step: what the alarm of each state says, and that it can be pressed."""

from dataclasses import dataclass, field
from typing import Any

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda.messages import page as page_messages
from rolling_panda.messages import types as types_messages
from rolling_panda.messages.supervision import ControlState, PreviewState
from tests.support.page_parts import held, show
from tests.support.played_server import PlayedServer, controller, point

pytestmark = pytest.mark.browser

WAITS, TAKEN = point(1, "PROPOSED"), point(1, "ACCEPTED", user="Ada")
MINE, THEIRS = held("me", "Ada"), held("other", "Bob")
PAUSE_SEEN = "When that is seen to, press Resume, then"
MENDED, UNMENDED = "The cause has gone:", "Mend the cause. A second after it has gone,"


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
    """A state of the robot and of this page; the advice in it, and the button that comes first."""

    controller: m.ControllerState
    advice: str
    button: str = ""
    points: tuple[page_messages.PagePoint, ...] = (TAKEN,)
    role: types_messages.Role = "supervisor"
    control: ControlState | None = field(default_factory=lambda: MINE)
    preview: PreviewState | None = None


CASES = {
    "work": Case(mode("PAUSED", "work"), f"{PAUSE_SEEN} Start.", "#resume"),
    "work, nothing accepted": Case(
        mode("PAUSED", "work"), f"{PAUSE_SEEN} accept points, then Start.", "#resume", points=(WAITS,)
    ),
    "work, nothing found": Case(mode("PAUSED", "work"), f"{PAUSE_SEEN} Survey.", "#resume", points=()),
    "survey": Case(mode("PAUSED", "survey"), f"{PAUSE_SEEN} Survey to look on.", "#resume", points=(WAITS,)),
    "survey with points accepted": Case(
        mode("PAUSED", "survey"), f"{PAUSE_SEEN} Survey to look on, or Start to cut.", "#resume"
    ),
    "teleoperation": Case(mode("PAUSED", "teleoperation"), f"{PAUSE_SEEN} hold again.", "#resume"),
    "preview wanted": Case(
        mode("PAUSED", "work"), f"{PAUSE_SEEN} Preview, Approve and Start.", "#resume", preview=needed("none")
    ),
    "preview shown": Case(
        mode("PAUSED", "work"), f"{PAUSE_SEEN} Approve and Start.", "#resume", preview=needed("ready")
    ),
    "preview approved": Case(mode("PAUSED", "work"), f"{PAUSE_SEEN} Start.", "#resume", preview=needed("approved")),
    "somebody else's": Case(
        mode("PAUSED", "work"),
        f"Bob holds control: press Ask or Take. {PAUSE_SEEN} Start.",
        "#request-control",
        control=THEIRS,
    ),
    "nobody's": Case(mode("PAUSED", "work"), f"{PAUSE_SEEN} Start.", "#resume", control=None),
    "looking on": Case(
        mode("PAUSED", "survey"),
        "When that is seen to, an operator presses Resume, then Survey to look on, or Start to cut.",
        role="viewer",
    ),
    "resumed": Case(mode("READY", "work"), "Press Start to go on.", "#start"),
    "resumed, preview shown": Case(mode("READY", "work"), "Press Approve and Start to go on.", preview=needed("ready")),
    "protective stop, cause there": Case(
        mode("PROTECTIVE_STOP", "work"), f"{UNMENDED} press Acknowledge, then Resume."
    ),
    "protective stop, cause gone": Case(
        mode("PROTECTIVE_STOP", "work", allowed={"Acknowledge": None}),
        f"{MENDED} press Acknowledge, then Resume.",
        "#acknowledge",
    ),
    "fault": Case(
        mode("FAULT", allowed={"Acknowledge": None}), f"{MENDED} press Acknowledge, then Arm.", "#acknowledge"
    ),
    "fault, an operator's page": Case(
        mode("FAULT", allowed={"Acknowledge": None}),
        f"{MENDED} a supervisor presses Acknowledge, then Arm.",
        role="operator",
    ),
    "stopped": Case(
        mode("ESTOP_LATCHED"),
        "See that the row is clear and write why it is safe to go on; press Reset, then Arm.",
    ),
    "stopped, an operator's page": Case(
        mode("ESTOP_LATCHED"),
        "See that the row is clear and write why it is safe to go on; a supervisor presses Reset, then Arm.",
        role="operator",
    ),
    "joint at its limit, ready": Case(
        mode("READY", joint_margin=0.02), "Press Home, or lead the tool back towards the base.", "#home"
    ),
    "joint at its limit, idle": Case(mode("IDLE", joint_margin=0.02), "Press Arm, then Home.", "#arm"),
    "joint at its limit, at work": Case(
        mode("AUTO", joint_margin=0.02),
        "Nothing yet: the robot leads itself back. If it does not, press Pause, then Resume and Home.",
    ),
    "joint at its limit, by hand": Case(
        mode("TELEOP", joint_margin=0.02), "Lead the tool back towards the base; or let go, and press Home."
    ),
}


def test_the_first_button_that_advice_names_can_be_pressed(
    page: Page, server: PlayedServer, subtests: pytest.Subtests
) -> None:
    before = ""
    for name, case in CASES.items():
        assert case.advice != before, "what is left of the case before would be taken for this one's"
        before = case.advice
        with subtests.test(name):
            server.controller, server.role, server.control = case.controller, case.role, case.control
            show(server, *case.points)
            server.tell(page_messages.PagePreview(preview=case.preview or NO_PREVIEW))
            expect(page.locator("#alarms .act")).to_have_text([case.advice])
            if case.button:
                expect(page.locator(case.button)).to_have_attribute("aria-disabled", "false")


def test_once_resume_is_pressed_nothing_advises_to_press_it(page: Page, server: PlayedServer) -> None:
    server.controller = mode("PAUSED", "survey")
    show(server, WAITS)
    expect(page.locator("#alarms .act")).to_contain_text("press Resume")
    server.controller = mode("READY", "survey")
    expect(page.locator("#resume")).to_have_attribute("aria-disabled", "true")
    expect(page.locator("#alarms .act:visible")).to_have_count(0, timeout=1000)
    server.controller = mode("AUTO", phase="SURVEY")
    expect(page.locator("#alarms .empty")).to_be_visible()
    expect(page.locator("#alarms li")).to_have_count(0)
