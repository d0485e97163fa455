"""Hold-to-run: the tool follows the gizmo only while it is held."""

import numpy as np

from controller.config import ControllerConfig
from controller.interface import Sample
from controller.motion import Follower, Measured, Tracking
from rolling_panda import messages as m
from rolling_panda.differential_drive import Array
from rolling_panda.errors import ModelError
from rolling_panda.robot_model import placement


class Teleoperation:
    """Watches the hold and follows its target. A hold must be pressed anew after anything else has ended it."""

    def __init__(self, config: ControllerConfig, follower: Follower) -> None:
        """Bind the parts."""
        self._config, self._follower = config, follower
        self._posture: Array = np.concatenate([[0.0, 0.0, config.row_heading, 0.0, 0.0], config.reach])
        self._goal: object = None
        self._target: m.Pose | None = None
        self.pressed = True
        self.user = ""

    def holding(self, teleop: Sample[m.TeleopTarget] | None, now: float) -> bool:
        """Whether the operator holds now: the newest target says so and is fresh."""
        held = teleop is not None and teleop.message.hold and now - teleop.at <= self._config.hold_max_age_s
        if teleop is None or not held:
            self.pressed = True
            return False
        if teleop.message.target is not self._target:
            self._target = teleop.message.target
            try:
                self._goal = placement(self._target)
            except ModelError:
                self._goal = None
        self.user = teleop.message.user
        return self._goal is not None

    def refuse(self) -> None:
        """What is held now counts no more; it must be released first."""
        self.pressed = False

    def step(self, robot: Measured) -> Tracking:
        """One period towards the target."""
        return self._follower.seek(self._goal, self._posture, robot, self._config.teleop_base)
