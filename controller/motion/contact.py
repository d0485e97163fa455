"""Contact detection by the arm's external torques, and an estimate of what was touched.

The arm's estimate of external torques has offsets. It also contains the torques of the base's acceleration and tilt.
The monitor subtracts the torque of the base's acceleration and a slow average. It compares the rest with limits in
every period: the force at the tool that explains it, and the torque of each joint. When a limit is passed, it looks for
the spot of the robot at which one force explains all torques, and for the known obstacle there. In work among canes a
push of a known cane is kept apart from a contact, up to limits of its own: the robot gives way to it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from controller.config import ContactConfig
from controller.whole_body.collision_geometry import part_of, robot_geometry
from controller.whole_body.compiled import MATRIX, NOTHING, NUMBER, VECTOR, compiled
from controller.whole_body.obstacle import Obstacle, Point
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q, Kinematics, RobotModel

#: Time constants of the average that is taken away (s): in motion, during a light push, and at rest.
_MOVING_S, _PUSHED_S, _RESTING_S = 1.0, 10.0, 0.1
#: In motion the average before a touch is out of date after this time (s).
_UP_TO_DATE_S = 3.0
#: Time constant of the arm's own filter (s), with which the base's acceleration is delayed alike.
_FILTER_S = 0.01
#: Acceleration of the base below which it moves the arm by no torque worth while (m/s², rad/s²).
_STEADY = 0.005
_NOTHING = np.zeros(7)
#: Longest gap between two joint states that is integrated (s).
_GAP_S = 0.06
#: Lever (m) below which the tool's force is not resolved: the arm feels no force through its joints' axes.
_LEVER = 0.1
#: Speed of a joint or wheel below which the robot is at rest (rad/s).
_AT_REST = 0.005
#: SD of the torques that a force explains (N·m): offsets and friction, less in the wrist.
_SD = np.array([0.5, 0.5, 0.5, 0.5, 0.2, 0.2, 0.2])
#: Misfit beyond the least one, as a fraction of the torques, up to which a spot may be the touched one.
_UNSURE = 0.15
#: An obstacle farther than this from the spot was not touched (m): the camera errs, and capsules are larger than links.
_BESIDE = 0.05
#: Names of canes among the obstacles begin so.
CANE = "cane"
#: Least cosine between the force and the direction from obstacle to robot.
_TOWARDS = 0.3


@dataclass(frozen=True)
class Touch:
    """What was probably touched.

    Attributes:
        part: Of the robot.
        obstacle: Name of the known obstacle there; empty for something unknown.
        force: On the robot (3, N, odom).
        point: Where (3, m, odom).
        axis: Both ends of the obstacle's axis (m, odom); None for something unknown.
    """

    part: str
    obstacle: str
    force: Array
    point: Array
    axis: tuple[Point, Point] | None = None

    @property
    def reason(self) -> m.Reason:
        """The contact as a reason."""
        size = float(np.linalg.norm(self.force))
        if self.obstacle:
            return reasons.touched(self.part, self.obstacle, size)
        return reasons.touched_unknown(self.part, size)


class ContactMonitor:
    """Judges external torques. Call `update` with each joint state; `clear` forgets a contact."""

    def __init__(self, config: ContactConfig, robot: RobotModel) -> None:
        """Feel nothing.

        Args:
            config: Section `[controller.contact]`.
            robot: Robot model; its Pinocchio data is not touched.
        """
        self._config, self._robot = config, robot
        # Kinematics of others are in the robot's own data.
        self._data = robot.model.createData()
        self._limits = np.array([config.stop_torque] * 4 + [config.stop_torque_wrist] * 3)
        self._cane_limits = np.array([config.cane_torque] * 4 + [config.cane_torque_wrist] * 3)
        self._spots = Spots(robot)
        self._average, self._stamp = np.zeros(7), -math.inf
        #: The average before the last touch, push or work among canes; whether what pressed at rest has been taken for
        #: an offset since, and the time in motion after that (s).
        self._before: Array | None = None
        self._pressed, self._moved_s = False, 0.0
        #: Of the base: velocity forward (m/s) and yaw rate (rad/s), and the rates of both.
        self._speed = self._accelerated = (0.0, 0.0)
        #: Torques by touch (7, N·m).
        self.torque: Array = np.zeros(7)
        #: Force at the tool that explains them best (N); None without an estimate of the arm.
        self.force: float | None = None
        #: Whether the robot has told external torques before and no longer does.
        self.lost = False
        #: The contact beyond a limit, until it is cleared; None without one.
        self.touch: Touch | None = None
        #: Whether the robot is at work where the push of a known cane is no contact.
        self.gives_way = False
        #: Whether the tool is among canes. The average stays as it was before them: a push that grows slowly, or that
        #: lasts while the blades close, is a push.
        self.among = False
        #: The push of a known cane that it gives way to, until that is done; None without one.
        self.push: Touch | None = None

    @property
    def beyond(self) -> bool:
        """Whether a limit is passed now."""
        return self.load >= 1.0

    @property
    def load(self) -> float:
        """What is felt as a share of the limits of a contact, of which the first is at 1; 0 without an estimate."""
        if self.force is None:
            return 0.0
        return max(self.force / self._config.stop_force, float((np.abs(self.torque) / self._limits).max()))

    def _passes(self, force: float, torques: Array) -> bool:
        """Whether the force at the tool (N) or the torque of a joint (7, N·m) is beyond these limits now."""
        return self.force is not None and (self.force >= force or bool((np.abs(self.torque) >= torques).any()))

    def update(
        self,
        joints: m.JointState,
        q: Array,
        kinematics: Kinematics,
        moves: bool,
        obstacles: Sequence[Obstacle],
        canes: Callable[[], Sequence[Obstacle]] = tuple,
    ) -> None:
        """Take in a joint state; the same one again changes nothing.

        Args:
            joints: With the external torques.
            q: Configuration (12) at its time.
            kinematics: At q.
            moves: Whether the robot is commanded to move: at rest it is being touched, but touches nothing.
            obstacles: What is known around.
            canes: Gives all known canes, those included that are no obstacles.
        """
        passed = joints.header.stamp - self._stamp
        if passed == 0.0:
            return
        self._stamp = joints.header.stamp
        if joints.external_torque is None:
            self.lost, self.force = self.lost or self.force is not None, None
            return
        begins = self.force is None or not 0.0 < passed <= _GAP_S
        self.lost = False
        raw = np.array(joints.external_torque) + self._by_base(joints, q, passed, begins)
        rests = not moves and max(map(abs, joints.velocity)) < _AT_REST
        if begins:
            self._average[:] = raw
        force = _felt(raw, self._average, kinematics.J[:3, ARM_Q], self.torque)
        if self._pressed and moves and force >= self._config.light_force and self._before is not None:
            # What pressed at rest counted as none; once it is gone it is no push the other way.
            unpressed = np.zeros(7)
            released = _felt(raw, self._before, kinematics.J[:3, ARM_Q], unpressed)
            if released < force:
                force, self.torque, self._pressed = released, unpressed, False
                self._average[:] = self._before
        self.force = force
        if self.touch is None and moves and self.beyond:
            self._judge(q, obstacles, canes)
        if self.touch is not None or self.push is not None or self.among:
            if not self._pressed:
                self._before = self._average.copy()
            return
        if rests and force >= self._config.light_force:
            self._pressed, self._moved_s = True, 0.0
        elif moves:
            self._moved_s += passed
            self._pressed = self._pressed and self._moved_s < _UP_TO_DATE_S
        lasts = _RESTING_S if rests else _MOVING_S if force < self._config.light_force else _PUSHED_S
        _follow(self._average, raw, passed / lasts)

    def _judge(self, q: Array, obstacles: Sequence[Obstacle], canes: Callable[[], Sequence[Obstacle]]) -> None:
        """Tell a contact from the push of a known cane at q (12), of which the force counts, and not its lever."""
        hard = self._passes(self._config.cane_force, self._cane_limits)
        if self.push is not None and not hard:
            return
        known = tuple(canes()) if self.gives_way else ()
        touch = self._spots.touched(q, self.torque, (*obstacles, *known))
        if not self.gives_way or hard or not touch.obstacle.startswith(CANE):
            self.touch = touch
        elif self.force is not None and self.force >= self._config.stop_force:
            self.push = touch

    def clear(self) -> None:
        """Forget the contact. At rest the robot feels itself anew: what still presses then counts as none."""
        self.touch = None

    def gave_way(self, free: bool) -> None:
        """The robot has given way to a push; where it is not free of it, that is a contact."""
        self.push, self.touch = None, self.touch if free else self.push

    def _by_base(self, joints: m.JointState, q: Array, passed: float, begins: bool) -> Array:
        """Torques (7, N·m) that moved the arm along with the base, of which the arm's estimate knows nothing."""
        v, omega = self._robot.drive.twist(joints.velocity[0], joints.velocity[1])
        forward, turning = (0.0, 0.0) if begins else self._accelerated
        if not begins:
            share = 1.0 - math.exp(-passed / _FILTER_S)
            forward += share * ((v - self._speed[0]) / passed - forward)
            turning += share * ((omega - self._speed[1]) / passed - turning)
        self._speed, self._accelerated = (v, omega), (forward, turning)
        if abs(forward) < _STEADY and abs(turning) < _STEADY and abs(v * omega) < _STEADY:
            return _NOTHING
        c, s = math.cos(q[2]), math.sin(q[2])
        acceleration = np.array([c * forward - s * v * omega, s * forward + c * v * omega, turning])
        M = pin.crba(self._robot.model, self._data, q)
        torque: Array = acceleration @ M[:3, ARM_Q]
        return torque


