"""Radii and track of the base's wheels, from pictures of a board that stands still between drives and turns.

The wheels tell by how much they have turned between two pictures, the camera where the base stood in each. Least
squares over radii, track, the camera on the base, the board and the base's place in each picture bring both together.
The camera keeps its place on the base, so that errors of the arm do not matter. Pitch, roll and height of the base are
free in each picture: the ground is not level. The standard deviations grow with the residuals.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares

from perception.arrays import Array
from perception.calibration.board_view import BoardView
from perception.calibration.hand_eye import CalibrationError
from rolling_panda import reasons
from rolling_panda.calibration.file import FARTHEST_APART, FARTHEST_WHEELS
from rolling_panda.model.differential_drive import WheelSizes, arc
from rolling_panda.model.robot import on_plane

#: Fewest pictures; least way and turn between two of them (m, rad).
FEWEST, LEAST_WAY, LEAST_TURN = 10, 0.3, 0.35
#: Largest standard deviation of radius and track, and of the difference of the radii (shares).
MOST_SD, MOST_SD_APART = 0.003, 0.0015
#: The base has slipped if its ways differ by more than this share from those of its wheels (root mean square).
MOST_SLIP = 0.01
#: Longest time between two pictures (s).
LONGEST_S = 120.0
#: Errors of wheels on firm ground: share of their way, and at least (m, rad).
_SHARE, _WAY, _TURN = 0.0007, 0.0003, 0.0005
#: Wheels of one axle wear alike: standard deviation of the difference of their radii (share).
_APART = 0.003
#: Fits with the errors of the wheels that the fit before has shown; fewer where they are as expected, to this factor.
_FITS, _AS_EXPECTED = 4, 1.2
#: Standard deviations of pitch and roll (rad) and height (m) of the base on its ground, and of the camera on the base
#: against what arm and calibration say (rad, m).
_TILT, _HEIGHT, _CAMERA_TURN, _CAMERA_SHIFT = 0.02, 0.01, 0.02, 0.015
#: Corners of a board are found to this at best (px).
_CORNER_SD = 0.08


@dataclass(frozen=True)
class BaseView:
    """A picture of the board, and what the wheels had done by then.

    Attributes:
        board: The board in the picture; its `lens` is the calibrated one, its `base` the odometry.
        T_base_camera: The camera on the base by arm and calibration (pin.SE3).
        wheels: Angles that both wheels have turned by (2, rad).
        stamp: Time of the picture, on the robot's clock (s).
    """

    board: BoardView
    T_base_camera: Any
    wheels: Array
    stamp: float


@dataclass(frozen=True)
class BaseFit:
    """Measured wheels.

    Attributes:
        sizes: Their sizes.
        radius_sd: Standard deviation of the mean radius (share).
        apart_sd: The same of the difference between right and left (share).
        track_sd: The same of the track (share).
        slip: By how much the ways of the base differ from those of its wheels (share, root mean square).
        views: Number of pictures.
    """

    sizes: WheelSizes
    radius_sd: float
    apart_sd: float
    track_sd: float
    slip: float
    views: int


def measure_wheels(views: Sequence[BaseView], used: WheelSizes, drawn: WheelSizes) -> BaseFit:
    """Sizes of the wheels.

    Args:
        views: Pictures in the order in which they were taken. The base rested in each.
        used: Sizes that the odometry in the pictures was made by.
        drawn: Sizes as drawn.

    Raises:
        CalibrationError: Too few pictures, a clock that jumped, too little motion, wheels that slipped, or sizes that
            are implausible or uncertain.
    """
    if len(views) < FEWEST:
        raise CalibrationError(reasons.base_few_views(len(views), FEWEST))
    gaps = np.diff([view.stamp for view in views])
    if gaps.min() <= 0.0 or gaps.max() > LONGEST_S:
        worst = float(gaps.min() if gaps.min() <= 0.0 else gaps.max())
        raise CalibrationError(reasons.base_clock_jumped(worst))
    ways, turns = _moved(views)
    if ways < LEAST_WAY or turns < LEAST_TURN:
        least_turn = float(np.degrees(LEAST_TURN))
        why = reasons.base_moved_little(1e3 * ways, float(np.degrees(turns)), 1e3 * LEAST_WAY, least_turn)
        raise CalibrationError(why)
    fit = _fit(views, used)
    if fit.slip > MOST_SLIP:
        raise CalibrationError(reasons.base_slipped(100 * fit.slip, 100 * MOST_SLIP))
    _believe(fit, drawn)
    return fit


def _believe(fit: BaseFit, drawn: WheelSizes) -> None:
    """Refuse sizes that are implausible or uncertain."""
    sizes = fit.sizes
    radius, track = (sizes.left + sizes.right) / (drawn.left + drawn.right) - 1.0, sizes.track / drawn.track - 1.0
    if max(abs(radius), abs(track)) > FARTHEST_WHEELS or abs(sizes.right / sizes.left - 1.0) > FARTHEST_APART:
        raise CalibrationError(reasons.base_implausible(100 * radius, 100 * track, 100 * FARTHEST_WHEELS))
    if max(fit.radius_sd, fit.track_sd) > MOST_SD or fit.apart_sd > MOST_SD_APART:
        raise CalibrationError(reasons.base_unsure(100 * fit.radius_sd, 100 * fit.track_sd, 100 * MOST_SD))


def _moved(views: Sequence[BaseView]) -> tuple[float, float]:
    """Farthest way and turn between two pictures as the camera saw it (m, rad)."""
    bases = [_camera_board(view)[0].inverse() for view in views]
    bases = [pose * view.T_base_camera.inverse() for pose, view in zip(bases, views, strict=True)]
    away = max(float(np.linalg.norm(a.translation - b.translation)) for a in bases for b in bases)
    turned = max(float(np.linalg.norm(pin.log3(a.rotation.T @ b.rotation))) for a in bases for b in bases)
    return away, turned


def _camera_board(view: BaseView) -> tuple[Any, Array]:
    """T_camera_board (pin.SE3) of a picture, and its information (6×6) about the board's axes: [shift; turn]."""
    board = view.board
    _, turn, shift = cv2.solvePnP(board.points, board.pixels, board.lens, None)
    seen = pin.SE3(pin.exp3(turn.ravel()), shift.ravel())
    local = board.points @ seen.rotation.T + seen.translation
    fx, fy = board.lens[0, 0], board.lens[1, 1]
    depth = local[:, 2]
    off = local[:, :2] / depth[:, None] * [fx, fy] + board.lens[:2, 2] - board.pixels
    rows = []
    for point, there in zip(board.points, local, strict=True):
        x, y, z = there
        pixel = np.array([[fx / z, 0.0, -fx * x / z**2], [0.0, fy / z, -fy * y / z**2]])
        rows.append(pixel @ seen.rotation @ np.hstack([np.eye(3), -pin.skew(point)]))
    J = np.concatenate(rows)
    sd = max(_CORNER_SD, float(np.sqrt((off**2).mean())))
    return seen, J.T @ J / sd**2


