"""A summary of a robot for the pages of the other robots: mode, holder of control, and the most urgent alarm."""

from collections.abc import Callable
from typing import Any, Literal

import msgspec
from pydantic import BaseModel

from rolling_panda import reasons
from rolling_panda.messages.page import PagePoints, PageState, ProcessPresence
from rolling_panda.messages.types import Mode, Reason

#: A process whose last message is older than this (s) counts as silent.
_SILENT_S = {"bridge": 1.0, "controller": 1.0, "perception": 2.0}
_STOPPED: dict[Mode, Callable[[Reason], Reason]] = {
    "ESTOP_LATCHED": reasons.robot_stopped,
    "PROTECTIVE_STOP": reasons.robot_protective_stop,
    "FAULT": reasons.robot_fault,
}
_SILENT: dict[str, Callable[[], Reason]] = {
    "bridge": reasons.bridge_silent,
    "controller": reasons.controller_silent,
    "perception": reasons.perception_silent,
}


class RobotSummary(BaseModel):
    """One robot of this server.

    Attributes:
        name: On the wire.
        path: Of its page; its REST interface is below, as `PATHapi/state`.
        mode: Of its controller; None before its first message.
        severity: Of `alarm`.
        alarm: The most urgent alarm as a reason with `code` and `values`; null without one.
        holder: User who holds control; empty when nobody does.
        yours: Whether the caller holds control.
        pages: Open pages of this robot.
    """

    name: str
    path: str
    mode: Mode | None
    severity: Literal["", "info", "warning", "error"]
    alarm: dict[str, Any] | None
    holder: str
    yours: bool
    pages: int


def summarize(name: str, path: str, state: PageState | None, points: PagePoints | None, client: str) -> RobotSummary:
    """The summary of `state` and `points` for the session with this client key."""
    if state is None:
        return _summary(name, path, reasons.robot_unseen())
    control = state.control
    return _summary(
        name,
        path,
        _alarm(state, points),
        mode=None if state.controller is None else state.controller.mode,
        holder="" if control is None else control.user,
        yours=control is not None and control.holder == client != "",
        pages=state.viewers,
    )


def _summary(
    name: str,
    path: str,
    alarm: Reason | None,
    mode: Mode | None = None,
    holder: str = "",
    yours: bool = False,
    pages: int = 0,
) -> RobotSummary:
    entry = None if alarm is None else reasons.CATALOGUE[alarm.code]
    return RobotSummary(
        name=name,
        path=path,
        mode=mode,
        severity="" if entry is None else entry.severity,
        alarm=None if alarm is None else msgspec.to_builtins(alarm),
        holder=holder,
        yours=yours,
        pages=pages,
    )


def _alarm(state: PageState, points: PagePoints | None) -> Reason | None:
    silent = [row.process for row in state.processes if row.process in _SILENT_S and not _is_alive(row)]
    if any(stop.hardware for stop in state.stops):
        return reasons.emergency_stop_pressed()
    for process in ("bridge", "controller"):
        if process in silent:
            return _SILENT[process]()
    controller, bridge = state.controller, state.bridge
    if controller is not None and controller.mode in _STOPPED:
        return _STOPPED[controller.mode](controller.reason)
    if bridge is not None and bridge.cutter == "jammed":
        return reasons.robot_cutter_jammed()
    if "perception" in silent:
        return reasons.perception_silent()
    if points is not None and any(row.entry.state == "UNKNOWN" for row in points.points):
        return reasons.cut_unknown()
    return None


def _is_alive(row: ProcessPresence) -> bool:
    return row.present and row.age_s is not None and row.age_s < _SILENT_S[row.process]