@compiled(NUMBER(VECTOR, VECTOR, MATRIX, VECTOR))
def _felt(raw: Array, average: Array, J: Array, torque: Array) -> float:
    """Write torque = raw − average (7) and return |f| of the force that solves min |Jᵀ f − torque|² + λ²|f|²."""
    for i in range(7):
        torque[i] = raw[i] - average[i]
    # J Jᵀ + λ², symmetric, and J torque.
    a = b = c = d = e = g = x = y = z = 0.0
    for i in range(7):
        a += J[0, i] * J[0, i]
        b += J[0, i] * J[1, i]
        c += J[0, i] * J[2, i]
        d += J[1, i] * J[1, i]
        e += J[1, i] * J[2, i]
        g += J[2, i] * J[2, i]
        x += J[0, i] * torque[i]
        y += J[1, i] * torque[i]
        z += J[2, i] * torque[i]
    a, d, g = a + _LEVER * _LEVER, d + _LEVER * _LEVER, g + _LEVER * _LEVER
    # Its inverse by cofactors.
    A, B, C = d * g - e * e, c * e - b * g, b * e - c * d
    D, E, G = a * g - c * c, b * c - a * e, a * d - b * b
    determinant = a * A + b * B + c * C
    fx, fy, fz = A * x + B * y + C * z, B * x + D * y + E * z, C * x + E * y + G * z
    return math.sqrt(fx * fx + fy * fy + fz * fz) / determinant


