"""An operator who works along a whole row: accepts what is found, starts, drives on where nothing is left."""

import math

from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.messages.robot import Odometry
from rolling_panda.messages.supervision import BaseVelocity, TeleopTarget
from tests.support.worlds.closed_loop import ClosedLoop

#: Who has control of the robot.
USER = "bench"
#: How often the operator looks at what was found (s), and how long they let the camera look at a new place (s).
_LOOK_S, _SURVEY_S = 0.5, 3.0
#: How far they drive on at a time (m), and how fast (m/s).
_ON, _SPEED = 0.6, 0.25
#: What brings the arm home, or a row to its end, takes no longer than this (s).
_PATIENCE_S = 60.0


def walk(loop: ClosedLoop, end: float, limit_s: float = 600.0) -> tuple[float, float]:
    """Work until the base has come to `end` (m along the row) and nothing is left to cut.

    Args:
        loop: Armed and at the beginning of the row.
        end: Place of the base (m).
        limit_s: Longest time (s, simulated).

    Returns:
        Seconds of automatic work, and seconds of all else: looking, driving on by hand, bringing the arm home.
    """
    working = other = 0.0
    until = loop.now + limit_s
    while loop.now < until:
        loop.command(intents.AcceptAll(user=USER, confidence=0.0))
        if loop.controller.mode == "PAUSED":
            loop.command(intents.Resume(user=USER))
            loop.run(0.05)
        if loop.command(intents.Start(user=USER)).ok:
            begin = loop.now
            while loop.now < until and (loop.controller.mode == "AUTO" or loop.now - begin < 0.1):
                loop.run(_LOOK_S)
                # What comes into view on the way is accepted too, and worked on without a stop.
                loop.command(intents.AcceptAll(user=USER, confidence=0.0))
            working += loop.now - begin
            continue
        if place(loop) >= end:
            break
        begin = loop.now
        go_on(loop, min(_ON, end - place(loop) + 0.02))
        loop.run(_SURVEY_S)
        other += loop.now - begin
    return working, other


def place(loop: ClosedLoop) -> float:
    """How far the base has come along the row (m)."""
    odometry = loop.inbox.newest(Odometry)
    return 0.0 if odometry is None else odometry.message.pose.x


def go_on(loop: ClosedLoop, distance: float) -> None:
    """Arm home, then drive on by hand (m)."""
    if loop.command(intents.Home(user=USER)).ok:
        loop.run(0.1)
        loop.run_until(lambda: loop.state is not None and loop.state.reason != reasons.homing_arm(), _PATIENCE_S)
    begin, goal = loop.now, place(loop) + distance
    while place(loop) < goal and loop.now - begin < _PATIENCE_S:
        left = goal - place(loop)
        drive = BaseVelocity(linear=min(_SPEED, math.sqrt(0.4 * max(left, 0.0)) + 0.01), angular=0.0)
        held = TeleopTarget(sequence=round(100 * loop.now), hold=True, user=USER, base=drive)
        loop.say(held)
        loop.run(0.05)
