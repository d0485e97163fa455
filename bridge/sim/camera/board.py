"""The calibration's board before the simulated camera, where the robot starts."""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from bridge.sim.camera.mesh import Floats
from rolling_panda.calibration.board import HEIGHT, MARGIN, SQUARE, WIDTH, picture

#: Middle of the board (m, world): 0.45 m before the camera in the survey posture, the row behind it.
_PLACE = np.array([0.50, 0.45, 1.05])
#: People put it up by eye: standard deviation of its direction (rad) and place (m).
_ASKEW, _ASIDE = 0.06, 0.02
#: Pixels of a square of the picture, and rays of each pixel of the camera along one side.
_SQUARE_PX, _RAYS = 40, 3
#: Brightness of its white and black.
_BRIGHT, _DARK = 225.0, 30.0


class StandingBoard:
    """A sheet with the board, which occludes the row behind it."""

    def __init__(self, seed: int) -> None:
        """Put it up."""
        rng = np.random.default_rng([seed, 13])
        # Its x axis points along the row's -x for a camera that looks along +y: right in the picture.
        facing = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
        self._R = pin.exp3(_ASKEW * rng.standard_normal(3)) @ facing
        self._t = _PLACE + _ASIDE * rng.standard_normal(3) - self._R @ [WIDTH / 2, HEIGHT / 2, 0.0]
        self._texture = _DARK + (_BRIGHT - _DARK) / 255.0 * picture(_SQUARE_PX).astype(np.float64)

    def draw(self, origin: Floats, rays: Floats, columns: int, depth: Floats, color: Floats) -> NDArray[np.bool_]:
        """Draw it into depth and colours; returns the pixels that show it.

        Args:
            origin: Of the rays (3, world).
            rays: One for each pixel, row by row (N×3), of length 1 along the optical axis.
            columns: Of the image.
            depth: Depth image without the board (N, m), updated in place.
            color: Colour image without the board (N×3), updated in place.
        """
        local, start = rays.astype(np.float64) @ self._R, (origin - self._t) @ self._R
        away = -start[2] / np.where(np.abs(local[:, 2]) < 1e-9, 1e-9, local[:, 2])
        place = start[:2] + away[:, None] * local[:, :2]
        inside = (place > -MARGIN).all(axis=1) & (place < [WIDTH + MARGIN, HEIGHT + MARGIN]).all(axis=1)
        shown: NDArray[np.bool_] = inside & (away > 0.0) & (away < depth)
        index = np.flatnonzero(shown)
        if len(index):
            # A pixel is the mean over its area: rays between it and its neighbours to the right and below.
            right = rays[1].astype(np.float64) - rays[0]
            down = rays[columns].astype(np.float64) - rays[0]
            steps = (np.arange(_RAYS) + 0.5) / _RAYS - 0.5
            total = np.zeros(len(index))
            for across in steps:
                for along in steps:
                    ray = local[index] + (across * right + along * down) @ self._R
                    point = start[:2] + (-start[2] / ray[:, 2])[:, None] * ray[:, :2]
                    pixel = (point + MARGIN) / SQUARE * _SQUARE_PX - 0.5
                    total += map_coordinates(self._texture, pixel[:, ::-1].T, order=1, mode="nearest")
            color[index] = (total / _RAYS**2)[:, None]
            depth[index] = away[index]
        return shown
