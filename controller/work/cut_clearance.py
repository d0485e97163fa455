"""Clearance check of a cut plan."""

from controller.config import HierarchyConfig
from controller.motion.surroundings import Surroundings
from controller.whole_body.collision import CollisionModel
from controller.work.posture_search import CutPlan
from rolling_panda import reasons
from rolling_panda.messages.perception import Obstacles
from rolling_panda.messages.types import Reason
from rolling_panda.model.robot import RobotModel
from rolling_panda.transport.inbox import Received

#: Distance kept from everything where the tool is clear of the canes (m).
CLEARANCE = 0.02
#: Margin above the smallest distance of the guard (m): close to it the robot is very slow.
_ROOM = 0.003


class CutClearance:
    """Checks cut plans before their execution. It has its own robot model, like the posture search."""

    def __init__(self, robot: RobotModel, settings: HierarchyConfig) -> None:
        """Nothing is known to stand around yet."""
        self._settings = settings
        self._surroundings = Surroundings(CollisionModel(robot))

    def update(self, obstacles: Received[Obstacles] | None) -> None:
        """Take the newest message; one that was taken before costs nothing."""
        self._surroundings.update(obstacles)

    def too_near(self, plan: CutPlan) -> tuple[float, Reason | None]:
        """Largest violation of a required distance (m), with its place and parts; None without one.

        Places: at the cut, at the stand-off and clear of the canes. The blades may touch the spur that is cut.
        """
        settings = self._settings
        if not settings.collisions:
            return 0.0, None
        self._surroundings.work_at((plan.poses.cut.translation,))
        within = max(settings.collision_distance + _ROOM, CLEARANCE)
        worst, found = 0.0, None
        places = (("at the cut", plan.q_cut), ("at the stand-off", plan.q_stand_off), ("clear of it", plan.q_clear))
        for where, q in places:
            near = self._surroundings.model.distances(q, within)
            for distance, pair in zip(near.distance.tolist(), near.pairs, strict=True):
                needed = settings.kept(pair) + _ROOM
                if q is plan.q_clear:
                    # The motion to the next cut begins and ends here.
                    needed = max(needed, CLEARANCE)
                if needed - distance > worst:
                    worst = needed - distance
                    found = reasons.too_near(where, 1e3 * distance, *pair, 1e3 * needed)
        return worst, found
