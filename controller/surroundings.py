"""What stands around the robot, as perception tells it, for the method and the plans to keep away from."""

from collections.abc import Sequence

from controller.interface import Sample
from controller.whole_body.collision import CollisionModel
from controller.whole_body.obstacle import Obstacle
from rolling_panda.row_messages import Capsule, Obstacles

#: A rod thinner than this is watched as if it were this thick (m).
_THINNEST = 0.001


class Surroundings:
    """Keeps a collision model up to date with the newest obstacles."""

    def __init__(self, model: CollisionModel) -> None:
        """Begin with nothing around."""
        self.model = model
        self._seen: Sample[Obstacles] | None = None

    def take(self, obstacles: Sample[Obstacles] | None) -> None:
        """Take the newest message; one that was taken before costs nothing."""
        if obstacles is None or obstacles is self._seen:
            return
        changed = self._seen is None or obstacles.message.capsules != self._seen.message.capsules
        self._seen = obstacles
        if changed:
            self.model.set_obstacles(obstacles_of(obstacles.message.capsules))


def obstacles_of(capsules: Sequence[Capsule]) -> list[Obstacle]:
    """What the wire says stands around, as the collision model has it; named by kind and number."""
    return [
        Obstacle(
            f"{capsule.kind} {number}",
            capsule.kind,
            capsule.start,
            capsule.end,
            max(capsule.start_radius, capsule.end_radius, _THINNEST),
        )
        for number, capsule in enumerate(capsules)
    ]
