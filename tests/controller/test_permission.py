from dataclasses import replace

from controller.config import ControllerConfig
from controller.inputs import Inputs
from controller.supervision import health as safety
from controller.supervision import modes
from controller.supervision.permission import Situation, allowed, refusal
from rolling_panda import commands as intents
from rolling_panda.commands import COMMAND_OF

WELL = replace(
    safety.health(Inputs(), None, 0.0),
    joints=0.0,
    odometry=0.0,
    bridge=0.0,
    server=0.0,
    perception=0.0,
    obstacles=0.0,
    present=frozenset({"bridge", "controller", "perception", "server"}),
)


def situation(mode: str = "READY", **changes: object) -> Situation:
    state = replace(modes.boot(), mode=mode)
    usual = Situation(ControllerConfig(), state, WELL, homing=False, busy="", waits="", rights=modes.OPERATOR)
    return replace(usual, **changes)


def test_a_ready_robot_with_work_may_start_and_go_home() -> None:
    assert {"Start", "Home"} <= set(allowed(0.0, situation()))


def test_each_thing_that_is_missing_is_said() -> None:
    start, home = COMMAND_OF[intents.Start], COMMAND_OF[intents.Home]
    assert refusal(start, 0.0, situation(waits="no point is accepted")) == "no point is accepted"
    assert refusal(home, 0.0, situation(waits="no point is accepted")) == ""
    assert refusal(start, 0.0, situation(busy="the blades are closing")) == "the blades are closing"
    assert "perception" in refusal(start, 0.0, situation(health=replace(WELL, perception=9.0)))
    assert "perception" not in refusal(home, 0.0, situation(health=replace(WELL, perception=9.0)))
    assert "watchdog" in refusal(start, 0.0, situation(health=replace(WELL, watchdog=True)))
    assert "PAUSED" in refusal(home, 0.0, situation("PAUSED"))


def test_a_pause_ends_the_way_home_in_ready() -> None:
    assert "Pause" not in allowed(0.0, situation())
    assert "Pause" in allowed(0.0, situation(homing=True))
