"""The camera on the flange from pictures of a board that stands still: AX = XB, then the reprojection error.

The first estimate is that of Park and Martin (1994) by OpenCV. Least squares over the camera on the flange, the board
in odom and the focal length, and on demand the offsets of the arm's joints, then bring the corners to where they were
seen. The standard deviations count each view, not each corner, as one observation: errors of the arm shift all corners
of a view alike.

The offset of the first joint turns the arm as another place of the board does, that of the last one as another mount
of the camera does: no picture tells them, and they are left at zero.
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
from rolling_panda import reasons
from rolling_panda.errors import InputError
from rolling_panda.messages.types import Reason
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.reasons import text_of

#: Fewest views, and fewest degrees that they have to be turned about the second of their axes of rotation: about one
#: axis alone the position along it is not determined (root mean square).
FEWEST, LEAST_TURN = 10, 5.0
#: Largest reprojection error (px, root mean square), and standard deviations (rad, m) of a calibration that is offered.
LARGEST_ERROR, ANGLE_SD, SHIFT_SD = 1.5, 0.002, 0.002
#: Largest standard deviation of the offset of a joint (rad).
OFFSET_SD = np.radians(0.05)
#: Joints of the arm whose offsets pictures tell.
_JOINTS = slice(1, 6)
_OFFSETS = _JOINTS.stop - _JOINTS.start
#: The base has moved if it is farther from where it stood at first (m, rad).
_STOOD, _FACED = 0.003, 0.003
#: A view is left out if its error is so many times the median of all: its board was taken for another or moved.
_OUTLIER = 4.0
#: Focal lengths differ by about this share between reports and lenses, and corners are found to about this (px): it
#: bounds what too few views would make of the focal length.
_FOCAL_SD, _CORNER_SD = 0.01, 0.1
#: A cut is in the middle of the picture, where a turn about the optical axis moves it so many times less.
_ROLL = 4.0
_UNKNOWNS, _ITERATIONS = 13, 30


class CalibrationError(InputError):
    """The views give no calibration; `reason` says why."""

    def __init__(self, reason: Reason) -> None:
        """Store the reason."""
        super().__init__(text_of(reason))
        self.reason = reason


@dataclass(frozen=True)
class HandEye:
    """A calibration.

    Attributes:
        T_flange_camera: The camera on the flange (pin.SE3).
        T_odom_board: The board (pin.SE3).
        focal: Focal length over the reported one.
        pixels: Reprojection error (px, root mean square).
        angle_sd: Standard deviation of the direction in which the camera looks, about the worse of its two axes (rad).
        shift_sd: The same of the position (m).
        views: Number of views.
        view_pixels: The error of each view (px, root mean square).
        offsets: By how much the encoder of each joint of the arm is off (7, rad); zero where it was not asked for.
        offset_sd: Standard deviation of the most uncertain of them (rad).
    """

    T_flange_camera: Any
    T_odom_board: Any
    focal: float
    pixels: float
    angle_sd: float
    shift_sd: float
    views: int
    view_pixels: Array
    offsets: Array
    offset_sd: float


def calibrate(views: Sequence[BoardView], arm: RobotModel | None = None) -> HandEye:
    """The camera on the flange.

    Args:
        views: Pictures of a board that stands still, with the base standing still.
        arm: Whose joints have unknown offsets; its `data` is overwritten. None takes the encoders to be right.

    Raises:
        CalibrationError: Too few views, motions about one axis alone, a base that has moved, or residuals too large;
            with `arm` also postures that do not tell its joints apart, and offsets that are uncertain.
    """
    if len(views) < FEWEST:
        raise CalibrationError(reasons.calibration_few_views(len(views), FEWEST))
    moved = np.abs(np.stack([view.base for view in views]) - views[0].base).max(axis=0)
    if np.hypot(moved[0], moved[1]) > _STOOD or moved[2] > _FACED:
        raise CalibrationError(reasons.calibration_base_moved(1e3 * float(np.hypot(moved[0], moved[1]))))
    if (turned := np.degrees(second_axis(views))) < LEAST_TURN:
        raise CalibrationError(reasons.calibration_axes_parallel(turned, LEAST_TURN))
    first = _first_estimate(views)
    if arm is not None and (sd := _least_sd(_Problem(views, *first, arm))) > OFFSET_SD:
        raise CalibrationError(reasons.arm_postures_alike(float(np.degrees(sd)), float(np.degrees(OFFSET_SD))))
    found = _refine(_Problem(views, *first, arm))
    errors = found.view_pixels
    good = [view for view, error in zip(views, errors, strict=True) if error <= _OUTLIER * np.median(errors)]
    if FEWEST <= len(good) < len(views) and np.degrees(second_axis(good)) >= LEAST_TURN:
        found = _refine(_Problem(good, found.T_flange_camera, found.T_odom_board, arm))
    if found.pixels > LARGEST_ERROR:
        raise CalibrationError(reasons.calibration_error_high(found.pixels, LARGEST_ERROR))
    if found.offset_sd > OFFSET_SD:
        raise CalibrationError(reasons.arm_unsure(float(np.degrees(found.offset_sd)), float(np.degrees(OFFSET_SD))))
    if found.angle_sd > ANGLE_SD or found.shift_sd > SHIFT_SD:
        raise CalibrationError(
            reasons.calibration_unsure(
                float(np.degrees(found.angle_sd)), 1e3 * found.shift_sd, float(np.degrees(ANGLE_SD)), 1e3 * SHIFT_SD
            )
        )
    return found


def second_axis(views: Sequence[BoardView]) -> float:
    """How far the flange is turned between views about the second axis of their rotations (rad, root mean square)."""
    first = views[0].T_odom_flange.rotation
    turns = np.stack([pin.log3(first.T @ view.T_odom_flange.rotation) for view in views])
    return float(np.linalg.svd(turns - turns.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(views)))


def _first_estimate(views: Sequence[BoardView]) -> tuple[Any, Any]:
    T_camera_board = []
    for view in views:
        _, turn, shift = cv2.solvePnP(view.points, view.pixels, view.lens, None)
        T_camera_board.append(pin.SE3(pin.exp3(turn.ravel()), shift.ravel()))
    R, t = cv2.calibrateHandEye(
        [view.T_odom_flange.rotation for view in views],
        [view.T_odom_flange.translation for view in views],
        [pose.rotation for pose in T_camera_board],
        [pose.translation for pose in T_camera_board],
        method=cv2.CALIB_HAND_EYE_PARK,
    )
    T_flange_camera = pin.SE3(np.asarray(R), np.asarray(t).ravel())
    return T_flange_camera, views[0].T_odom_flange * T_flange_camera * T_camera_board[0]


class _Problem:
    """Unknowns: six each of camera and board, the focal length, and with an arm the offsets of its joints."""

    def __init__(
        self, views: Sequence[BoardView], T_flange_camera: Any, T_odom_board: Any, arm: RobotModel | None
    ) -> None:
        self.views, self.arm = views, arm
        self._T_flange_camera, self._T_odom_board = T_flange_camera, T_odom_board
        self.owner = np.repeat(np.arange(len(views)), [len(view.points) for view in views])
        self._points = np.concatenate([view.points for view in views])
        self._pixels = np.concatenate([view.pixels for view in views])
        self._scale = np.stack([np.diag(view.lens)[:2] for view in views])[self.owner]
        self._centre = np.stack([view.lens[:2, 2] for view in views])[self.owner]
        self._flanges: tuple[bytes, list[Any]] = b"", []
        self.unknowns = _UNKNOWNS + (0 if arm is None else _OFFSETS)

    def poses(self, x: Array) -> tuple[Any, Any, float]:
        """The camera on the flange, the board in odom (pin.SE3), and the focal length."""
        camera = pin.SE3(self._T_flange_camera.rotation @ pin.exp3(x[:3]), self._T_flange_camera.translation + x[3:6])
        target = pin.SE3(self._T_odom_board.rotation @ pin.exp3(x[6:9]), self._T_odom_board.translation + x[9:12])
        return camera, target, float(np.exp(x[12]))

    def offsets(self, x: Array) -> Array:
        """Of the joints (7, rad)."""
        out = np.zeros(7)
        out[_JOINTS] = x[_UNKNOWNS:] if self.arm is not None else 0.0
        return out

    def errors(self, x: Array) -> Array:
        """Corners less where they are expected (px), and the prior of the focal length."""
        camera, target, focal = self.poses(x)
        offsets = self.offsets(x)
        # Most unknowns leave the arm where it is.
        if (key := offsets.tobytes()) != self._flanges[0]:
            self._flanges = key, [_flange(view, self.arm, offsets) for view in self.views]
        T_camera_board = [(T_odom_flange * camera).actInv(target) for T_odom_flange in self._flanges[1]]
        R = np.stack([pose.rotation for pose in T_camera_board])[self.owner]
        t = np.stack([pose.translation for pose in T_camera_board])[self.owner]
        seen = np.einsum("nij,nj->ni", R, self._points) + t
        expected = focal * self._scale * seen[:, :2] / seen[:, 2:] + self._centre
        return np.append(self._pixels - expected, _CORNER_SD * x[12] / _FOCAL_SD)


def _least_sd(problem: _Problem) -> float:
    """Standard deviation of the most uncertain offset if each view were one corner, found well (rad)."""
    at, step = problem.errors(np.zeros(problem.unknowns)), 1e-5
    J = np.stack([(problem.errors(step * each) - at) / step for each in np.eye(problem.unknowns)], axis=1)
    # Corners of a view count together as one.
    J[:-1] /= np.sqrt(np.bincount(problem.owner))[problem.owner].repeat(2)[:, None]
    _, sizes, directions = np.linalg.svd(J, full_matrices=False)
    spread = directions[:, _UNKNOWNS:] / np.maximum(sizes, 1e-12)[:, None]
    return float(_CORNER_SD * np.sqrt((spread**2).sum(axis=0)).max())


def _refine(problem: _Problem) -> HandEye:
    # The unknowns are rad and m; corners at half a metre move alike by either.
    unknowns, count = problem.unknowns, len(problem.views)
    solved = least_squares(problem.errors, np.zeros(unknowns), x_scale="jac", max_nfev=_ITERATIONS)
    camera, target, focal = problem.poses(solved.x)
    off, J = solved.fun[:-1].reshape(-1, 2), solved.jac[:-1].reshape(-1, 2, unknowns)
    # Covariance that takes each view for one observation (a "sandwich"), with the unknowns that it has used up.
    bread = np.linalg.pinv(solved.jac.T @ solved.jac)
    pulls = np.stack([np.einsum("nij,ni->j", J[problem.owner == k], off[problem.owner == k]) for k in range(count)])
    free = max(count - unknowns / 2, 1.0)
    covariance = count / free * bread @ (pulls.T @ pulls) @ bread
    sd = np.sqrt(np.diag(covariance))
    return HandEye(
        T_flange_camera=camera,
        T_odom_board=target,
        focal=focal,
        pixels=float(np.sqrt(np.mean(np.sum(off**2, axis=1)))),
        angle_sd=float(max(sd[0], sd[1], sd[2] / _ROLL)),
        shift_sd=float(sd[3:6].max()),
        views=count,
        view_pixels=np.sqrt(np.bincount(problem.owner, (off**2).sum(axis=1)) / np.bincount(problem.owner)),
        offsets=problem.offsets(solved.x),
        offset_sd=float(sd[_UNKNOWNS:].max(initial=0.0)),
    )


def _flange(view: BoardView, arm: RobotModel | None, offsets: Array) -> Any:
    """T_odom_flange (pin.SE3) of a view if the encoders have these offsets (7, rad)."""
    if arm is None:
        return view.T_odom_flange
    q = view.q.copy()
    q[ARM_Q] -= offsets
    return arm.pose(q, arm.flange_id)
