"""How the base is turned in odom, from the gyroscope and accelerometer of the camera on the arm's hand.

The gyroscope tells how the camera turns, the joints how it turns on the base; what is left is the base. While the robot
stands, what the gyroscope tells is its bias. While only the wheels stand, the base does not turn: what seems to be left
then tells how the camera is turned on the hand, against what the model has. Gravity, by the accelerometer, keeps roll
and pitch from drifting; nothing keeps the heading, which drifts far less than that of wheels that slip.

Odom is level with the base where the robot was switched on, so that up is a direction that is measured there.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.robot import RobotModel

GRAVITY = 9.81
#: A wheel or joint stands while it has not turned faster than this (rad/s) for this time (s).
_STANDS, _STANDS_S = 0.005, 0.25
#: Time constants (s): of the bias while the robot stands, and of roll and pitch towards gravity, standing and moving.
_BIAS_S, _GRAVITY_S, _MOVING_GRAVITY_S = 0.5, 2.0, 20.0
#: A camera that accelerates more than this does not tell where up is (m/s²).
_SHAKEN = 0.4
#: Longest time between two samples that is integrated (s); what happens in a longer one is unknown.
_GAP_S = 0.1
#: SD of the camera's rotation on the hand (rad); the arm's turn (rad) that tells of it, and its error: of the gyroscope
#: (rad), and of its scale, as a share of the turn.
_MOUNT, _TELLS, _NOISE, _SCALE = 0.009, 0.2, 0.001, 0.005


@dataclass(frozen=True)
class Inertial:
    """A sample of the camera's inertial sensors, in its optical frame: x right, y down, z forward.

    Attributes:
        rate: Angular velocity (3, rad/s).
        force: Specific force (3, m/s²): at rest, `GRAVITY` upwards.
    """

    rate: Array
    force: Array

    @property
    def valid(self) -> bool:
        """Whether every number is one: another would spoil all that comes after it."""
        return bool(np.isfinite(self.rate).all() and np.isfinite(self.force).all())


class BaseOrientation:
    """Orientation of the base in odom. Pure: time is an argument."""

    def __init__(self, model: RobotModel) -> None:
        """Level, at heading 0, up not known yet.

        Args:
            model: Tells where the camera is; its `data` is overwritten.
        """
        self._model = model
        #: R_odom_base (3×3).
        self.R: Array = np.eye(3)
        self._q = np.zeros(3 + NXI)
        self._hand: Array | None = None
        self._at = self._rolled_at = self._moved_at = 0.0
        self._bias: Array | None = None
        self._rate: Array = np.zeros(3)
        #: Up in odom: the sum of samples before the first motion.
        self._up: Array = np.zeros(3)
        self._has_moved = False
        self._mount = _MountEstimate()

    def update(self, sample: Inertial | None, position: Array, velocity: Array, turned: float, now: float) -> Array:
        """Take in a sample; without a valid one, and before the bias is known, the base turns as its wheels say.

        Args:
            sample: The newest; None where there is none.
            position: Actuated coordinates (9, rad).
            velocity: Their velocities (9, rad/s).
            turned: By how much the base has turned since, by its wheels (rad).
            now: Time (s).

        Returns:
            R_odom_base (3×3).
        """
        self._q[3:] = position
        hand: Array = self._model.pose(self._q, self._model.camera_id).rotation.copy()
        before, passed, rate = self._hand, now - self._at, self._rate
        self._hand, self._at = hand, now
        speed = np.abs(velocity)
        if speed.max() > _STANDS:
            self._moved_at, self._has_moved = now, self._has_moved or self._bias is not None
        if speed[:2].max() > _STANDS:
            self._rolled_at = now
        stands, parked = (now - last >= _STANDS_S for last in (self._moved_at, self._rolled_at))
        by_wheels = self.R @ pin.exp3(np.array([0.0, 0.0, turned]))
        if sample is None or not sample.valid or before is None or not 0.0 < passed < _GAP_S:
            self._mount.leave()
            self.R = by_wheels
            return self.R
        self._rate = sample.rate
        if stands:
            self._learn_bias(sample.rate, passed)
        if self._bias is None:
            self.R = by_wheels
            return self.R
        turning = pin.exp3((0.5 * (rate + sample.rate) - self._bias) * passed)
        if parked:
            # Slower than the gyroscope's noise it may still creep.
            self.R = by_wheels
            self._mount.follow(before, turning, hand, stands)
        else:
            self._mount.leave()
            on_hand = self._mount.R
            self.R = self.R @ before @ on_hand @ turning @ on_hand.T @ hand.T
        force = hand @ self._mount.R @ sample.force
        if not self._has_moved:
            self._up = self._up + self.R @ force
        elif stands or not parked:
            self._to_gravity(force, passed / (_GRAVITY_S if stands else _MOVING_GRAVITY_S))
        return self.R

    def _learn_bias(self, rate: Array, passed: float) -> None:
        if self._bias is None:
            self._bias = rate.copy()
        else:
            self._bias = self._bias + min(passed / _BIAS_S, 1.0) * (rate - self._bias)

    def _to_gravity(self, force: Array, share: float) -> None:
        """Turn the base about a level axis, so that up, as it feels it, comes nearer to where it was."""
        size, up = float(np.linalg.norm(force)), float(np.linalg.norm(self._up))
        if up == 0.0 or abs(size - GRAVITY) > _SHAKEN:
            return
        self.R = pin.exp3(np.cross(self.R @ force / size, self._up / up) * share) @ self.R


class _MountEstimate:
    """How the camera is turned on the hand: least squares over motions of the arm on a base that does not turn."""

    def __init__(self) -> None:
        """As the model has it."""
        #: Rotation of the true camera on that of the model (3×3).
        self.R: Array = np.eye(3)
        self._information: Array = np.eye(3) / _MOUNT**2
        self._vector: Array = np.zeros(3)
        self._start: Array | None = None
        self._turned: Array = np.eye(3)

    def leave(self) -> None:
        """The base may turn from now on."""
        self._start = None

    def follow(self, before: Array, turning: Array, hand: Array, stands: bool) -> None:
        """The hand has turned from `before` to `hand`, the camera by `turning` (each 3×3); whether it stands."""
        if self._start is None:
            self._start, self._turned = before, np.eye(3)
        self._turned = self._turned @ turning
        angle = float(np.linalg.norm(pin.log3(self._start.T @ hand)))
        if not stands or angle < _TELLS:
            return
        # With the camera turned by a small ε, what seems to be left of the base's turn is (hand - start) ε.
        off, left = hand - self._start, pin.log3(self._start @ self._turned @ hand.T)
        weight = 1.0 / (_NOISE**2 + (_SCALE * angle) ** 2)
        self._information = self._information + weight * off.T @ off
        self._vector = self._vector + weight * off.T @ left
        self.R = pin.exp3(np.linalg.solve(self._information, self._vector))
        self._start = None
