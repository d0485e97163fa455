"""How the base is turned in odom, from the gyroscope and accelerometer of the camera on the arm's hand.

The gyroscope measures the rotation of the camera, and the joints its rotation on the base. The difference is the
rotation of the base. While the robot is at rest the gyroscope measures its own bias. While only the wheels are at rest
the base does not rotate: the difference is then an error of the camera's mounting, which is estimated. The
accelerometer corrects the drift of roll and pitch. The heading is not corrected; it drifts far less than that of wheels
that slip.

Odom is level with the base where the robot was switched on. The direction of gravity in odom is measured there.
"""

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.robot import RobotModel

GRAVITY = 9.81
#: A wheel or joint stands while it has not turned faster than this (rad/s) for this time (s).
_STANDS, _STANDS_S = 0.005, 0.25
#: The bias is a mean over this time of standing at most, and known after this time (s).
_BIAS_S, _KNOWN_S = 2.0, 0.25
#: Time constants of roll and pitch towards gravity, standing and moving (s).
_GRAVITY_S, _MOVING_GRAVITY_S = 2.0, 20.0
#: A camera that accelerates more than this does not tell where up is (m/s²).
_SHAKEN = 0.4
#: Longest time between two samples that is integrated (s); what happens in a longer one is unknown.
_GAP_S = 0.1
#: Without a sample for this time the orientation is no longer measured (s).
_LOST_S = 0.2
#: SD of the camera's rotation on the hand (rad); the arm's turn (rad) that tells of it, and its error: of the gyroscope
#: (rad), and of its scale, as a share of the turn. What is farther off than so many SD is no error of the mount.
_MOUNT, _TELLS, _NOISE, _SCALE, _PLAUSIBLE = 0.009, 0.2, 0.001, 0.005, 4.0


@dataclass(frozen=True)
class Inertial:
    """A sample of the camera's inertial sensors, in its optical frame: x right, y down, z forward.

    Attributes:
        at: On the sensors' own clock (s).
        rate: Angular velocity (3, rad/s), the mean since the sample before.
        force: Specific force (3, m/s²): at rest, `GRAVITY` upwards.
    """

    at: float
    rate: Array
    force: Array


