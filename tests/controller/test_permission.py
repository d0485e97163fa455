from dataclasses import replace
from typing import get_args

import msgspec

from controller.config import SupervisionConfig
from controller.supervision import health as safety
from controller.supervision import modes
from controller.supervision.permission import Situation, allowed, of_holder, refusal
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.commands import COMMAND_OF, Condition
from rolling_panda.messages.types import Reason
from rolling_panda.transport.inbox import Inbox

WELL = msgspec.structs.replace(
    safety.health(Inbox(), None, 0.0),
    joints=0.0,
    odometry=0.0,
    bridge=0.0,
    server=0.0,
    perception=0.0,
    obstacles=0.0,
    present=frozenset({"bridge", "controller", "perception", "server"}),
)


def well(**changes: object) -> safety.Health:
    return msgspec.structs.replace(WELL, **changes)


def situation(mode: str = "READY", **changes: object) -> Situation:
    state = replace(modes.boot(), mode=mode)
    usual = Situation(SupervisionConfig(), state, WELL, homing=False, busy=None, work=work(), rights=modes.OPERATOR)
    return replace(usual, **changes)


def work(**missing: Reason) -> dict[str, Reason | None]:
    """The conditions of the work; `missing` by names with underscores."""
    return {name: missing.get(name.replace(" ", "_")) for name in get_args(Condition)}


def test_a_ready_robot_with_work_may_start_and_go_home() -> None:
    found = allowed(0.0, situation())
    assert found["Start"] is None and found["Home"] is None
    assert found["Arm"] == reasons.impossible_in_ready("arm")
    assert "TakeControl" not in allowed(0.0, situation()), "who may have control is told with it"


def test_each_thing_that_is_missing_is_said() -> None:
    start, home = COMMAND_OF[intents.Start], COMMAND_OF[intents.Home]
    missing = reasons.none_accepted()
    assert refusal(start, 0.0, situation(work=work(workable_point=missing))) == missing
    assert refusal(home, 0.0, situation(work=work(workable_point=missing))) is None
    assert refusal(start, 0.0, situation(busy=missing)) == missing
    limit = SupervisionConfig().perception_max_age_s
    silent = reasons.process_silent("perception", 9.0, limit)
    assert refusal(start, 0.0, situation(health=well(perception=9.0))) == silent
    assert refusal(home, 0.0, situation(health=well(perception=9.0))) is None
    assert refusal(start, 0.0, situation(health=well(watchdog=True))) == reasons.watchdog_holds()
    assert refusal(home, 0.0, situation("PAUSED")) == reasons.wrong_mode("Home", "READY", "PAUSED")


def test_a_hold_is_told_with_the_commands() -> None:
    missing = reasons.homing()
    limit = SupervisionConfig().hold_link_max_age_s
    assert allowed(0.0, situation())["Teleoperation"] is None
    assert allowed(0.0, situation("TELEOP", busy=missing))["Teleoperation"] is None, "the hold under way goes on"
    assert allowed(0.0, situation(busy=missing))["Teleoperation"] == missing
    silent = reasons.process_silent("server", 2 * limit, limit)
    assert allowed(0.0, situation(health=well(server=2 * limit)))["Teleoperation"] == silent
    elsewhere = reasons.wrong_mode("Teleoperation", "READY", "PAUSED")
    assert allowed(0.0, situation("PAUSED"))["Teleoperation"] == elsewhere


def test_what_only_the_holder_may_do_is_told_and_refused_to_others() -> None:
    theirs = reasons.control_held("bob")
    for mode in ("IDLE", "READY", "PAUSED", "FAULT", "ESTOP_LATCHED"):
        refused = allowed(0.0, situation(mode, not_theirs=theirs))
        assert {name for name, why in refused.items() if why == theirs} == set(of_holder(mode)), mode
    assert "Home" in of_holder("READY") and "Pause" not in of_holder("READY")
    assert of_holder("FAULT") == (), "acknowledging a fault moves nothing"


def test_a_pause_ends_the_way_home_in_ready() -> None:
    assert allowed(0.0, situation())["Pause"] == reasons.impossible_in_ready("pause")
    assert allowed(0.0, situation(homing=True))["Pause"] is None


def test_who_may_not_operate_is_refused_everything() -> None:
    for command in (COMMAND_OF[intents.AcceptAll], COMMAND_OF[intents.Pause]):
        viewer = situation("AUTO", rights=modes.ANYBODY)
        assert refusal(command, 0.0, viewer) == reasons.operator_needed()
        assert refusal(command, 0.0, replace(viewer, not_theirs=reasons.viewer_only())) == reasons.viewer_only()


def test_what_another_holds_is_not_moved_and_a_fault_is_left_by_any_supervisor() -> None:
    others = {"rights": modes.OPERATOR - {"holder"}, "not_theirs": reasons.control_held("ada")}
    assert refusal(COMMAND_OF[intents.Home], 0.0, situation(**others)) == others["not_theirs"]
    assert refusal(COMMAND_OF[intents.AcceptAll], 0.0, situation(**others)) is None
    fault = situation("FAULT", **others)
    fault = replace(fault, state=modes.observe(fault.state, None, 0.0))
    assert refusal(COMMAND_OF[intents.Acknowledge], 2.0, fault) is None


def test_a_stop_is_acknowledged_a_second_after_its_cause_is_gone() -> None:
    stopped = situation("PROTECTIVE_STOP")
    stopped = replace(stopped, state=modes.observe(stopped.state, None, 5.0))
    assert allowed(5.5, stopped)["Acknowledge"] == reasons.cause_recent(1.0)
    assert allowed(6.5, stopped)["Acknowledge"] is None


def test_without_measurements_nothing_begins_to_move_and_all_else_goes_on() -> None:
    for late in ({"joints": 9.0}, {"watchdog": True}):
        blind = situation(health=well(**late))
        for command in (COMMAND_OF[intents.Start], COMMAND_OF[intents.Survey], COMMAND_OF[intents.Home]):
            assert refusal(command, 0.0, blind)
        assert refusal(COMMAND_OF[intents.Arm], 0.0, replace(blind, state=modes.boot()))
        assert refusal(COMMAND_OF[intents.AcceptAll], 0.0, blind) is None
        assert (
            refusal(COMMAND_OF[intents.Pause], 0.0, replace(blind, state=modes.State("AUTO", reasons.said("work"))))
            is None
        )


def test_a_link_that_is_too_slow_for_a_hand_lets_work_begin_and_without_a_server_the_robot_can_be_armed() -> None:
    assert refusal(COMMAND_OF[intents.Start], 0.0, situation(health=well(server=1.0))) is None
    gone = situation(health=well(server=9.0))
    limit = SupervisionConfig().server_max_age_s
    assert refusal(COMMAND_OF[intents.Start], 0.0, gone) == reasons.process_silent("server", 9.0, limit)
    assert refusal(COMMAND_OF[intents.Arm], 0.0, replace(gone, state=modes.boot())) is None


def test_a_survey_needs_neither_accepted_points_nor_an_approved_preview() -> None:
    why = reasons.preview_not_approved()
    for missing in (work(workable_point=why), work(approved_preview=why)):
        assert refusal(COMMAND_OF[intents.Start], 0.0, situation(work=missing)) == why
        assert refusal(COMMAND_OF[intents.Survey], 0.0, situation(work=missing)) is None
