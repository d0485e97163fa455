"""A hand at the gizmo: where its arrow is on the page, taken with the mouse and moved."""

import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rolling_panda.errors import InputError
from server.scene.cameras import FOV, preset_pose
from server.scene.gizmo import GIZMO_PX

if TYPE_CHECKING:
    from playwright.sync_api import Page

Array = NDArray[np.float64]
_TAKE_S, _TRIES = 1.0, 10
_TURN_MS = 50


class FirstView:
    """The 3-D view of a page while it has its first camera, with the base where it starts."""

    def __init__(self, page: "Page") -> None:
        """Of a page whose view is there."""
        box = page.locator("rp-scene iframe").bounding_box()
        assert box is not None
        self.centre = np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
        self.focal = box["height"] / 2 / math.tan(FOV / 2)
        camera = preset_pose("follow", np.zeros(12), np.zeros(3))
        self.eye = camera.position
        self.forward = (camera.look_at - self.eye) / np.linalg.norm(camera.look_at - self.eye)
        self.right = np.cross(self.forward, [0.0, 0.0, 1.0])
        self.right /= np.linalg.norm(self.right)
        self.down = np.cross(self.forward, self.right)

    def pixel(self, point: Array) -> Array:
        """Where a point in odom (m) is on the page (px)."""
        offset = point - self.eye
        across = np.array([offset @ self.right, offset @ self.down])
        return np.asarray(self.centre + self.focal * across / (offset @ self.forward))

    def metres(self, pixels: float, point: Array) -> float:
        """What this many pixels are at the depth of a point (m)."""
        return float(pixels * ((point - self.eye) @ self.forward) / self.focal)


class GizmoHand:
    """Holds the arrow along the row, which is the tool's x axis in the survey posture."""

    ALONG = np.array([1.0, 0.0, 0.0])

    def __init__(self, page: "Page", tool: Callable[[], Any], follows: Callable[[], bool]) -> None:
        """The pointer is on no arrow yet.

        Args:
            page: With Teleoperate switched on.
            tool: Measured position of the tool in odom (m).
            follows: Whether the robot is moved by hand now.
        """
        self._page, self._tool, self._follows = page, tool, follows
        self._view = FirstView(page)
        self._grip = np.zeros(3)

    def take(self) -> None:
        """Press on the arrow; again, as the page asks a person to, where its view was not current enough.

        Raises:
            InputError: The robot does not follow.
        """
        for _ in range(_TRIES):
            origin = np.array(self._tool(), dtype=float)
            self._grip = origin + 0.8 * self._view.metres(GIZMO_PX, origin) * self.ALONG
            self._page.mouse.move(*self._view.pixel(self._grip))
            # The arrow lights up under the pointer before it can be taken.
            self._page.wait_for_timeout(20 * _TURN_MS)
            self._page.mouse.down()
            until = time.monotonic() + _TAKE_S
            while time.monotonic() < until:
                self._page.wait_for_timeout(_TURN_MS)
                if self.holds:
                    return
            self.let_go()
        raise InputError(
            "the drag does not take the tool: the view is too slow, or the gizmo is not where it should be"
        )

    @property
    def holds(self) -> bool:
        """Whether the robot is moved by hand now."""
        return self._follows()

    def move(self, way: float) -> None:
        """The pointer goes to where the arrow is `way` (m) along the row from where it was taken."""
        self._page.mouse.move(*self._view.pixel(self._grip + way * self.ALONG))

    def let_go(self) -> None:
        """Release the button."""
        self._page.mouse.up()