class _Felt:
    """What the sensors have measured over some samples."""

    def __init__(self, last: Inertial | None = None) -> None:
        """Nothing since the `last` sample."""
        self._last = last
        #: Rotation of the camera (3×3), with the gyroscope's bias, over a time (s).
        self.turning: Array = np.eye(3)
        self.span = 0.0
        #: A sample is missing, or no number.
        self.broken = False
        self._forces: Array = np.zeros(3)

    @property
    def force(self) -> Array:
        """Mean specific force (3, m/s²)."""
        return self._forces / self.span

    def anew(self) -> "_Felt":
        """Nothing since the newest sample."""
        return _Felt(self._last)

    def add(self, sample: Inertial | None) -> None:
        """Take in a sample; one that is told again changes nothing."""
        last, self._last = self._last, sample
        if sample is None or not (np.isfinite(sample.rate).all() and np.isfinite(sample.force).all()):
            self._last, self.broken = None, True
        elif last is None or not 0.0 <= sample.at - last.at < _GAP_S:
            self.broken = True
        elif (passed := sample.at - last.at) > 0.0:
            self.turning = self.turning @ pin.exp3(sample.rate * passed)
            self._forces = self._forces + sample.force * passed
            self.span += passed


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
        #: Whether it is measured now; else roll and pitch are what they were.
        self.measured = False
        self._q = np.zeros(3 + NXI)
        self._felt = _Felt()
        #: R_base_hand where samples were taken in last; None after a gap.
        self._hand: Array | None = None
        self._measured_at = -math.inf
        self._rolled_at: float | None = None
        #: Turn by the wheels since the last sample (rad).
        self._turned = 0.0
        self._moved_at = 0.0
        self._bias: Array = np.zeros(3)
        #: How long the bias was averaged (s).
        self._stood = 0.0
        #: Up in odom: the sum of samples before the first motion.
        self._up: Array = np.zeros(3)
        self._has_moved = False
        self._mount = _MountEstimate()

    def feel(self, sample: Inertial | None) -> None:
        """Take in a sample of sensors that are read more often than `update` is called.

        What shakes the hand faster than that is then not taken for a turn of the base.
        """
        self._felt.add(sample)

    def update(self, sample: Inertial | None, position: Array, velocity: Array, turned: float, now: float) -> Array:
        """Take in the samples since the last call; without valid ones the base turns as its wheels say.

        So it does before the bias is known.

        Args:
            sample: The newest; None where there is none.
            position: Actuated coordinates (9, rad).
            velocity: Their velocities (9, rad/s).
            turned: By how much the base has turned since, by its wheels (rad).
            now: Time (s).

        Returns:
            R_odom_base (3×3).
        """
        self._felt.add(sample)
        speed = np.abs(velocity)
        if self._rolled_at is None:
            self._rolled_at = self._moved_at = now
        # A speed that is no number counts as motion.
        if not speed.max() <= _STANDS:
            self._moved_at, self._has_moved = now, self._has_moved or self._stood >= _KNOWN_S
        if not speed[:2].max() <= _STANDS:
            self._rolled_at = now
        self._turned += turned if math.isfinite(turned) else 0.0
        if self._felt.broken or not np.isfinite(position).all():
            self._hand, self._felt = None, self._felt.anew()
            self._mount.leave()
            self._by_wheels()
        elif self._felt.span > 0.0:
            self._integrate(position, now)
            self._turned = 0.0
        self.measured = now - self._measured_at < _LOST_S
        return self.R

    def _by_wheels(self) -> None:
        self.R = self.R @ pin.exp3(np.array([0.0, 0.0, self._turned]))
        self._turned = 0.0

    def _integrate(self, position: Array, now: float) -> None:
        self._q[3:] = position
        hand: Array = self._model.pose(self._q, self._model.camera_id).rotation.copy()
        before, self._hand = self._hand, hand
        felt, self._felt = self._felt, self._felt.anew()
        if before is None:
            self._mount.leave()
            self._by_wheels()
            return
        assert self._rolled_at is not None
        stands, parked = now - self._moved_at >= _STANDS_S, now - self._rolled_at >= _STANDS_S
        turn = pin.log3(felt.turning)
        if stands:
            self._learn_bias(turn / felt.span, felt.span)
        if self._stood < _KNOWN_S:
            self._by_wheels()
            return
        self._measured_at = now
        turning = pin.exp3(turn - self._bias * felt.span)
        if parked:
            # Slower than the gyroscope's noise it may still creep.
            self._by_wheels()
            self._mount.follow(before, turning, hand, stands)
        else:
            self._mount.leave()
            on_hand = self._mount.R
            self.R = self.R @ before @ on_hand @ turning @ on_hand.T @ hand.T
        force = hand @ self._mount.R @ felt.force
        if not self._has_moved:
            self._up = self._up + self.R @ force
        elif stands or not parked:
            self._to_gravity(force, felt.span / (_GRAVITY_S if stands else _MOVING_GRAVITY_S))

    def _learn_bias(self, rate: Array, passed: float) -> None:
        self._stood += passed
        self._bias = self._bias + passed / min(self._stood, _BIAS_S) * (rate - self._bias)

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
        self._turn: Array = np.zeros(3)
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
        self._start = None
        variance = _NOISE**2 + (_SCALE * angle) ** 2
        surprise = float(np.linalg.norm(left - off @ self._turn))
        # Not an error of the mounting: someone leans on the base, or it sinks in.
        if surprise > _PLAUSIBLE * math.sqrt(variance + (_MOUNT * float(np.linalg.norm(off, 2))) ** 2):
            return
        self._information = self._information + off.T @ off / variance
        self._vector = self._vector + off.T @ left / variance
        self._turn = np.asarray(np.linalg.solve(self._information, self._vector), np.float64)
        self.R = pin.exp3(self._turn)
