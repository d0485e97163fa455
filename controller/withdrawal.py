"""Out of the canes by the arm's joints, where something holds the tool on the straight way back."""

from controller.config import ControllerConfig
from controller.motion import ArmMotion, Follower, Measured, Tracking
from controller.patience import Patience
from rolling_panda.differential_drive import Array
from rolling_panda.robot_model import ARM_Q

#: The posture is reached (rad).
_NEAR = 0.01


class Withdrawal:
    """One way out with the base still: each joint goes straight to where the way in began, and so away from its limit.

    Obstacles are kept clear of as ever; the blades leave the line by which they came in, by some centimetres at most.
    """

    def __init__(self, config: ControllerConfig, follower: Follower, q: Array, q_clear: Array) -> None:
        """Plan from q (12) to the arm posture of `q_clear` (12), clear of the canes."""
        self._follower, self._dt = follower, 1.0 / config.rate_hz
        self._goal = q_clear[ARM_Q].copy()
        self._motion = ArmMotion(config, q[ARM_Q].copy(), self._goal)
        self._patience = Patience(config.reach_timeout_s, self._dt)
        self._patience.begin(self._motion.duration)
        #: Whether the arm is there, and whether waiting for it is of no use any longer.
        self.done = self.late = False

    def step(self, robot: Measured, now: float) -> Tracking:
        """One period."""
        tracking = self._motion.step(robot, self._follower, self._dt)
        self._patience.note(tracking)
        self._patience.over(tracking, now, 0.0)
        self.done = self._motion.done and float(abs(robot.q[ARM_Q] - self._goal).max()) < _NEAR
        self.late = not self.done and self._patience.late(now)
        return tracking
