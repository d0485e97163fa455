"""A base and an arm that lag, driven along the row by a whole-body method; without sockets."""

import numpy as np
import pinocchio as pin

from bridge.config import OdometryConfig
from bridge.core.interface import NO_CUT, Measurement
from bridge.core.odometer import Odometer
from controller.config import ControllerConfig, WholeBodyConfig
from controller.motion.body import BaseEstimate, wheels_ahead
from controller.motion.follower import Follower, Measured
from controller.motion.tool_motion import Leg, ToolMotion
from controller.whole_body.registry import make_method
from controller.whole_body.two_rates import TwoRates
from rolling_panda import messages as m
from rolling_panda.model.robot import ARM_Q, RobotModel

ROBOT = RobotModel()
LATE = OdometryConfig(
    delay_s=0.02, position_noise=0.0003, heading_noise=0.0003, linear_noise=0.003, angular_noise=0.005
)


_LIMITS = WholeBodyConfig()


class DrivenBase:
    """0.8 m along the row and 0.1 m towards it, wheels and joints following their commands with first-order lags.

    What the controller knows of the base is `knows`: `truth`, as it is now; `told`, its true pose, and for the wheels'
    velocities what they were told; `odometry`, 50 Hz, late and noisy, as it comes; `predicted`, the same odometry and
    the wheels' velocities as the controller predicts them.
    """

    def __init__(self, rate_hz, base_rate_hz, lag=0.1, knows="predicted", limits=_LIMITS):
        self.config = ControllerConfig(rate_hz=rate_hz, base_rate_hz=base_rate_hz, whole_body=limits)
        self.dt, self.every, self.lag, self.knows = 1.0 / rate_hz, self.config.base_every, lag, knows
        arm, base = (make_method(ROBOT, self.config.whole_body, dt) for dt in (self.dt, self.dt * self.every))
        self.method = TwoRates(arm, base, self.every)
        self.follower = Follower(self.config.motion, self.method, self.dt)
        self.q, self.wheels, self.arm = np.zeros(12), np.zeros(2), np.zeros(7)
        self.q[ARM_Q] = self.config.work.home
        self.sent = self.before = np.zeros(9)
        self.record, self.errors = [], []
        self.odometer, self.odometry, self.ticks = Odometer(ROBOT.drive, LATE, self.dt), None, 0
        self.estimate = BaseEstimate(ROBOT.drive)

    def observed(self):
        q, wheels = self.q, self.wheels
        if self.knows == "told":
            wheels = None
        elif self.knows != "truth":
            q, wheels = self.from_odometry()
        self.method.start_period(self.sent, self.before, wheels)
        return Measured(q, ROBOT.kinematics(q), self.sent)

    def from_odometry(self):
        """Configuration and speeds of the wheels from the newest odometry."""
        now = self.ticks * self.dt
        speeds = np.concatenate([self.wheels, self.arm])
        self.odometer.follow(Measurement(self.q[3:].copy(), speeds, "open", "", "", NO_CUT), now)
        if self.ticks % round(0.02 / self.dt) == 0:
            self.odometer.measure(self.ticks, now, self.wheels)
        self.odometry = self.odometer.due(self.ticks) or self.odometry
        self.ticks += 1
        q = self.q.copy()
        if self.odometry is None:
            return q, self.wheels
        if self.knows == "odometry":
            pose = self.odometry.pose
            q[:3] = pose.x, pose.y, pose.phi
            return q, np.array(ROBOT.drive.wheels(self.odometry.linear, self.odometry.angular))
        joints = m.JointState(
            header=m.Header(now), sequence=1, position=tuple(q[3:]), velocity=(*self.wheels, *self.arm)
        )
        ahead = self.config.motion.arm_lag_s + 0.5 * self.dt
        wheels = wheels_ahead(self.wheels, self.sent[:2], ahead, self.lag)
        return self.estimate.configuration(joints, self.odometry), wheels

    def take(self, xi):
        self.before, self.sent = self.sent, xi
        self.record.append(xi)
        inner = round(self.dt / 0.001)
        for _ in range(inner):
            dt, q = self.dt / inner, self.q.copy()
            self.wheels = self.wheels + (xi[:2] - self.wheels) * (1.0 - np.exp(-dt / self.lag))
            self.arm = self.arm + (xi[2:] - self.arm) * (1.0 - np.exp(-dt / self.config.motion.arm_lag_s))
            q[:3] = ROBOT.drive.integrate(q[:3], *(self.wheels * dt))
            q[3:] += np.concatenate([self.wheels, self.arm]) * dt
            self.q = q

    def run(self):
        """The whole way; `errors` are the true tool's distances from its path's clock (m)."""
        T, q_goal = ROBOT.pose(self.q, ROBOT.tool_id), self.q.copy()
        q_goal[0] += 0.8
        goal = pin.SE3(T.rotation, T.translation + np.array([0.8, 0.1, 0.0]))
        motion = ToolMotion(self.config.motion, self.config.whole_body, T, self.q, [Leg(goal, q_goal, 0.3)])
        while not motion.done:
            robot = self.observed()
            wanted = motion.desired().T_odom_tool.translation
            self.errors.append(np.linalg.norm(wanted - ROBOT.pose(self.q, ROBOT.tool_id).translation))
            self.take(self.follower.follow(motion, robot).xi)
        return self
