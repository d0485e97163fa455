"""Where the tool has been lately, as a line that fades into the past."""

from collections import deque

import numpy as np
import viser

from rolling_panda import messages as m

_NAME = "/trail/line"
#: Places are kept when the tool has gone so far (m), so many of them.
_STEP, _LONGEST = 0.01, 200
_NEW, _OLD = np.array([150, 205, 255.0]), np.array([62, 72, 84.0])


class SceneTrail:
    """Draws it; only a trail that has grown is sent."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Begin without one."""
        self._server = server
        self._places: deque[m.Vector3] = deque(maxlen=_LONGEST)

    def take(self, place: m.Vector3) -> bool:
        """The tool is at a place (m, odom); True when the trail has grown."""
        if self._places and float(np.linalg.norm(np.subtract(place, self._places[-1]))) < _STEP:
            return False
        self._places.append(place)
        if len(self._places) > 1:
            self._draw()
        return True

    def _draw(self) -> None:
        places = np.array(self._places, dtype=np.float32)
        fade = np.linspace(0.0, 1.0, len(places))[:, None]
        colors = (_OLD + fade * (_NEW - _OLD)).astype(np.uint8)
        self._server.scene.add_line_segments(
            _NAME,
            np.stack([places[:-1], places[1:]], axis=1),
            colors=np.stack([colors[:-1], colors[1:]], axis=1),
            thickness=2.0,
            thickness_units="screen",
        )
