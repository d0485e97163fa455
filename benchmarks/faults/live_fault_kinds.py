"""What goes wrong between the real processes: each fault, its hop, and how soon the robot must rest."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from benchmarks.faults.live_world import FaultyRobot, Hand

#: Makes it happen; returns when (s, monotonic).
Inject = Callable[[FaultyRobot, Hand], float]
#: Where the robot may go on or rest, and only what is sent is judged.
EITHER = math.nan
_GO_ON = math.inf
_HOUR, _YEAR = 3600, 365 * 86400


@dataclass(frozen=True)
class LiveFault:
    """What goes wrong.

    Attributes:
        name: Of the fault.
        requirement: That it tests.
        hop: Between which it happens.
        limit_s: From the fault until nothing but zero is sent; infinite where the robot must go on, NaN where it may.
        inject: Makes it happen.
        since: What the limit counts from: the fault, or the last command that the bridge took.
        moving: The base driven by hand, or automatic work.
        watched_s: How long to look at it (s).
        restart: Processes to start again afterwards.
    """

    name: str
    requirement: str
    hop: str
    limit_s: float
    inject: Inject
    since: Literal["fault", "setpoint"] = "fault"
    moving: Literal["base", "work"] = "base"
    watched_s: float = 1.2
    restart: tuple[str, ...] = ()


def _way(origin: str, to: str, topic: str, **fault: float | bool) -> Inject:
    return lambda robot, hand: robot.spoil(origin, to, topic, **fault)


def _for(seconds: float, inject: Inject) -> Inject:
    """And all ways are well again after some time."""

    def both(robot: FaultyRobot, hand: Hand) -> float:
        at = inject(robot, hand)
        time.sleep(seconds)
        robot.order(clear=True)
        return at

    return both


def _stop(robot: FaultyRobot, hand: Hand) -> float:
    at = time.monotonic()
    robot.client.post("/api/stop", json={"reason": "trial"})
    return at


def _standstill(name: str, seconds: float) -> Inject:
    """A process stands still and goes on; the limit counts from the beginning."""

    def inject(robot: FaultyRobot, hand: Hand) -> float:
        at = robot.halt(name)
        time.sleep(seconds)
        robot.go_on(name)
        return at

    return inject


def _bridge_wakes(robot: FaultyRobot, hand: Hand) -> float:
    """The simulated robot stands still with its bridge, so that the limit counts from when it goes on."""
    robot.halt("bridge")
    time.sleep(1.0)
    return robot.go_on("bridge")


def _killed(name: str) -> Inject:
    return lambda robot, hand: robot.kill(name)


def _replayed(robot: FaultyRobot, hand: Hand) -> float:
    at = time.monotonic()
    for _ in range(5):
        robot.order(**{"from": "controller", "to": "bridge", "topic": "command/motion", "replay": True})
        time.sleep(0.1)
    return at


def _all_ways(**fault: float) -> Inject:
    return lambda robot, hand: robot.spoil("*", "*", "*", **fault)


def _lost(topic: str) -> Inject:
    return _way("bridge", "controller", topic, loss=1.0)


def _silent(robot: FaultyRobot, hand: Hand) -> float:
    return hand.silence()


def _jumps(robot: FaultyRobot, hand: Hand) -> float:
    """The wall clocks of all processes jump by an hour and by ten years, forth and back."""
    at = time.monotonic()
    for ahead in (_HOUR, -_HOUR, 10 * _YEAR, -10 * _YEAR):
        robot.wall_clock.set(ahead)
        time.sleep(0.4)
    return at


def _jump_and_silence(robot: FaultyRobot, hand: Hand) -> float:
    """A timeout after a jump of the clock is as long as any other."""
    robot.wall_clock.set(-_HOUR)
    time.sleep(0.2)
    return hand.silence()


_MOTION = ("controller", "bridge", "command/motion")
LIVE_FAULTS: tuple[LiveFault, ...] = (
    LiveFault("software stop through the server", "R3", "browser–bridge", 0.2, _stop),
    LiveFault("page silent", "R1", "browser–server", 0.4, _silent),
    LiveFault("release of the hold", "R15", "browser–bridge", 0.15, lambda robot, hand: hand.let_go()),
    LiveFault("server stands still for 1 s", "R1", "browser–server", 0.4, _standstill("server", 1.0), watched_s=2.2),
    LiveFault(
        "what the operator holds is lost", "R1", "server–controller", 0.4, _way("server", "controller", "*", loss=1.0)
    ),
    LiveFault("motion commands lost", "R2", "controller–bridge", 0.2, _way(*_MOTION, loss=1.0), "setpoint"),
    LiveFault("commands spoilt", "R9", "controller–bridge", EITHER, _for(0.5, _way(*_MOTION, corrupt=0.3))),
    LiveFault("commands 300 ms late", "R6", "controller–bridge", 0.4, _way(*_MOTION, delay_s=0.3)),
    LiveFault(
        "commands held back for 2 s, then flushed",
        "R6",
        "controller–bridge",
        0.4,
        _for(2.0, _way(*_MOTION, held=True)),
        watched_s=3.0,
    ),
    LiveFault("joint states lost", "R6", "bridge–controller", 0.42, _lost("state/joints")),
    LiveFault("commands read at 5 Hz", "R6", "controller–bridge", EITHER, _for(1.0, _way(*_MOTION, every_s=0.2))),
    LiveFault("the last 200 commands replayed", "R8", "controller–bridge", _GO_ON, _replayed),
    LiveFault("duplicates and reorder", "R8", "controller–bridge", _GO_ON, _way(*_MOTION, twice=0.5, jitter_s=0.03)),
    LiveFault(
        "controller stands still for 1 s", "R17", "controller", 0.42, _standstill("controller", 1.0), watched_s=2.2
    ),
    LiveFault("bridge stands still for 1 s, from then on", "R17", "bridge", 0.4, _bridge_wakes),
    LiveFault("odometry lost", "R20", "bridge–controller", 0.6, _lost("state/odometry")),
    LiveFault("100 ms of jitter on every way", "clean", "all", _GO_ON, _all_ways(jitter_s=0.1), watched_s=2.0),
    LiveFault(
        "100 ms of jitter on every way, automatic work",
        "clean",
        "all",
        _GO_ON,
        _all_ways(jitter_s=0.1),
        moving="work",
        watched_s=4.0,
    ),
    LiveFault("software stop in automatic work", "R3", "browser–bridge", 0.2, _stop, moving="work"),
    LiveFault(
        "nobody looks on",
        "R12",
        "browser–server",
        1.5,
        _silent,
        moving="work",
        watched_s=3.0,
    ),
    LiveFault(
        "who is there looks away",
        "R16",
        "browser–server",
        2.5,
        lambda robot, hand: hand.look_away(),
        moving="work",
        watched_s=4.0,
    ),
    LiveFault(
        "perception stands still for 3 s",
        "R20",
        "perception–controller",
        1.5,
        _standstill("perception", 3.0),
        moving="work",
        watched_s=4.0,
    ),
    LiveFault("wall clocks jump by 1 h and 10 y", "R19", "all", _GO_ON, _jumps, watched_s=2.0),
    LiveFault(
        "wall clocks jump by 1 h and 10 y, automatic work", "R19", "all", _GO_ON, _jumps, moving="work", watched_s=2.0
    ),
    LiveFault("wall clocks jump by 1 h, then the page is silent", "R19", "all", 0.4, _jump_and_silence),
    LiveFault("controller killed", "R2", "controller", 0.2, _killed("controller"), "setpoint", restart=("controller",)),
    LiveFault(
        "controller killed in automatic work",
        "R2",
        "controller",
        0.2,
        _killed("controller"),
        "setpoint",
        "work",
        restart=("controller",),
    ),
    LiveFault("server killed", "R1", "server", 0.4, _killed("server"), restart=("server",)),
    LiveFault(
        "perception killed in automatic work",
        "R20",
        "perception",
        1.5,
        _killed("perception"),
        moving="work",
        watched_s=2.5,
        restart=("perception",),
    ),
)
