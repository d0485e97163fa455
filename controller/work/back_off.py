"""The way back after a contact: the robot retraces its own last motion, base and arm alike."""

import math
from collections.abc import Sequence

import numpy as np

from controller.config import MotionConfig
from controller.motion.follower import Follower, Measured, Tracking
from controller.motion.rest_to_rest import Rates, quickest
from rolling_panda.model.differential_drive import Array

#: Positions of ξ (9, rad) and of the tool (3, m) along a way, a control period apart at most.
Trail = Sequence[tuple[Array, Array]]
#: Times the duration of the way there without its stops, and least duration (s).
_SLOWER, _SHORTEST_S = 2.0, 1.0
#: Its progress begins and ends gently: a third of the time it speeds up, and a third it slows down.
_GENTLE = quickest(1.0, Rates(1.5, 6.75, 60.0))
#: After this time (s) a contact beyond its limits has to ease, as the way back begins slowly: within each further time
#: (s) it has to be less than ever before by a share.
_FREE_S, _EASES_S, _EASES = 0.6, 0.25, 0.02
#: A motion that has not ended this long after its planned end is given up (s).
_LATE_S = 1.0


class BackOff:
    """One motion back. Call `step` until `done`; begin at rest."""

    def __init__(self, config: MotionConfig, trail: Trail, distance: float, dt: float) -> None:
        """Plan.

        Args:
            config: Section `[controller.motion]`.
            trail: The way here.
            distance: That the tool goes back, if the trail is long enough (m).
            dt: Control period (s).
        """
        self._gain, self._dt = config.gain_position, dt
        way: list[Array] = []
        for position, tool in reversed(trail):
            way.append(position)
            if float(np.linalg.norm(tool - trail[-1][1])) >= distance:
                break
        self._way = np.array(way)
        self._duration = max(_SLOWER * dt * len(way), _SHORTEST_S)
        self._time = self._passed = 0.0
        #: Least load so far, and when that was (s).
        self._least, self._eased = math.inf, 0.0
        #: Whether it has ended, and whether it arrived.
        self.done, self.arrived = len(way) < 2, False

    def step(self, robot: Measured, follower: Follower, load: float) -> Tracking:
        """One period; a contact beyond its limits that does not ease ends this way back once it has begun.

        Args:
            robot: Measured robot.
            follower: Of the motion.
            load: Of the contact, 1 at its limits.
        """
        progress = _GENTLE.over(self._time, self._duration)
        last = len(self._way) - 1
        at = progress.s * last
        index = min(int(at), last - 1)
        span = self._way[index + 1] - self._way[index]
        wanted = self._way[index] + (at - index) * span
        tracking = follower.jog(span * progress.rate * last + self._gain * (wanted - robot.q[3:]), robot)
        self._time += self._dt * tracking.scale
        self._passed += self._dt
        self.arrived = self._time >= self._duration
        if load < (1.0 - _EASES) * self._least:
            self._least, self._eased = load, self._passed
        # Something else is in the way back, or the robot is caught.
        caught = load >= 1.0 and self._passed > max(_FREE_S, self._eased + _EASES_S)
        self.done = self.arrived or caught or self._passed > self._duration + _LATE_S
        return tracking