def _relative(a: Array, b: Array) -> Array:
    """Pose b in the frame of pose a (3)."""
    c, s = np.cos(a[2]), np.sin(a[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    return np.array([c * dx + s * dy, c * dy - s * dx, b[2] - a[2]])


class _Problem:
    """Unknowns: three of the wheels, six each of camera and board, three of the base in each picture but the first."""

    def __init__(self, views: Sequence[BaseView], used: WheelSizes) -> None:
        self.used = used
        self.odometry = np.stack([view.board.base for view in views])
        self.turned = np.diff(np.stack([view.wheels for view in views]), axis=0)
        legs = [_relative(a, b) for a, b in zip(self.odometry, self.odometry[1:], strict=False)]
        # What the wheels did within a leg is in the odometry; only the difference of the sizes is taken for an arc.
        self.legs = np.stack(legs) - self._arcs(used)
        rolled = np.abs(self.turned) * [used.left, used.right]
        self.way = rolled.mean(axis=1)
        self.rolled = np.stack([self.way, self.way, np.hypot(*rolled.T) / used.track], axis=1)
        self.leg_sd = np.zeros_like(self.rolled)
        self.expect(_SHARE)
        self.T_base_camera = views[0].T_base_camera
        self.seen, informations = zip(*(_camera_board(view) for view in views), strict=True)
        self.T_odom_board = on_plane(self.odometry[0]) * self.T_base_camera * self.seen[0]
        self.whiten = [self._whitening(*each) for each in zip(self.odometry, informations, strict=True)]

    def expect(self, share: float) -> None:
        """Expect errors of the wheels of this share of their way."""
        self.leg_sd = np.array([_WAY, _WAY, _TURN]) + share * self.rolled

    def _whitening(self, pose: Array, information: Array) -> Array:
        """Pitch, roll and height of the base, which are unknown, make the camera less certain of them."""
        free = np.diag([_HEIGHT**2, _TILT**2, _TILT**2])
        A = (self.T_odom_board.inverse() * on_plane(pose)).action[:, [2, 3, 4]]
        covariance = np.linalg.inv(information) + A @ free @ A.T
        out: Array = np.linalg.cholesky(np.linalg.inv(covariance)).T
        return out

    def _arcs(self, sizes: WheelSizes) -> Array:
        ways = self.turned @ sizes.motion().T
        return np.array([arc((0.0, 0.0, 0.0), way, turn) for way, turn in ways.tolist()])

    def sizes(self, x: Array) -> WheelSizes:
        """Sizes of the wheels."""
        used, (grown, apart, wider) = self.used, x[:3].tolist()
        return WheelSizes(
            used.left * (1.0 + grown - apart / 2), used.right * (1.0 + grown + apart / 2), used.track * (1.0 + wider)
        )

    def start(self) -> Array:
        """The odometry."""
        return np.concatenate([np.zeros(_COMMON), self.odometry[1:].ravel()])

    def residuals(self, x: Array) -> Array:
        """Residuals in standard deviations: three for each leg, six for each picture, seven for the prior."""
        poses = self._poses(x)
        T_camera_base = (self.T_base_camera * pin.exp6(x[3:9])).inverse()
        T_odom_board = self.T_odom_board * pin.exp6(x[9:15])
        out = [self.leg_errors(x).ravel() / self.leg_sd.ravel()]
        for pose, seen, whiten in zip(poses, self.seen, self.whiten, strict=True):
            expected = T_camera_base * on_plane(pose).actInv(T_odom_board)
            out.append(whiten @ pin.log6(seen.actInv(expected)).vector)
        return np.concatenate([*out, x[1:2] / _APART, x[3:6] / _CAMERA_SHIFT, x[6:9] / _CAMERA_TURN])

    def jacobian(self, x: Array) -> Array:
        """Of `residuals`, by differences."""
        at, poses = self.residuals(x), len(self.odometry) - 1
        J = np.zeros((len(at), len(x)))
        for column in range(_COMMON):
            J[:, column] = self._difference(x, at, [column])
        # A leg has two poses and a picture has one, so that every second pose is moved at once.
        for first in (0, 1):
            for axis in range(3):
                moved = list(range(first, poses, 2))
                slope = self._difference(x, at, [_COMMON + 3 * each + axis for each in moved])
                for each in moved:
                    picture = 3 * poses + 6 * (each + 1)
                    rows = [*range(3 * each, min(3 * each + 6, 3 * poses)), *range(picture, picture + 6)]
                    J[rows, _COMMON + 3 * each + axis] = slope[rows]
        return J

    def _difference(self, x: Array, at: Array, columns: list[int]) -> Array:
        beside = x.copy()
        beside[columns] += _STEP
        out: Array = (self.residuals(beside) - at) / _STEP
        return out

    def _poses(self, x: Array) -> Array:
        return np.vstack([self.odometry[:1], x[_COMMON:].reshape(-1, 3)])

    def leg_errors(self, x: Array) -> Array:
        """By how much the base went otherwise than its wheels, for each leg (N×3: m, m, rad)."""
        poses = self._poses(x)
        went = np.stack([_relative(a, b) for a, b in zip(poses, poses[1:], strict=False)])
        out: Array = went - self.legs - self._arcs(self.sizes(x))
        return out

    def slip(self, x: Array) -> float:
        """The errors of the legs as a share of the ways of the wheels (root mean square)."""
        off = self.leg_errors(x)
        ways = np.hypot(off[:, 0], off[:, 2] * self.used.track / 2)
        return float(np.sqrt((ways**2).sum() / (self.way**2).sum()))


#: Unknowns that all pictures have in common, and the step of differences.
_COMMON, _STEP = 15, 1e-7


def _fit(views: Sequence[BaseView], used: WheelSizes) -> BaseFit:
    problem, share = _Problem(views, used), _SHARE
    x = problem.start()
    for _ in range(_FITS):
        found = least_squares(problem.residuals, x, problem.jacobian, x_scale="jac", max_nfev=20)
        x = found.x
        # Three unknown places of each picture share out the error of its leg.
        legs = found.fun[: problem.leg_sd.size]
        freedom = max(1.0, len(found.fun) - len(x)) * len(legs) / (len(legs) + 6 * len(views))
        factor = float(np.sqrt((legs**2).sum() / freedom))
        if factor < _AS_EXPECTED:
            break
        share *= factor
        problem.expect(share)
    inflated = max(1.0, 2.0 * found.cost / max(1, len(found.fun) - len(x)))
    sd = np.sqrt(np.diag(inflated * np.linalg.pinv(found.jac.T @ found.jac))[:3])
    return BaseFit(problem.sizes(x), float(sd[0]), float(sd[1]), float(sd[2]), problem.slip(x), len(views))
