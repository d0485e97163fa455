"""Clearance check of a cut plan."""

import math

from controller.config import ControllerConfig
from controller.inputs import Sample
from controller.motion.speed_limits import PlanLimits
from controller.motion.surroundings import Surroundings
from controller.whole_body.collision import CollisionModel
from controller.work.posture_search import CutPlan
from rolling_panda.messages.perception import Obstacles
from rolling_panda.model.robot import RobotModel

#: Margin above the smallest distance of the guard (m): close to it the robot is very slow.
_ROOM = 0.003


class CutClearance:
    """Checks cut plans before their execution. It has its own robot model, like the posture search."""

    def __init__(self, robot: RobotModel, config: ControllerConfig) -> None:
        """Nothing is known to stand around yet."""
        self._settings = config.hierarchy
        self._surroundings = Surroundings(CollisionModel(robot))
        self.forget()

    def forget(self) -> None:
        """Start a new search: the deficit of the best plan checked from now on is stored."""
        self._least = math.inf
        #: Deficit of the best plan, as text; empty if no plan was refused.
        self.lacking = ""

    def update(self, obstacles: Sample[Obstacles] | None) -> None:
        """Take the newest message; one that was taken before costs nothing."""
        self._surroundings.update(obstacles)

    def admits(self, plan: CutPlan) -> bool:
        """Whether the robot is far enough from itself and all else at the cut, the stand-off and clear of the canes.

        The blades may touch the spur that is cut.
        """
        self._surroundings.work_at((plan.poses.cut.translation,))
        worst, words = self._nearer(plan) if self._settings.collisions else (0.0, "")
        if words and worst < self._least:
            self._least, self.lacking = worst, words
        return not words

    def _nearer(self, plan: CutPlan) -> tuple[float, str]:
        """Largest violation of the required distance (m), and its parts; empty without one."""
        settings = self._settings
        within = max(settings.collision_distance + _ROOM, PlanLimits.clearance)
        worst, words = 0.0, ""
        places = (("at the cut", plan.q_cut), ("at the stand-off", plan.q_stand_off), ("clear of it", plan.q_clear))
        for where, q in places:
            near = self._surroundings.model.distances(q, within)
            for distance, pair in zip(near.distance.tolist(), near.pairs, strict=True):
                needed = settings.kept(pair) + _ROOM
                if q is plan.q_clear:
                    # The plan continues from here.
                    needed = max(needed, PlanLimits.clearance)
                if needed - distance > worst:
                    worst = needed - distance
                    words = (
                        f"{where} {1e3 * distance:.0f} mm would be between {pair[0]} and {pair[1]}, "
                        f"{1e3 * needed:.0f} mm are needed"
                    )
        return worst, words
