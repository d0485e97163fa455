"""The way back after a contact: the robot retraces its own last motion, base and arm alike."""

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
#: Within this time the contact has to end (s).
_FREE_S = 0.6
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
        #: Whether it has ended, and whether it arrived.
        self.done, self.arrived = len(way) < 2, False

    def step(self, robot: Measured, follower: Follower, beyond: bool) -> Tracking:
        """One period; with `beyond` a limit of the contact is passed, which ends this way back once it has begun."""
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
        # Something else is in the way back, or the robot is caught.
        again = self._passed > _FREE_S and beyond
        self.done = self.arrived or again or self._passed > self._duration + _LATE_S
        return tracking
