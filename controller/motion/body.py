"""The robot as the controller knows it: estimate, tracking error, whole-body method, limits and last command."""

import math
from collections import deque
from itertools import pairwise

import numpy as np

from controller.config import ControllerConfig
from controller.identity import Token
from controller.motion.contact import CANE, ContactMonitor
from controller.motion.follower import Follower, Measured
from controller.motion.surroundings import Surroundings
from controller.whole_body.collision import CollisionModel
from controller.whole_body.compiled import COUNT, NOTHING, NUMBER, VECTOR, compiled
from controller.whole_body.obstacle import Obstacle
from controller.whole_body.registry import make_method
from controller.whole_body.saturation import Saturation
from controller.whole_body.task import Method
from controller.whole_body.two_rates import TwoRates
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.config import RobotConfig
from rolling_panda.messages.perception import Localisation, Obstacles, PruningPoints
from rolling_panda.messages.robot import JointState, Odometry
from rolling_panda.model.differential_drive import NXI, Array, DifferentialDrive, Pose
from rolling_panda.model.map_frame import MapFrame
from rolling_panda.model.robot import RobotModel
from rolling_panda.model.wire_values import actuated, vector3
from rolling_panda.transport.inbox import Inbox, Received

#: Longest extrapolation of odometry (s); older odometry is a fault.
_LONGEST = 0.1
#: Gain of the odometry correction, small so that odometry noise does not shake the tool.
_BELIEVED = 0.2
#: Spots of the way that are remembered, to go back on: at full speed 3 s.
_TRAIL = 300
#: A spot is added where the tool (m), or a joint or wheel (rad), has moved so far since the last one. Pressing in place
#: adds none, so that the way back begins with motion.
_TRAIL_TOOL, _TRAIL_JOINT = 0.0005, 0.002
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
        self.contact = ContactMonitor(config.contact, self.robot)
        #: The way here, oldest spot first: positions of ξ (9) and of the tool (3, m, odom).
        self.trail: deque[tuple[Array, Array]] = deque(maxlen=_TRAIL)
        self.measured: Measured | None = None
        #: Where odom is in map, and how the base stands, as told last.
        self.frame = MapFrame()
        #: Obstacles in odom.
        self.obstacles: Received[Obstacles] | None = None
        self._told: tuple[Received[Obstacles] | None, MapFrame] = None, self.frame
        #: The same for the obstacles, which are not converted for less than `_OBSTACLES_MOVED`.
        self._around = MapFrame()

    def update(self, inbox: Inbox) -> None:
        """Update state and obstacles from what has arrived."""
        self._locate(inbox)
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
            self.measured = Measured(q, self.robot.kinematics(q), sent, self.frame)
            self._method.start_period(sent, self.setpoints.before, wheels)
            around = self.surroundings.model.obstacles
            moves = not self.setpoints.at_rest
            self.contact.update(
                joints.message, q, self.measured.kinematics, moves, around, lambda: self._known_canes(inbox)
            )
            if moves:
                self._remember(q[3:], self.measured.kinematics.T_odom_tool.translation)
        self.surroundings.update(self.obstacles)

    def _remember(self, position: Array, tool: Array) -> None:
        """Add a spot of the way: positions of ξ (9, rad), and of the tool (3, m, odom)."""
        if self.trail:
            last, there = self.trail[-1]
            if math.dist(tool, there) < _TRAIL_TOOL and float(np.abs(position - last).max()) < _TRAIL_JOINT:
                return
        self.trail.append((position, tool))

    def _known_canes(self, inbox: Inbox) -> list[Obstacle]:
        """All standing canes that perception knows, in odom."""
        points = inbox.newest(PruningPoints)
        if points is None:
            return []
        place = self.frame.position_in_odom
        lines = [[vector3(place(np.array(each))) for each in line] for line in points.message.canes]
        return [Obstacle(CANE, CANE, start, end, _CANE_RADIUS) for line in lines for start, end in pairwise(line)]

    def _locate(self, inbox: Inbox) -> None:
        """Take in where odom is in map, and the obstacles in odom."""
        told, around, odometry = inbox.newest(Localisation), inbox.newest(Obstacles), inbox.newest(Odometry)
        if told is not None:
            self.frame = self.frame.after(told.message)
            self._around = self._around.after(told.message)
        if odometry is not None:
            self.frame = self.frame.standing(odometry.message)
            self._around = self._around.standing(odometry.message, _OBSTACLES_MOVED)
        if self._told != (around, self._around):
            self._told, self.obstacles = (around, self._around), around
            if around is not None and self._around.T_map_level is not None:
                capsules = self._around.capsules_in_odom(around.message.capsules)
                in_odom = Obstacles(header=m.Header(around.message.header.stamp, "odom"), capsules=capsules)
                self.obstacles = Received(in_odom, around.at)


