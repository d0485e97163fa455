"""State and model of the robot: estimate, whole-body method, limits and last command."""

import numpy as np

from controller.config import ControllerConfig
from controller.motion.base_estimate import BaseEstimate, wheels_ahead
from controller.motion.follower import Follower, Measured
from controller.motion.setpoints import Setpoints
from controller.motion.surroundings import Surroundings
from controller.motion.tracking_error import TrackingErrorMonitor
from controller.whole_body.collision import CollisionModel
from controller.whole_body.registry import make_method
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import Method
from controller.whole_body.two_rates import TwoRates
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Obstacles
from rolling_panda.messages.robot import JointState, Odometry
from rolling_panda.model.robot import RobotModel
from rolling_panda.transport.inbox import Inbox


class Body:
    """State and model of one robot. Call `update` with the inputs of each control period first."""

    def __init__(self, config: ControllerConfig, robot_config: RobotConfig, method: Method | None = None) -> None:
        """Build them.

        Args:
            config: Section `[controller]`.
            robot_config: Section `[robot]`.
            method: Whole-body method in place of the configured one.

        Raises:
            ConfigError: There is no such method.
            ModelError: A robot description is missing.
        """
        self._config, self.dt = config, 1.0 / config.rate_hz
        base_dt = self.dt * config.base_every
        self.robot = RobotModel(robot_config)
        self.saturation = Saturation(self.robot, config.whole_body, self.dt, base_dt)
        self.setpoints = Setpoints(self.saturation)
        self.surroundings = Surroundings(CollisionModel(self.robot))
        arm = method or make_method(self.robot, config.whole_body, self.dt, self.surroundings.model)
        base = method or make_method(self.robot, config.whole_body, base_dt, self.surroundings.model)
        self._method = TwoRates(arm, base, config.base_every)
        self.follower = Follower(config.motion, self._method, self.dt)
        self._base = BaseEstimate(self.robot.drive)
        self.tracking_error = TrackingErrorMonitor()
        self.measured: Measured | None = None

    def update(self, inbox: Inbox) -> None:
        """Update state and obstacles from what has arrived."""
        joints, odometry = inbox.newest(JointState), inbox.newest(Odometry)
        if joints is not None:
            self.tracking_error.update(joints.message, self.setpoints.sent)
        if joints is not None and odometry is not None:
            sent = self.setpoints.sent
            q = self._base.configuration(joints.message, odometry.message)
            # The arm executes this command after its lag. It has to match the base's velocity at that time.
            ahead = self._config.motion.arm_lag_s + 0.5 * self.dt
            measured = np.array(joints.message.velocity[:2])
            wheels = wheels_ahead(measured, sent[:2], ahead, self._config.motion.base_lag_s)
            self.measured = Measured(q, self.robot.kinematics(q), sent)
            self._method.start_period(sent, self.setpoints.before, wheels)
        self.surroundings.update(inbox.newest(Obstacles))
