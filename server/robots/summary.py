"""A robot at a glance, for whoever looks at another one: mode, who holds control, and the worst that needs somebody."""

from typing import Literal

from pydantic import BaseModel

from rolling_panda.messages.page import PagePoints, PageState, ProcessPresence
from rolling_panda.messages.types import Mode

#: Words of a process that are older than this (s) say nothing of now.
_OLD_S = {"bridge": 1.0, "controller": 1.0, "perception": 2.0}
_STOPPED: dict[Mode, str] = {
    "ESTOP_LATCHED": "Stopped",
    "PROTECTIVE_STOP": "Protective stop",
    "FAULT": "Fault",
}


class Glance(BaseModel):
    """One robot of this server, in brief.

    Attributes:
        name: As on the wire.
        path: Its page; what is asked of it by REST lies below, as `PATHapi/state`.
        mode: Of its controller; None before the first word of it.
        severity: Of `alarm`.
        alarm: The worst that needs somebody now, in words; empty when nothing does.
        holder: Name of who holds control; empty when nobody does.
        yours: Whether that is the caller.
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


def glance(name: str, path: str, state: PageState | None, points: PagePoints | None, client: str) -> Glance:
    """What `state` and `points` come to, for the session with this client key."""
    if state is None:
        return Glance(
            name=name, path=path, mode=None, severity="error", alarm="not seen yet", holder="", yours=False, pages=0
        )
    severity, alarm = _worst(state, points)
    control = state.control
    return Glance(
        name=name,
        path=path,
        mode=None if state.controller is None else state.controller.mode,
        severity=severity,
        alarm=alarm,
        holder="" if control is None else control.user,
        yours=control is not None and control.holder == client != "",
        pages=state.viewers,
    )


def _worst(state: PageState, points: PagePoints | None) -> tuple[Literal["", "warning", "error"], str]:
    gone = [row.process for row in state.processes if row.process in _OLD_S and not _lives(row)]
    if any(stop.hardware for stop in state.stops):
        return "error", "Emergency stop on the robot is pressed"
    for process in ("bridge", "controller"):
        if process in gone:
            return "error", f"{process} is silent"
    controller, bridge = state.controller, state.bridge
    if controller is not None and controller.mode in _STOPPED:
        return "error", ": ".join(part for part in (_STOPPED[controller.mode], controller.reason) if part)
    if bridge is not None and bridge.cutter == "jammed":
        return "error", "The cutter is jammed"
    if "perception" in gone:
        return "warning", "perception is silent"
    if points is not None and any(row.entry.state == "UNKNOWN" for row in points.points):
        return "warning", "A cut ended unknown"
    return "", ""


def _lives(row: ProcessPresence) -> bool:
    return row.present and row.age_s is not None and row.age_s < _OLD_S[row.process]