#: Obstacles move with uneven ground in steps of this (m): to convert hundreds takes a part of a control period.
_OBSTACLES_MOVED = 0.003
#: Radius of a known cane of which only the course is told (m).
_CANE_RADIUS = 0.005

#: Largest tracking error of wheels and joints (rad). In motion at full speed the servos'
#: lag and the wire's take up 0.1 rad of a joint and 0.3 rad of a wheel.
WHEELS_RAD, JOINTS_RAD = 1.0, 0.35
#: Time constant of the decay of old errors (s).
_FORGETS_S = 1.0
#: Longest gap between two joint states that is integrated (s).
_GAP_S = 0.06
_LIMIT = np.array([WHEELS_RAD] * 2 + [JOINTS_RAD] * (NXI - 2))


class TrackingErrorMonitor:
    """Integrates the difference between commanded and measured velocity, on the bridge's clock."""

    def __init__(self) -> None:
        """Nothing has been sent."""
        self._behind: Array = np.zeros(NXI)
        self._stamp = -math.inf

    def update(self, joints: m.JointState, sent: Array) -> None:
        """Take in a joint state and the ξ̇ (9, rad/s) sent before it; the same one again changes nothing."""
        passed = joints.header.stamp - self._stamp
        self._stamp = joints.header.stamp
        if not 0.0 < passed <= _GAP_S:
            if passed != 0.0:
                self._behind = np.zeros(NXI)
            return
        _integrate(self._behind, sent, np.array(joints.velocity), passed)

    @property
    def reason(self) -> m.Reason | None:
        """The largest tracking error above its limit; None without one."""
        worst = _worst(self._behind, _LIMIT)
        if worst < 0:
            return None
        name = ("the left wheel", "the right wheel")[worst] if worst < 2 else f"joint {worst - 1}"
        return reasons.tracking_error(name, float(abs(self._behind[worst])), float(_LIMIT[worst]))


@compiled(NOTHING(VECTOR, VECTOR, VECTOR, NUMBER))
def _integrate(behind: Array, sent: Array, velocity: Array, passed: float) -> None:
    """Advance the tracking error `behind` (9, rad) by `passed` (s) of commands and measurements (9, rad/s)."""
    for i in range(len(behind)):
        behind[i] += passed * (sent[i] - velocity[i] - behind[i] / _FORGETS_S)


@compiled(COUNT(VECTOR, VECTOR))
def _worst(behind: Array, limit: Array) -> int:
    """Index of the tracking error (9, rad) that is furthest beyond its limit (9, rad); -1 if none is."""
    worst, excess = -1, 0.0
    for i in range(len(behind)):
        # Written so that an error that is no number counts as one.
        if not abs(behind[i]) - limit[i] <= excess:
            worst, excess = i, abs(behind[i]) - limit[i]
    return worst


#: Number of zero commands at the start of a token. The bridge requires one, and some may be lost.
_AT_REST_FIRST = 3


class Setpoints:
    """Remembers what was sent last: `sent` (9, rad/s), and `before` in the period before that."""

    def __init__(self, saturation: Saturation) -> None:
        """At rest."""
        self._saturation = saturation
        self._number = 0
        #: Sequence of the newest command that was not zero.
        self.moved = 0
        self._token: Token | None = None
        self._rest = 0
        self.sent: Array = np.zeros(NXI)
        self.before: Array = self.sent

    @property
    def at_rest(self) -> bool:
        """Whether the last commands are zero."""
        return not self.sent.any()

    def admits(self, xi: Array) -> bool:
        """Whether ξ̇ (9) is finite and within the limits, given the last command."""
        return self._saturation.admits(xi, self.sent)

    def smooth(self, xi: Array) -> Array:
        """Final check: a command that `admits` refuses becomes braking. Keeps the arm's jerk limit."""
        if not self.admits(xi):
            xi = self._saturation.brake(self.sent)
        return self._saturation.smooth(xi, self.sent, self.before)

    def command(self, xi: Array, token: Token, echo: int) -> m.MotionCommand:
        """The message for ξ̇ (9), which counts as sent; `echo` is the joint state that it was computed from."""
        if token != self._token:
            # Control changes hands at rest.
            self._token, self._rest = token, _AT_REST_FIRST if self.at_rest else 0
        if self._rest > 0:
            self._rest, xi = self._rest - 1, np.zeros(NXI)
        self.sent, self.before = xi, self.sent
        self._number += 1
        if xi.any():
            self.moved = self._number
        return m.MotionCommand(epoch=token.epoch, token=token.nonce, sequence=self._number, echo=echo, xi=actuated(xi))

    def withhold(self) -> None:
        """Nothing is sent in this period."""
        self.sent = self.before = np.zeros(NXI)
