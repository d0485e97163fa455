"""Whether the robot brushes against canes, worked out from the row as it stands: in the simulation canes give way."""

from collections.abc import Collection, Iterable

from bridge.sim.vineyard.row import Rod
from controller.whole_body.collision import CollisionModel
from controller.whole_body.collision_geometry import BLADES
from controller.whole_body.obstacle import Obstacle
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel
from rolling_panda.model.wire_values import vector3

#: A cane of the row: its vine, spur and number.
Cane = tuple[int, int, int]


class CaneTouches:
    """Collects which canes any part of the robot but the blades has overlapped with.

    The parts are the collision model's capsules, which are 6 to 32 mm larger than the links inside them.

    Attributes:
        touched: For each cane the parts that touched it.
        touched_staying: The same for wood of it that stays when the row is pruned.
    """

    def __init__(self, staying: Collection[int] = ()) -> None:
        """Nothing touched.

        Args:
            staying: Rods that stay, by their numbers.
        """
        self._model = CollisionModel(RobotModel())
        self._revision = -1
        self._staying = frozenset(f"{number}" for number in staying)
        self.touched: dict[Cane, set[str]] = {}
        self.touched_staying: dict[Cane, set[str]] = {}

    def look(self, q: Array, rods: Iterable[tuple[int, Rod]], revision: int) -> None:
        """Take in one moment.

        Args:
            q: Configuration (12).
            rods: The row's, with their numbers; only canes count, without their laterals.
            revision: Of the row; the rods are read anew when it changes.
        """
        if revision != self._revision:
            self._revision = revision
            canes = {f"{number}": rod for number, rod in rods if rod.kind == "cane" and rod.organ < 0}
            self._canes = {name: (rod.vine, rod.spur, rod.cane) for name, rod in canes.items()}
            self._model.set_obstacles(
                [
                    Obstacle(name, "cane", vector3(rod.start), vector3(rod.end), max(rod.start_radius, rod.end_radius))
                    for name, rod in canes.items()
                ]
            )
        for a, b in self._model.distances(q, 0.0).pairs:
            if b in self._canes and a != BLADES:
                self.touched.setdefault(self._canes[b], set()).add(a)
                if b in self._staying:
                    self.touched_staying.setdefault(self._canes[b], set()).add(a)
