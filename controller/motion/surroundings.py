"""Obstacles from perception for the collision model, and allowed contacts of the blades."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller.whole_body.collision import CollisionModel, same
from controller.whole_body.obstacle import Axes, Obstacle
from rolling_panda.messages.perception import Capsule, Obstacles, PruningPoint
from rolling_panda.model.differential_drive import Array
from rolling_panda.transport.inbox import Received

#: Smallest radius of a rod in the collision model (m).
_THINNEST = 0.001
#: The spur that is cut has a cane this near to the cut (m): what stays of a cane ends just below it, and shears cut a
#: stub beside the cane that stays on it.
_ON_SPUR = 0.045
#: A piece of last year's cane has its axis this near to the place where that is removed (m), as far as the map errs.
_ON_OLD_CANE = 0.015


@dataclass(frozen=True, eq=False)
class WorkPlace:
    """Where the blades work.

    Attributes:
        position: Of the cut (3, m).
        removes: Vine and spur of last year's cane that is removed there; None at any other cut.
    """

    position: Array
    removes: tuple[int, int] | None = None

    @classmethod
    def of(cls, position: Array, point: PruningPoint | None) -> "WorkPlace":
        """That of a point, with the cut at a position (3, m)."""
        removal = point is not None and point.kind == "removal"
        return cls(position, (point.vine, point.spur) if point is not None and removal else None)

    def same(self, other: "WorkPlace") -> bool:
        """Whether the same is cut at the same place."""
        return self.removes == other.removes and same(self.position, other.position)


class Surroundings:
    """Updates the collision model with the newest obstacles and with the contacts that the blades are allowed."""

    def __init__(self, model: CollisionModel) -> None:
        """Begin with nothing around."""
        self.model = model
        self._seen: Received[Obstacles] | None = None
        self._places: tuple[WorkPlace, ...] = ()
        self._canes: tuple[Capsule, ...] = ()
        self._cane_obstacles: tuple[Obstacle, ...] = ()
        self._axes = Axes(())
        self._rigid: tuple[Capsule, ...] = ()
        self._rigid_obstacles: tuple[Obstacle, ...] = ()
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
        self._rigid = tuple(capsule for capsule, _ in both if capsule.kind != "cane")
        self._rigid_obstacles = tuple(obstacle for capsule, obstacle in both if capsule.kind != "cane")
        self._rigid_axes = Axes(self._rigid_obstacles)
        self._allow()

    def work_at(self, places: tuple[WorkPlace, ...]) -> None:
        """Let the blades touch the wood that is cut at these places (odom), and nothing else of the robot.

        That are the spurs there, or the piece of last year's cane that is removed. Beside a cut they may also push
        aside canes of which it is not decided that they stay.
        """
        if len(places) == len(self._places) and all(map(WorkPlace.same, places, self._places)):
            return
        self._places = places
        self._allow()

    def canes_near(self, place: Array, within: float) -> tuple[tuple[Capsule, Obstacle], ...]:
        """Canes that stay, or may stay, whose bark is within a distance (m) of a place (3, m, odom)."""
        gaps = self._axes.gaps(place[None], np.zeros(1))[0]
        return tuple((self._canes[index], self._cane_obstacles[index]) for index in np.flatnonzero(gaps < within))

    def rigid_near(self, place: WorkPlace, within: float) -> tuple[Obstacle, ...]:
        """Wires, posts, trunks and cordons whose surface is within a distance (m) of a place (odom).

        The piece of last year's cane that is removed there is left out.
        """
        gaps = self._rigid_axes.gaps(place.position[None], np.zeros(1))[0]
        near = set(np.flatnonzero(gaps < within).tolist()) - removable(self._rigid, self._rigid_axes, (place,))
        return tuple(self._rigid_obstacles[index] for index in sorted(near))

    def _allow(self) -> None:
        canes = touchable(self._canes, self._axes, self._places)
        old = removable(self._rigid, self._rigid_axes, self._places)
        names = {self._cane_obstacles[index].name for index in canes}
        self.model.allow(names | {self._rigid_obstacles[index].name for index in old})


def removable(rigid: Sequence[Capsule], axes: Axes, places: Sequence[WorkPlace]) -> set[int]:
    """Pieces of last year's canes that the blades may close on at these places: those that are cut through there.

    Args:
        rigid: What does not give way.
        axes: Of the same.
        places: Of the cuts, in the frame of `rigid`.
    """
    allowed: set[int] = set()
    for place in places if rigid else ():
        if place.removes is None:
            continue
        for index in np.flatnonzero(axes.away(place.position) < _ON_OLD_CANE).tolist():
            piece = rigid[index]
            if piece.kind == "cordon" and (piece.vine, piece.spur) == place.removes:
                allowed.add(index)
    return allowed


def touchable(canes: Sequence[Capsule], axes: Axes, places: Sequence[WorkPlace]) -> set[int]:
    """Canes that the blades may touch in cuts at these places: those of the spurs there, and undecided ones.

    The removal of last year's cane cuts nothing of the spur beside it.

    Args:
        canes: That stay, or of which it is not decided.
        axes: Of the same.
        places: Of the cuts, in the frame of `canes`.
    """
    allowed: set[int] = set()
    if not canes or not len(places):
        return allowed
    positions = np.array([place.position for place in places])
    for place, row in zip(places, axes.gaps(positions, np.zeros(len(places))), strict=True):
        nearest = int(np.argmin(row))
        if row[nearest] >= _ON_SPUR:
            continue
        spur = (canes[nearest].vine, canes[nearest].spur) if place.removes is None else None
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
