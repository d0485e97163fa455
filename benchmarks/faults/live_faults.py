"""Trials with the real processes over the real wire, judged by the trace of the simulated bridge alone."""

import random
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import msgspec
import numpy as np

from benchmarks.faults.judge import Rows, Trial, braking_after, judge, last_taken
from benchmarks.faults.live_fault_kinds import LiveFault
from benchmarks.faults.live_world import FaultyRobot, Hand
from bridge.sim.robot import trace
from controller.config import ControllerConfig
from rolling_panda import messages as m
from rolling_panda.errors import RollingPandaError
from rolling_panda.reasons import text_of
from tests.support.worlds.faulty_world import MODEL

#: A base driven by hand moves at least this fast (rad/s of a wheel) before a fault, and base or arm at work.
_DRIVEN = 0.95 * ControllerConfig().teleoperation.base_speed / MODEL.drive.wheel_radius
_WORKING = 0.3
_PATIENCE_S = 10.0
#: How much of the trace before a fault belongs to a trial (s), and what the trace may lag behind (s).
_BEFORE_S, _WRITTEN_S = 0.3, 0.3


@dataclass(frozen=True)
class Happened:
    """A fault that was made to happen.

    Attributes:
        fault: Which.
        at: When (s, monotonic).
        trace: That it is in.
        until: End of its part of the trace (s, monotonic).
        mode: The controller's at the end, with its reason; empty where nobody could be asked.
    """

    fault: LiveFault
    at: float
    trace: Path
    until: float
    mode: str


def run_live(
    faults: Sequence[LiveFault],
    seed: int,
    seconds: float,
    folder: Path,
    config: Path | None = None,
    pages: int = 0,
    told: Callable[[str], None] = print,
) -> list[Trial]:
    """Faults in an order drawn by `seed`, for about `seconds`, in as few starts of the processes as can be.

    Meanwhile so many `pages` look on.

    What needs a process to be started again afterwards is drawn less often.
    """
    draw, happened = random.Random(seed), []
    weights = [0.1 if fault.restart else 1.0 for fault in faults]
    end = time.monotonic() + seconds
    starts = 0
    while time.monotonic() < end:
        starts += 1
        place = Path(tempfile.mkdtemp(dir=folder))
        with FaultyRobot(place, config=config) as robot, robot.looked_at(pages):
            robot.wait(lambda: len(robot.points()) >= 3, 60, "points")
            way = 1.0
            while time.monotonic() < end:
                fault = draw.choices(faults, weights)[0]
                if fault.moving == "work" and not _points_left(robot):
                    # The row is worked off: another one is needed.
                    break
                way = -way
                try:
                    happened.append(_happen(robot, fault, draw.uniform(0.0, 0.4), way))
                except (RollingPandaError, AssertionError) as error:
                    lines = str(error).splitlines()
                    told(f"no trial of {fault.name}: {lines[0]}; {_why_not(robot)}; {' | '.join(lines[-4:])}")
                    break
    told(f"{len(happened)} faults in {starts} starts of the processes")
    return _judged(happened, seed)


def _points_left(robot: FaultyRobot) -> bool:
    return any(row["entry"]["state"] in ("PROPOSED", "ACCEPTED") for row in robot.points())


def _happen(robot: FaultyRobot, fault: LiveFault, later_s: float, way: float) -> Happened:
    robot.make_ready()
    by_hand = fault.moving == "base"
    with Hand(robot, way if by_hand else 0.0) as hand:
        if not by_hand:
            # Refused when all of them are accepted already.
            robot.client.post("/api/points/accept-all", json={"confidence": 0.0})
            robot.post("start")
        robot.wait(lambda: _moves(robot, by_hand), _PATIENCE_S, "the robot to move")
        time.sleep(later_s)
        at = fault.inject(robot, hand)
        left = at + fault.watched_s - time.monotonic()
        if left > 0.0:
            time.sleep(left)
        out = Happened(fault, at, robot.trace, time.monotonic(), _mode(robot))
    time.sleep(_WRITTEN_S)
    for name in fault.restart:
        if name not in robot.processes:
            robot.start(name)
    if fault.restart:
        robot.wait(lambda: robot.back(fault.restart), 30, f"{fault.restart} to be back")
    return out


def _mode(robot: FaultyRobot) -> str:
    try:
        controller = robot.state()["controller"]
    except httpx.HTTPError:
        return ""
    return f"{controller['mode']}: {_text(controller['reason'])}" if controller else ""


def _text(reason: dict[str, Any]) -> str:
    return text_of(msgspec.convert(reason, m.Reason))


def _why_not(robot: FaultyRobot) -> str:
    """What the robot says it is doing, and what keeps it from that."""
    try:
        controller = robot.state()["controller"]
    except httpx.HTTPError as error:
        return str(error)
    if not controller:
        return "no controller"
    near = controller["proximity"] and f"near {controller['proximity']}"
    return ", ".join(filter(None, (controller["mode"], _text(controller["reason"]), controller["limited_by"], near)))


def _moves(robot: FaultyRobot, by_hand: bool) -> bool:
    state = robot.state()
    joints, controller = state["joints"], state["controller"]
    if not joints or not controller:
        return False
    speed = np.abs(joints["velocity"])
    if by_hand:
        return bool(controller["mode"] == "TELEOP" and speed[:2].min() > _DRIVEN)
    return bool(controller["mode"] == "AUTO" and speed.max() > _WORKING)


def _judged(happened: Sequence[Happened], seed: int) -> list[Trial]:
    """Each with its part of the trace; one during which nothing was sent when the fault came is left out."""
    out, read = [], {}
    for number, one in enumerate(happened):
        if one.trace not in read:
            read = {one.trace: trace.read(one.trace).rows}
        rows = read[one.trace]
        part = rows[(rows["clock"] > one.at - _BEFORE_S) & (rows["clock"] < one.until)]
        before = part[part["clock"] <= one.at]
        if len(before) and np.any(before["setpoint"][-1]):
            out.append(_trial(one, part, seed, number))
    return out


def _trial(one: Happened, rows: Rows, seed: int, number: int) -> Trial:
    fault = one.fault
    since = one.at if fault.since == "fault" else last_taken(rows)
    found = judge(rows, (), since, fault.limit_s)
    braking = braking_after(rows, one.at)
    return Trial(
        fault.name, fault.requirement, seed + number, fault.limit_s, f"{fault.hop}; {one.mode}", braking, *found
    )
