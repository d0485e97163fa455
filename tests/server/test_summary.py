"""What is told of a robot to somebody who looks at another one: the worst that needs somebody, and who holds it."""

import msgspec
import pytest

from rolling_panda import messages as m
from rolling_panda.messages import page as p
from rolling_panda.messages.supervision import StopState
from server.robots.summary import RobotSummary, summarize
from tests.server.test_misuse import control
from tests.support.fake_wire import bridge_state, controller_state, pruning_point

PROCESSES = tuple(p.ProcessPresence(name, True, 0.05) for name in m.PROCESSES)
CALM = p.PageState(
    number=1, user="", role="viewer", viewers=2, processes=PROCESSES, controller=controller_state(),
    controller_age_s=0.05, bridge=bridge_state(), bridge_age_s=0.05, joints=None, base=None, camera_frame=0,
)  # fmt: skip


def seen(points: p.PagePoints | None = None, **changes: object) -> RobotSummary:
    return summarize("panda-1", "/robots/panda-1/", msgspec.structs.replace(CALM, **changes), points, "me")


def alarm_of(told: RobotSummary) -> str:
    return "" if told.alarm is None else str(told.alarm["code"])


def gone(process: str, age_s: float | None = 0.05, present: bool = False) -> tuple[p.ProcessPresence, ...]:
    """Every process is there but this one."""
    others = tuple(row for row in PROCESSES if row.process != process)
    return (*others, p.ProcessPresence(process, present, age_s))


def test_a_calm_robot_has_no_alarm() -> None:
    told = seen()
    assert (told.mode, told.severity, told.alarm, told.holder, told.yours, told.pages) == (
        "READY",
        "",
        None,
        "",
        False,
        2,
    )


def test_before_its_first_state_that_itself_is_the_alarm() -> None:
    assert summarize("panda-1", "/robots/panda-1/", None, None, "me").severity == "error"
    assert alarm_of(seen(controller=None, processes=gone("controller"))) == "controller_silent"


@pytest.mark.parametrize(
    ("changes", "severity", "code"),
    [
        ({"controller": controller_state(mode="ESTOP_LATCHED")}, "error", "robot_stopped"),
        ({"controller": controller_state(mode="PROTECTIVE_STOP")}, "error", "robot_protective_stop"),
        ({"controller": controller_state(mode="FAULT")}, "error", "robot_fault"),
        ({"controller": controller_state(mode="PAUSED")}, "", ""),
        ({"processes": gone("bridge")}, "error", "bridge_silent"),
        ({"processes": gone("controller", 1.5, True)}, "error", "controller_silent"),
        ({"processes": gone("perception", None, True)}, "warning", "perception_silent"),
        ({"bridge": msgspec.structs.replace(bridge_state(), cutter="jammed")}, "error", "robot_cutter_jammed"),
        (
            {"stops": (StopState(process="bridge", stops=(), hardware=True),), "processes": gone("controller")},
            "error",
            "emergency_stop_pressed",
        ),
    ],
)
def test_the_worst_is_told(changes: dict[str, object], severity: str, code: str) -> None:
    told = seen(**changes)
    assert (told.severity, alarm_of(told)) == (severity, code)


def test_a_cut_that_nobody_knows_the_end_of_waits_for_somebody() -> None:
    row = p.PagePoint(pruning_point(), m.QueueEntry("p1", "UNKNOWN"))
    points = p.PagePoints(points=(row,), undecided_sites=(), segmenter="", frames=1, image_size=(1, 1))
    assert (seen(points).severity, alarm_of(seen(points))) == ("warning", "cut_unknown")


def test_who_holds_control_is_told_by_name_and_to_themselves() -> None:
    held = msgspec.structs.replace(control("me"), user="Ann")
    assert (seen(control=held).holder, seen(control=held).yours) == ("Ann", True)
    other = msgspec.structs.replace(held, holder="her")
    assert (seen(control=other).holder, seen(control=other).yours) == ("Ann", False)
    assert not summarize("a", "/", msgspec.structs.replace(CALM, control=control("")), None, "").yours
