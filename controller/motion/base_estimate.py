"""Base pose estimate from wheel angles and delayed, noisy odometry."""

import math
from collections import deque

import numpy as np

from rolling_panda import messages as m
from rolling_panda.model.differential_drive import Array, DifferentialDrive, Pose

#: Longest extrapolation of odometry (s); older odometry is a fault.
_LONGEST = 0.1
#: Gain of the odometry correction, small so that odometry noise does not shake the tool.
_BELIEVED = 0.2
#: A larger difference from the odometry (m, rad) is no noise: the estimate is reset.
_ELSEWHERE = 0.05


def wheels_ahead(wheels: Array, sent: Array, ahead: float, lag: float) -> Array:
    """Predicted velocities of the wheels (2, rad/s), which follow their command with a first-order lag.

    Args:
        wheels: As measured (2, rad/s).
        sent: Last command (2, rad/s).
        ahead: Prediction horizon (s).
        lag: Time constant (s); 0 returns the command.
    """
    left = math.exp(-ahead / lag) if lag > 0.0 else 0.0
    return np.array([told + (now - told) * left for now, told in zip(wheels.tolist(), sent.tolist(), strict=True)])


class BaseEstimate:
    """Base pose at the time of the newest joint state: odometry pose p plus the wheel motion since its time stamp.

    Joint states and odometry have stamps of one clock, the sender's. So their difference does not depend on the delay
    of the connection.
    """

    def __init__(self, drive: DifferentialDrive) -> None:
        """Know nothing yet; `drive` is the base's geometry."""
        self._drive = drive
        #: Recent joint states: stamp, wheel angles, and the pose integrated from the wheels alone, in its own frame.
        self._past: deque[tuple[float, float, float, Pose]] = deque()
        #: That frame in odom: x, y, turn.
        self._frame: Pose = (0.0, 0.0, 0.0)
        self._odometry: m.Odometry | None = None

    def configuration(self, joints: m.JointState, odometry: m.Odometry) -> Array:
        """Q (12) at the time of the joint state."""
        q = np.empty(12)
        q[3:] = joints.position
        stamp = joints.header.stamp
        self._roll(stamp, joints.position[0], joints.position[1], odometry)
        if odometry is not self._odometry:
            self._odometry = odometry
            self._correct(odometry, stamp)
        q[:3] = self._in_odom(self._past[-1][3])
        return q

    def _roll(self, stamp: float, left: float, right: float, odometry: m.Odometry) -> None:
        """Integrate the motion of the wheels."""
        past = self._past
        if past and stamp < past[-1][0]:
            past.clear()
        if past and stamp == past[-1][0]:
            return
        if past:
            _, left_before, right_before, pose = past[-1]
            pose = self._drive.rolled(pose, left - left_before, right - right_before)
        else:
            pose, self._frame = self._carried(odometry, stamp), (0.0, 0.0, 0.0)
        past.append((stamp, left, right, pose))
        while past[0][0] < stamp - _LONGEST:
            past.popleft()

    def _correct(self, odometry: m.Odometry, stamp: float) -> None:
        """Correct the frame by the difference of odometry and estimate at the time of the odometry."""
        then = odometry.header.stamp
        known = next((entry for entry in reversed(self._past) if entry[0] <= then), None)
        if known is None or stamp - then > _LONGEST:
            return
        at, _, _, (rolled_x, rolled_y, rolled_phi) = known
        x, y, phi = self._in_odom((rolled_x, rolled_y, rolled_phi))
        x_said, y_said, phi_said = self._carried(odometry, at)
        wrong = x_said - x, y_said - y, math.remainder(phi_said - phi, math.tau)
        gain = 1.0 if max(map(abs, wrong)) > _ELSEWHERE else _BELIEVED
        x, y, turn = x + gain * wrong[0], y + gain * wrong[1], self._frame[2] + gain * wrong[2]
        c, s = math.cos(turn), math.sin(turn)
        self._frame = (x - c * rolled_x + s * rolled_y, y - s * rolled_x - c * rolled_y, turn)

    def _in_odom(self, rolled: Pose) -> Pose:
        x, y, turn = self._frame
        c, s = math.cos(turn), math.sin(turn)
        rolled_x, rolled_y, phi = rolled
        return x + c * rolled_x - s * rolled_y, y + s * rolled_x + c * rolled_y, phi + turn

    def _carried(self, odometry: m.Odometry, stamp: float) -> Pose:
        """Odometry's pose carried along its arc to a stamp, earlier or later."""
        ahead = min(max(stamp - odometry.header.stamp, -_LONGEST), _LONGEST)
        left, right = self._drive.wheels(odometry.linear * ahead, odometry.angular * ahead)
        pose = odometry.pose
        return self._drive.rolled((pose.x, pose.y, pose.phi), left, right)
