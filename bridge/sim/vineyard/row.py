"""The simulated row as rods.

It is ground truth: only images and display scenery leave the simulation.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rolling_panda.messages.types import WoodClass

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rod:
    """A straight piece of wood, post or wire with round ends; its place in `Row.rods` is its index.

    Attributes:
        kind: Class.
        start: End nearer to the root (3, m, world).
        end: Other end (3, m, world).
        start_radius: Radius at `start` (m).
        end_radius: Radius at `end` (m).
        parent: Index of the rod that carries it; -1 for none.
        vine: Vine along the row, -1 for posts, wires and ground.
        spur: Spur on the vine, -1 for none.
        cane: Cane on the spur, -1 for none.
        hanging: Severed, and held by the wires.
        organ: Number of a lateral shoot, tendril or old leaf on the cane; -1 for the cane itself.
    """

    kind: WoodClass
    start: Array
    end: Array
    start_radius: float
    end_radius: float
    parent: int = -1
    vine: int = -1
    spur: int = -1
    cane: int = -1
    hanging: bool = False
    organ: int = -1

    def at(self, fraction: float) -> tuple[Array, float]:
        """Point on the axis (3, m) and radius (m) at a fraction 0…1 of the length."""
        point = self.start + fraction * (self.end - self.start)
        return point, self.start_radius + fraction * (self.end_radius - self.start_radius)


@dataclass(frozen=True)
class Row:
    """An immutable row. A cut gives a new row with a higher `revision`; indices do not change.

    Attributes:
        rods: All rods; None for removed ones.
        revision: Number of cuts.
        backdrop: Rods of the rows behind: visible only.
    """

    rods: tuple[Rod | None, ...]
    revision: int = 0
    backdrop: tuple[Rod, ...] = ()

    def standing(self) -> Iterable[tuple[int, Rod]]:
        """Index and rod of all that are not removed."""
        return ((index, rod) for index, rod in enumerate(self.rods) if rod is not None)

    def sever(self, index: int, fraction: float, hangs: Array | None = None) -> "Row":
        """The row after a cut through rod `index` at `fraction` of its length.

        Args:
            index: Of the rod.
            fraction: Of its length.
            hangs: How far all that it carried beyond is moved (3, m), where it hangs in the wires; None where it falls
                and is gone.

        Raises:
            IndexError: The rod is removed or does not exist.
        """
        cut = self.rods[index]
        if cut is None:
            raise IndexError(f"rod {index} has been removed already")
        point, radius = cut.at(fraction)
        gone = self._beyond(index, cut, fraction)
        rods = [None if i in gone else rod for i, rod in enumerate(self.rods)]
        rods[index] = replace(cut, end=point, end_radius=radius)
        if hangs is not None:
            for i in gone:
                rod = self.rods[i]
                assert rod is not None
                parent = -1 if rod.parent == index else rod.parent
                rods[i] = replace(rod, start=rod.start + hangs, end=rod.end + hangs, parent=parent, hanging=True)
            start, end = point + hangs, cut.end + hangs
            rods.append(replace(cut, start=start, end=end, start_radius=radius, parent=-1, hanging=True))
        return Row(tuple(rods), self.revision + 1, self.backdrop)

    def _beyond(self, index: int, cut: Rod, fraction: float) -> set[int]:
        """Indices of all rods that a rod carries beyond a fraction of its length."""
        length = float(np.linalg.norm(cut.end - cut.start))
        gone: set[int] = set()
        for child, rod in self.standing():
            if rod.parent in gone:
                gone.add(child)
            elif rod.parent == index:
                along = float(np.dot(rod.start - cut.start, cut.end - cut.start)) / max(length**2, 1e-12)
                if along > fraction:
                    gone.add(child)
        return gone
