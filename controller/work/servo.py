"""Servoing on the last way in: the motion to a cut is corrected to where pictures on the way show its cane.

The pictures are averaged with the close-up before them, each by how much it may be wrong. The camera measures no depth
from nearer than 0.18 m, so that the last one is taken about a second before the blades have closed: a cane that sways
is then anywhere on its way, and most likely near the mean of where it was seen. A correction is square to the cane. It
is bounded by `servo_reach`, which is the margin of the check between the closing blades, and by the speed of the last
part. Distances from wood were checked where the close-up has seen the cut; the guards keep them on the way. Without
pictures, and with those that tell nothing or come late, the motion stays as it is.
"""

import math
from dataclasses import dataclass

import numpy as np

from controller.config import WorkConfig
from controller.motion.follower import Measured
from controller.motion.tool_motion import ToolMotion
from rolling_panda import reasons
from rolling_panda.messages.perception import CutSight
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import Array

#: SD of where the close-up has a cane, sway included (m).
_BEFORE = 0.003
#: SD of the angle by which the camera is turned wrongly (rad): what it sees far away is off by more.
_TURNED = 0.006
#: SD of the time between a picture and the posture that is told with it (s): the tool moves meanwhile.
_LATE = 0.010
#: Distance of the camera from the middle of the blades (m).
_CAMERA = 0.155
#: Smaller corrections are left (m).
_LEAST = 0.0005


@dataclass(frozen=True)
class _Asked:
    """A picture that was asked for: when (s), and how far from the cut (m) and how fast (m/s) the tool was."""

    at: float
    away: float
    speed: float


class CutServo:
    """What the pictures on the way to one cut have shown. Pure: time is an argument."""

    def __init__(self, config: WorkConfig) -> None:
        """Bind the configuration; nothing is followed."""
        self._config = config
        self.end()

    def begin(self, point_id: str, place: Array, rotation: Array) -> None:
        """Follow a point.

        Args:
            point_id: The point.
            place: Where the close-up has seen it (3, m, odom).
            rotation: Of the tool at the cut (3×3, odom).
        """
        self.point_id = point_id if self._config.servo else ""
        self._place, self._across = place.copy(), rotation[:, [0, 2]].copy()
        self._aside, self._variance, self._made = np.zeros(2), np.full(2, _BEFORE**2), np.zeros(2)
        self._asked: dict[int, _Asked] = {}
        self._seen_at: float | None = None
        self._away, self._speed, self._next = 0.0, 0.0, -math.inf

    def carry(self, by: Array) -> None:
        """The cut is elsewhere in odom (by, 3, m), as the base rolls over uneven ground."""
        self._place = self._place + by

    def end(self) -> None:
        """Follow nothing."""
        self.begin("", np.zeros(3), np.eye(3))

    def due(self, now: float) -> bool:
        """Whether to ask for the next picture."""
        return bool(self.point_id) and self._away > self._config.servo_until and now >= self._next

    def asked(self, number: int, now: float) -> None:
        """A picture was asked for."""
        self._asked[number] = _Asked(now, self._away, self._speed)
        self._next = now + 1.0 / self._config.servo_rate_hz

    def update(self, sight: CutSight, now: float) -> None:
        """Take in what a picture has shown. One that tells nothing, tells of a jump or is too old changes nothing."""
        asked = self._asked.pop(sight.number, None)
        if asked is None or sight.point_id != self.point_id or sight.position is None or sight.covariance is None:
            return
        if now - asked.at > self._config.servo_max_age_s:
            return
        seen = (np.array(sight.position) - self._place) @ self._across
        if float(np.linalg.norm(seen - self._aside)) > self._config.servo_jump:
            return
        xx, xy, xz, yy, yz, zz = sight.covariance
        noise = self._across.T @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ self._across
        variance = np.diag(noise) + (_TURNED * (asked.away + _CAMERA)) ** 2
        # The second axis is that of the approach.
        variance += [0.0, (_LATE * asked.speed) ** 2]
        gain = self._variance / (self._variance + variance)
        self._aside = self._aside + gain * (seen - self._aside)
        self._variance = (1.0 - gain) * self._variance
        self._seen_at = asked.at

    def told(self, now: float) -> Reason | None:
        """How old the estimate is on which the blades close; None where no pictures are asked for on the way."""
        if not self.point_id:
            return None
        if self._seen_at is None:
            return reasons.blades_close_unseen(self.point_id)
        return reasons.blades_close_where_seen(self.point_id, now - self._seen_at)

    def correct(self, motion: ToolMotion, robot: Measured) -> None:
        """Lead the rest of the motion to the present estimate, one correction after the other."""
        if not self.point_id:
            return
        self._away = math.dist(robot.kinematics.T_odom_tool.translation, motion.goal.translation)
        self._speed = float(np.linalg.norm(robot.kinematics.J_xi[:3] @ robot.sent))
        if motion.correcting:
            return
        length = float(np.linalg.norm(self._aside))
        wanted = self._aside * min(1.0, self._config.servo_reach / max(length, 1e-9))
        if float(np.linalg.norm(wanted - self._made)) >= _LEAST:
            motion.shift(self._across @ (wanted - self._made))
            self._made = wanted