@compiled(NOTHING(VECTOR, VECTOR, NUMBER))
def _follow(average: Array, raw: Array, share: float) -> None:
    """Let the average (7) go towards raw (7)."""
    for i in range(7):
        average[i] += min(share, 1.0) * (raw[i] - average[i])


class Spots:
    """Spots of arm and tool that may be touched: spheres along the axes of their capsules.

    Attributes:
        parts: Part of the robot that each is on (n).
        joints: Joint of the Pinocchio model that carries it (n).
        radii: (n, m).
    """

    def __init__(self, robot: RobotModel) -> None:
        """Spread them over arm and tool."""
        self._robot, self._data = robot, robot.model.createData()
        geometry = robot_geometry(robot)
        spots: list[tuple[str, int, Array, float]] = []
        first = int(robot.model.joints[robot.model.getJointId("panda_joint1")].id)
        for item in geometry.geometryObjects:
            if item.parentJoint < first or not isinstance(item.geometry, pin.coal.Capsule):
                continue
            radius, half = float(item.geometry.radius), float(item.geometry.halfLength)
            axis = item.placement.rotation[:, 2]
            for along in np.linspace(-half, half, 1 + math.ceil(2.0 * half / max(radius, 0.02))):
                spots.append((part_of(item.name), item.parentJoint, item.placement.translation + along * axis, radius))
        self.parts = [part for part, *_ in spots]
        self.joints = [joint for _, joint, *_ in spots]
        self._local = np.array([place for *_, place, _ in spots])
        self.radii = np.array([radius for *_, radius in spots])
        # Which of the arm's joints move a spot.
        order = {joint: index for index, joint in enumerate(range(first, first + 7))}
        self._moved = np.array([[index <= order[joint] for index in range(7)] for joint in self.joints], float)

    def at(self, q: Array) -> tuple[Array, Array]:
        """Middles at q (12) (n×3, m, odom), and velocity of each by each of the arm's joints (n×7×3)."""
        pin.computeJointJacobians(self._robot.model, self._data, q)
        spots = np.array(
            [self._data.oMi[joint].act(place) for joint, place in zip(self.joints, self._local, strict=True)]
        )
        J = self._data.J[:, ARM_Q]
        velocities: Array = (J[:3].T[None] + np.cross(J[3:].T[None], spots[:, None])) * self._moved[:, :, None]
        return spots, velocities

    def touched(self, q: Array, torque: Array, obstacles: Sequence[Obstacle]) -> Touch:
        """Where one force explains torques (7, N·m) best at q (12), and the known obstacle there."""
        spots, velocities = self.at(q)
        A = velocities / _SD[:, None]
        wanted = torque / _SD
        normal = A.transpose(0, 2, 1) @ A + 1e-2 * np.eye(3)
        forces = np.linalg.solve(normal, A.transpose(0, 2, 1) @ wanted[:, None])[:, :, 0]
        misfits = np.linalg.norm((A @ forces[:, :, None])[:, :, 0] - wanted, axis=1) / float(np.linalg.norm(wanted))
        likely = np.flatnonzero(misfits <= misfits.min() + _UNSURE)
        spot, beside = self._beside(spots, forces, likely, obstacles)
        if beside is None:
            spot = int(misfits.argmin())
        force = forces[spot]
        inwards = force / max(float(np.linalg.norm(force)), 1e-9)
        name, axis = ("", None) if beside is None else (beside.name, (beside.start, beside.end))
        return Touch(self.parts[spot], name, force, spots[spot] - self.radii[spot] * inwards, axis)

    def _beside(
        self, spots: Array, forces: Array, likely: Any, obstacles: Sequence[Obstacle]
    ) -> tuple[int, Obstacle | None]:
        """The likely spot nearest to an obstacle that its force comes from, and that obstacle; None without one."""
        if not obstacles:
            return 0, None
        start = np.array([o.start for o in obstacles])
        along = np.array([o.end for o in obstacles]) - start
        around = np.array([o.radius for o in obstacles])
        offset = spots[likely, None] - start[None]
        place = np.clip((offset * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-12), 0.0, 1.0)
        offset -= place[:, :, None] * along
        distance = np.linalg.norm(offset, axis=2)
        gaps = distance - self.radii[likely, None] - around
        size = np.maximum(np.linalg.norm(forces[likely], axis=1), 1e-9)
        towards = (offset * forces[likely, None]).sum(axis=2) / np.maximum(distance, 1e-9) / size[:, None]
        gaps[towards < _TOWARDS] = np.inf
        row, column = np.unravel_index(int(gaps.argmin()), gaps.shape)
        return (int(likely[row]), obstacles[int(column)]) if gaps[row, column] < _BESIDE else (0, None)
