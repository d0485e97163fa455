"""Where the base is now, from wheels that are known at once and odometry that comes late and is noisy."""

import math
from collections import deque

import numpy as np

from rolling_panda import messages as m
from rolling_panda.differential_drive import Array, DifferentialDrive

#: Odometry is carried forward by no more than this (s); older odometry is a fault, not something to guess from.
_LONGEST = 0.1
#: Share of what odometry says otherwise that is believed at once: its noise must not shake the tool.
_BELIEVED = 0.2
#: What odometry says further away than this (m, rad) is no noise: the estimate begins anew.
_ELSEWHERE = 0.05


def wheels_ahead(wheels: Array, sent: Array, ahead: float, lag: float) -> Array:
    """Velocities that the wheels will have (2, rad/s): they follow their command with a first-order lag.

    Args:
        wheels: As measured (2, rad/s).
        sent: What they were told last (2, rad/s).
        ahead: How far to look (s).
        lag: Time constant (s); 0 takes them for what they were told.
    """
    left = math.exp(-ahead / lag) if lag > 0.0 else 0.0
    later: Array = sent + (wheels - sent) * left
    return later


class BaseEstimate:
    """The base's pose at the time of the joint states: p̂ = p + what the wheels have turned since odometry's p was true.

    The stamps of joint states and odometry are of one clock, the sender's, so that their difference holds whatever the
    wire's delay is.
    """

    def __init__(self, drive: DifferentialDrive) -> None:
        """Know nothing yet; `drive` is the base's geometry."""
        self._drive = drive
        #: Of the last joint states: stamp, the wheels' angles and the pose by the wheels alone, in a frame of its own.
        self._past: deque[tuple[float, Array, Array]] = deque()
        #: That frame in odom: x, y, turn.
        self._frame = (0.0, 0.0, 0.0)
        self._odometry: m.Odometry | None = None

    def configuration(self, joints: m.JointState, odometry: m.Odometry) -> Array:
        """Q (12) at the time of the joint state."""
        q = np.empty(12)
        q[3:] = joints.position
        stamp = joints.header.stamp
        self._roll(stamp, q[3:5], odometry)
        if odometry is not self._odometry:
            self._odometry = odometry
            self._correct(odometry, stamp)
        q[:3] = self._in_odom(self._past[-1][2])
        return q

    def _roll(self, stamp: float, wheels: Array, odometry: m.Odometry) -> None:
        """Go on by what the wheels have turned."""
        past = self._past
        if past and stamp < past[-1][0]:
            past.clear()
        if past and stamp == past[-1][0]:
            return
        if past:
            _, before, pose = past[-1]
            pose = self._drive.integrate(pose, float(wheels[0] - before[0]), float(wheels[1] - before[1]))
        else:
            pose, self._frame = self._carried(odometry, stamp), (0.0, 0.0, 0.0)
        past.append((stamp, wheels.copy(), pose))
        while past[0][0] < stamp - _LONGEST:
            past.popleft()

    def _correct(self, odometry: m.Odometry, stamp: float) -> None:
        """Move the frame by what the odometry says of the pose at its time, compared with what was believed."""
        then = odometry.header.stamp
        known = next((entry for entry in reversed(self._past) if entry[0] <= then), None)
        if known is None or stamp - then > _LONGEST:
            return
        at, _, rolled = known
        believed = self._in_odom(rolled)
        wrong = self._carried(odometry, at) - believed
        wrong[2] = math.remainder(wrong[2], math.tau)
        share = 1.0 if float(np.abs(wrong).max()) > _ELSEWHERE else _BELIEVED
        x, y, _ = (believed + share * wrong).tolist()
        turn = self._frame[2] + share * float(wrong[2])
        c, s = math.cos(turn), math.sin(turn)
        rolled_x, rolled_y, _ = rolled.tolist()
        self._frame = (x - c * rolled_x + s * rolled_y, y - s * rolled_x - c * rolled_y, turn)

    def _in_odom(self, rolled: Array) -> Array:
        x, y, turn = self._frame
        c, s = math.cos(turn), math.sin(turn)
        rolled_x, rolled_y, phi = rolled.tolist()
        return np.array([x + c * rolled_x - s * rolled_y, y + s * rolled_x + c * rolled_y, phi + turn])

    def _carried(self, odometry: m.Odometry, stamp: float) -> Array:
        """Odometry's pose carried along its arc to a stamp, earlier or later."""
        ahead = min(max(stamp - odometry.header.stamp, -_LONGEST), _LONGEST)
        left, right = self._drive.wheels(odometry.linear * ahead, odometry.angular * ahead)
        pose = odometry.pose
        return self._drive.integrate(np.array([pose.x, pose.y, pose.phi]), left, right)
