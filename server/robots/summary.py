"""A summary of a robot for the pages of the other robots: mode, holder of control, and the most urgent alarm."""

from typing import Literal

from pydantic import BaseModel

from rolling_panda.messages.page import PagePoints, PageState, ProcessPresence
from rolling_panda.messages.types import Mode

#: A process whose last message is older than this (s) counts as silent.
_SILENT_S = {"bridge": 1.0, "controller": 1.0, "perception": 2.0}
_STOPPED: dict[Mode, str] = {
    "ESTOP_LATCHED": "Stopped",
    "PROTECTIVE_STOP": "Protective stop",
    "FAULT": "Fault",
}


class RobotSummary(BaseModel):
    """One robot of this server.

    Attributes:
        name: On the wire.
        path: Of its page; its REST interface is below, as `PATHapi/state`.
        mode: Of its controller; None before its first message.
        severity: Of `alarm`.
        alarm: The most urgent alarm; empty without one.
        holder: User who holds control; empty when nobody does.
        yours: Whether the caller holds control.
        pages: Open pages of this robot.
    """

    name: str
    path: str
    mode: Mode | None
    severity: Literal["", "warning", "error"]
    alarm: str
    holder: str
    yours: bool
    pages: int


def summarize(name: str, path: str, state: PageState | None, points: PagePoints | None, client: str) -> RobotSummary:
    """The summary of `state` and `points` for the session with this client key."""
    if state is None:
        return RobotSummary(
            name=name, path=path, mode=None, severity="error", alarm="not seen yet", holder="", yours=False, pages=0
        )
    severity, alarm = _alarm(state, points)
    control = state.control
    return RobotSummary(
        name=name,
        path=path,
        mode=None if state.controller is None else state.controller.mode,
        severity=severity,
        alarm=alarm,
        holder="" if control is None else control.user,
        yours=control is not None and control.holder == client != "",
        pages=state.viewers,
    )


def _alarm(state: PageState, points: PagePoints | None) -> tuple[Literal["", "warning", "error"], str]:
    silent = [row.process for row in state.processes if row.process in _SILENT_S and not _is_alive(row)]
    if any(stop.hardware for stop in state.stops):
        return "error", "Emergency stop on the robot is pressed"
    for process in ("bridge", "controller"):
        if process in silent:
            return "error", f"{process} is silent"
    controller, bridge = state.controller, state.bridge
    if controller is not None and controller.mode in _STOPPED:
        return "error", ": ".join(part for part in (_STOPPED[controller.mode], controller.reason) if part)
    if bridge is not None and bridge.cutter == "jammed":
        return "error", "The cutter is jammed"
    if "perception" in silent:
        return "warning", "perception is silent"
    if points is not None and any(row.entry.state == "UNKNOWN" for row in points.points):
        return "warning", "A cut ended unknown"
    return "", ""


def _is_alive(row: ProcessPresence) -> bool:
    return row.present and row.age_s is not None and row.age_s < _SILENT_S[row.process]
