"""The camera on the flange from pictures of a board that stands still: AX = XB, then the reprojection error.

The first estimate is that of Park and Martin (1994) by OpenCV. Least squares over the camera on the flange, the board
in odom and the focal length then bring the corners to where they were seen. The standard deviations count each view,
not each corner, as one observation: errors of the arm shift all corners of a view alike.
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
from rolling_panda.reasons import text_of

#: Fewest views, and fewest degrees that they have to be turned about the second of their axes of rotation: about one
#: axis alone the position along it is not determined (root mean square).
FEWEST, LEAST_TURN = 10, 5.0
#: Largest reprojection error (px, root mean square), and standard deviations (rad, m) of a calibration that is offered.
LARGEST_ERROR, ANGLE_SD, SHIFT_SD = 1.5, 0.002, 0.002
#: The base has moved if it is farther from where it stood at first (m, rad).
_STOOD, _FACED = 0.003, 0.003
#: A view is left out if its error is so many times the median of all: its board was taken for another or moved.
_OUTLIER = 4.0
#: Focal lengths differ by about this share between reports and lenses, and corners are found to about this (px): it
#: bounds what too few views would make of the focal length.
_FOCAL_SD, _CORNER_SD = 0.01, 0.1
#: A cut is in the middle of the picture, where a turn about the optical axis moves it so many times less.
_ROLL = 4.0
_UNKNOWNS, _ITERATIONS = 13, 20


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
    """

    T_flange_camera: Any
    T_odom_board: Any
    focal: float
    pixels: float
    angle_sd: float
    shift_sd: float
    views: int


def calibrate(views: Sequence[BoardView]) -> HandEye:
    """The camera on the flange.

    Args:
        views: Pictures of a board that stands still, with the base standing still.

    Raises:
        CalibrationError: Too few views, motions about one axis alone, a base that has moved, or residuals too large.
    """
    if len(views) < FEWEST:
        raise CalibrationError(reasons.calibration_few_views(len(views), FEWEST))
    moved = np.abs(np.stack([view.base for view in views]) - views[0].base).max(axis=0)
    if np.hypot(moved[0], moved[1]) > _STOOD or moved[2] > _FACED:
        raise CalibrationError(reasons.calibration_base_moved(1e3 * float(np.hypot(moved[0], moved[1]))))
    if (turned := np.degrees(second_axis(views))) < LEAST_TURN:
        raise CalibrationError(reasons.calibration_axes_parallel(turned, LEAST_TURN))
    found = _refine(views, *_first_estimate(views))
    errors = np.array([_view_error(view, found) for view in views])
    good = [view for view, error in zip(views, errors, strict=True) if error <= _OUTLIER * np.median(errors)]
    if FEWEST <= len(good) < len(views) and np.degrees(second_axis(good)) >= LEAST_TURN:
        found = _refine(good, found.T_flange_camera, found.T_odom_board)
    if found.pixels > LARGEST_ERROR:
        raise CalibrationError(reasons.calibration_error_high(found.pixels, LARGEST_ERROR))
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


def _refine(views: Sequence[BoardView], T_flange_camera: Any, T_odom_board: Any) -> HandEye:
    owner = np.repeat(np.arange(len(views)), [len(view.points) for view in views])

    def poses(x: Array) -> tuple[Any, Any, float]:
        camera = pin.SE3(T_flange_camera.rotation @ pin.exp3(x[:3]), T_flange_camera.translation + x[3:6])
        target = pin.SE3(T_odom_board.rotation @ pin.exp3(x[6:9]), T_odom_board.translation + x[9:12])
        return camera, target, float(np.exp(x[12]))

    def errors(x: Array) -> Array:
        camera, target, focal = poses(x)
        off = [_off(view, camera, target, focal).ravel() for view in views]
        return np.concatenate([*off, [_CORNER_SD * x[12] / _FOCAL_SD]])

    # The unknowns are rad and m; corners at half a metre move alike by either.
    solved = least_squares(errors, np.zeros(_UNKNOWNS), x_scale="jac", max_nfev=_ITERATIONS)
    camera, target, focal = poses(solved.x)
    off, J = solved.fun[:-1].reshape(-1, 2), solved.jac[:-1].reshape(-1, 2, _UNKNOWNS)
    # Covariance that takes each view for one observation (a "sandwich"), with the unknowns that it has used up.
    bread = np.linalg.pinv(solved.jac.T @ solved.jac)
    pulls = np.stack([np.einsum("nij,ni->j", J[owner == k], off[owner == k]) for k in range(len(views))])
    free = max(len(views) - _UNKNOWNS / 2, 1.0)
    covariance = len(views) / free * bread @ (pulls.T @ pulls) @ bread
    sd = np.sqrt(np.diag(covariance))
    return HandEye(
        T_flange_camera=camera,
        T_odom_board=target,
        focal=focal,
        pixels=float(np.sqrt(np.mean(np.sum(off**2, axis=1)))),
        angle_sd=float(max(sd[0], sd[1], sd[2] / _ROLL)),
        shift_sd=float(sd[3:6].max()),
        views=len(views),
    )


def _off(view: BoardView, T_flange_camera: Any, T_odom_board: Any, focal: float) -> Array:
    """Corners of a view less where they are expected (N×2, px)."""
    T_camera_board = (view.T_odom_flange * T_flange_camera).actInv(T_odom_board)
    seen = view.points @ T_camera_board.rotation.T + T_camera_board.translation
    expected = focal * np.diag(view.lens)[:2] * seen[:, :2] / seen[:, 2:] + view.lens[:2, 2]
    out: Array = view.pixels - expected
    return out


def _view_error(view: BoardView, found: HandEye) -> float:
    off = _off(view, found.T_flange_camera, found.T_odom_board, found.focal)
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
