"""The board of the calibration in a picture."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from perception.arrays import Array
from perception.segmentation.frame import View
from rolling_panda import reasons
from rolling_panda.calibration.board import board, corners
from rolling_panda.messages.robot import Intrinsics
from rolling_panda.messages.types import Reason

#: Least corners of a board that count: a part of a row of squares says little about its direction.
_LEAST = 12


@dataclass(frozen=True)
class BoardView:
    """The board as seen from one posture.

    Attributes:
        points: Corners in the board's frame (N×3, m).
        pixels: The same in the picture (N×2, px).
        lens: Camera matrix that the frame reports (3×3, px).
        T_odom_flange: Pose of the flange by the arm's encoders (pin.SE3).
        q: Configuration of the robot by its encoders (12).
    """

    points: Array
    pixels: Array
    lens: Array
    T_odom_flange: Any
    q: Array

    @property
    def base(self) -> Array:
        """Pose of the base in odom (3: m, m, rad)."""
        return self.q[:3]


def find_board(view: View, reported: Intrinsics, T_odom_flange: Any, q: Array) -> BoardView | Reason:
    """The board in a picture, or why not: what is seen of it.

    Args:
        view: The picture.
        reported: The lens as the camera reports it: its error is a part of the calibration.
        T_odom_flange: Pose of the flange (pin.SE3).
        q: Configuration of the robot (12).

    Raises:
        CorruptFrameError: The colour image is corrupt.
    """
    grey = cv2.cvtColor(np.ascontiguousarray(view.color()), cv2.COLOR_RGB2GRAY)
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    found, ids, _, _ = cv2.aruco.CharucoDetector(board(), cv2.aruco.CharucoParameters(), settings).detectBoard(grey)
    if ids is None or len(ids) == 0:
        return reasons.board_not_in_picture()
    if len(ids) < _LEAST:
        return reasons.board_in_part(len(ids), _LEAST)
    k = reported
    lens = np.array([[k.fx, 0.0, k.cx], [0.0, k.fy, k.cy], [0.0, 0.0, 1.0]])
    pixels = np.asarray(found, dtype=np.float64).reshape(-1, 2)
    return BoardView(corners()[ids.ravel()], pixels, lens, T_odom_flange, q)
