"""Obstacles from perception for the collision model, and allowed contacts of the blades."""

from collections.abc import Sequence

import numpy as np

from controller.whole_body.collision import CollisionModel, same
from controller.whole_body.obstacle import Axes, Obstacle
from rolling_panda.messages.perception import Capsule, Obstacles
from rolling_panda.model.differential_drive import Array
from rolling_panda.transport.inbox import Received

#: Smallest radius of a rod in the collision model (m).
_THINNEST = 0.001
#: The spur that is cut has a cane this near to the cut (m): what stays of a cane ends just below it, and shears cut a
#: stub beside the cane that stays on it.
_ON_SPUR = 0.045


class Surroundings:
    """Updates the collision model with the newest obstacles and with the contacts that the blades are allowed."""

    def __init__(self, model: CollisionModel) -> None:
        """Begin with nothing around."""
        self.model = model
        self._seen: Received[Obstacles] | None = None
        self._places: tuple[Array, ...] = ()
        self._canes: tuple[Capsule, ...] = ()
        self._cane_obstacles: tuple[Obstacle, ...] = ()
        self._axes = Axes(())
        self._rigid: tuple[Obstacle, ...] = ()
        self._rigid_axes = Axes(())

    def update(self, obstacles: Received[Obstacles] | None) -> None:
        """Take the newest message; one that was taken before costs nothing."""
        if obstacles is None or obstacles is self._seen:
            return
        changed = self._seen is None or obstacles.message.capsules != self._seen.message.capsules
        self._seen = obstacles
        if not changed:
            return
        around = obstacles_of(obstacles.message.capsules)
        self.model.set_obstacles(around)
        both = list(zip(obstacles.message.capsules, around, strict=True))
        self._canes = tuple(capsule for capsule, _ in both if capsule.kind == "cane")
        self._cane_obstacles = tuple(obstacle for capsule, obstacle in both if capsule.kind == "cane")
        self._axes = Axes(self._cane_obstacles)
        self._rigid = tuple(obstacle for obstacle in around if obstacle.kind != "cane")
        self._rigid_axes = Axes(self._rigid)
        self._allow()

    def work_at(self, places: tuple[Array, ...]) -> None:
        """Let the blades touch the spurs that are cut at these places (3, m, odom), and nothing else of the robot.

        Beside a cut they may also push aside canes of which it is not decided that they stay.
        """
        if len(places) == len(self._places) and all(map(same, places, self._places)):
            return
        self._places = places
        self._allow()

    def canes_near(self, place: Array, within: float) -> tuple[tuple[Capsule, Obstacle], ...]:
        """Canes that stay, or may stay, whose bark is within a distance (m) of a place (3, m, odom)."""
        gaps = self._axes.gaps(place[None], np.zeros(1))[0]
        return tuple((self._canes[index], self._cane_obstacles[index]) for index in np.flatnonzero(gaps < within))

    def rigid_near(self, place: Array, within: float) -> tuple[Obstacle, ...]:
        """Wires, posts, trunks and cordons whose surface is within a distance (m) of a place (3, m, odom)."""
        gaps = self._rigid_axes.gaps(place[None], np.zeros(1))[0]
        return tuple(self._rigid[index] for index in np.flatnonzero(gaps < within))

    def _allow(self) -> None:
        found = touchable(self._canes, self._axes, self._places)
        self.model.allow({self._cane_obstacles[index].name for index in found})


def touchable(canes: Sequence[Capsule], axes: Axes, places: Sequence[Array]) -> set[int]:
    """Canes that the blades may touch in cuts at these positions: those of the spurs there, and undecided ones.

    Args:
        canes: That stay, or of which it is not decided.
        axes: Of the same.
        places: Of the cuts (3, m, odom).
    """
    allowed: set[int] = set()
    if not canes or not len(places):
        return allowed
    for row in axes.gaps(np.array(places), np.zeros(len(places))):
        nearest = int(np.argmin(row))
        if row[nearest] >= _ON_SPUR:
            continue
        spur = canes[nearest].vine, canes[nearest].spur
        for index, (cane, gap) in enumerate(zip(canes, row.tolist(), strict=True)):
            if (cane.vine, cane.spur) == spur or cane.undecided and gap < _ON_SPUR:
                allowed.add(index)
    return allowed


def obstacles_of(capsules: Sequence[Capsule]) -> list[Obstacle]:
    """Obstacles for the collision model from their message, named by kind, number and spur."""
    return [
        Obstacle(
            f"{capsule.kind} {number}" + (f", vine {capsule.vine}, spur {capsule.spur}" if capsule.spur >= 0 else ""),
            capsule.kind,
            capsule.start,
            capsule.end,
            max(capsule.start_radius, capsule.end_radius, _THINNEST),
        )
        for number, capsule in enumerate(capsules)
    ]
