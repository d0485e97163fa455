"""The target of the camera's calibration: a ChArUco board that fits on a sheet of A4.

Its frame: origin in the corner of the first square, x along the rows, y down the columns, z into the board.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

#: Columns and rows of squares, and the side of a square (m).
COLUMNS, ROWS, SQUARE = 8, 6, 0.030
#: Size of the board (m).
WIDTH, HEIGHT = COLUMNS * SQUARE, ROWS * SQUARE
#: White margin about the printed board (m).
MARGIN = 0.015
_MARKER = 0.75 * SQUARE


def board() -> Any:
    """The board as OpenCV's detector takes it."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_50)
    return cv2.aruco.CharucoBoard((COLUMNS, ROWS), SQUARE, _MARKER, dictionary)


def corners() -> NDArray[np.float64]:
    """Inner corners by their ids, N×3 in the board's frame (m)."""
    return np.asarray(board().getChessboardCorners(), dtype=np.float64)


def picture(square_px: int) -> NDArray[np.uint8]:
    """The board with its margin, grey values; a square has this many pixels."""
    margin = round(MARGIN / SQUARE * square_px)
    size = COLUMNS * square_px + 2 * margin, ROWS * square_px + 2 * margin
    return np.asarray(board().generateImage(size, marginSize=margin), dtype=np.uint8)
