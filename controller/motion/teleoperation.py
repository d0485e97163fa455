"""Hold-to-run teleoperation."""

from typing import Any

import numpy as np

from controller.config import TeleoperationConfig, WorkConfig
from controller.identity import Client
from controller.motion.follower import Follower, Measured, Tracking
from rolling_panda.errors import ModelError
from rolling_panda.messages.supervision import BaseVelocity, TeleopTarget
from rolling_panda.model.differential_drive import NXI, Array, DifferentialDrive
from rolling_panda.model.robot import ARM_XI, placement
from rolling_panda.transport.inbox import Received

#: Delay of the view up to which the speed is full, and from which it is the lowest (s).
_PROMPT_S, _LATE_S, _SLOWEST = 0.25, 0.5, 0.25


class Teleoperation:
    """Checks the hold and follows its target. After any other end than its release a hold has to be pressed again."""

    def __init__(
        self, config: TeleoperationConfig, work: WorkConfig, follower: Follower, drive: DifferentialDrive
    ) -> None:
        """Bind the parts; `work` has the row's direction and the posture that the arm tends to."""
        self._config, self._follower, self._drive = config, follower, drive
        self._posture: Array = np.concatenate([[0.0, 0.0, work.row_heading, 0.0, 0.0], work.reach])
        self._newest: Received[TeleopTarget] | None = None
        self._message: TeleopTarget | None = None
        self._goal: Any = None
        self.pressed = True
        self.client = Client("", "")

    def holding(self, teleop: Received[TeleopTarget] | None, now: float) -> bool:
        """Whether the operator holds: the newest target is fresh, held and valid."""
        newest = self._newest_target(teleop)
        if newest is None or not newest.message.hold or now - newest.at > self._config.hold_max_age_s:
            self.pressed = True
            return False
        message = newest.message
        if message is not self._message:
            self._message, self._goal = message, None
            if message.target is not None:
                try:
                    self._goal = placement(message.target)
                except ModelError:
                    self._message = None
        self.client = Client(message.client or message.user, message.user)
        return self._message is not None and _means_something(message)

    def _newest_target(self, teleop: Received[TeleopTarget] | None) -> Received[TeleopTarget] | None:
        """The newest target by its number. Late or repeated ones are ignored.

        After a timeout has ended the hold any number is accepted, because a restarted server counts from one.
        """
        last = self._newest
        if teleop is not None and (
            last is None
            or teleop.message.sequence > last.message.sequence
            or teleop.at - last.at > self._config.hold_max_age_s
        ):
            self._newest = teleop
        return self._newest

    def refuse(self) -> None:
        """Void the current hold; it has to be released first."""
        self.pressed = False

    def step(self, robot: Measured) -> Tracking:
        """One period of the held motion."""
        message, xi = self._message, np.zeros(NXI)
        if message is None:
            return self._follower.jog(xi, robot)
        speed_scale = message.speed_scale * latency_speed_scale(message.round_trip_s)
        base = None if message.base is None else self._driven(message.base, speed_scale)
        if self._goal is not None:
            if base is None:
                return self._follower.seek(self._goal, self._posture, robot, self._config, speed_scale)
            return self._follower.carry(self._goal, *base, robot, self._config, speed_scale)
        if base is not None:
            xi[:2] = self._drive.wheels(*base)
        elif message.joints is not None:
            xi[ARM_XI] = speed_scale * np.array(message.joints)
        return self._follower.jog(xi, robot)

    def _driven(self, base: BaseVelocity, speed_scale: float) -> tuple[float, float]:
        """Forward velocity (m/s) and yaw rate (rad/s), slowed alike until no wheel is too fast to brake in time."""
        fastest = abs(base.linear) + abs(base.angular) * self._drive.half_track
        scale = speed_scale * min(1.0, self._config.base_speed / fastest) if fastest > 0.0 else 0.0
        return scale * base.linear, scale * base.angular


def latency_speed_scale(round_trip_s: float) -> float:
    """Speed scale by the delay of the operator's view: 1 up to 0.25 s, 0.25 from 0.5 s on."""
    slow = (round_trip_s - _PROMPT_S) / (_LATE_S - _PROMPT_S)
    return 1.0 - (1.0 - _SLOWEST) * min(max(slow, 0.0), 1.0)


def _means_something(message: TeleopTarget) -> bool:
    """Either a tool target or a base velocity or both, or joint velocities alone."""
    tool_or_base = message.target is not None or message.base is not None
    return tool_or_base != (message.joints is not None)
