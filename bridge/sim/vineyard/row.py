"""The row as rods: what the camera sees, what the blades cut, and what falls when they do.

Ground truth of the simulation. It never crosses the wire except as display scenery and pixels.
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
        kind: What it is.
        start: End that is nearer to the root (3, m, world).
        end: Other end (3, m, world).
        start_radius: Radius at `start` (m).
        end_radius: Radius at `end` (m).
        parent: Index of the rod that carries it; -1 where the ground or a post does.
        vine: Vine along the row, -1 for posts, wires and ground.
        spur: Spur position on the vine, -1 where there is none.
        cane: Cane on the spur, -1 where there is none.
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

    def at(self, fraction: float) -> tuple[Array, float]:
        """Point on the axis (3, m) and radius (m) at a fraction 0…1 of the length."""
        point = self.start + fraction * (self.end - self.start)
        return point, self.start_radius + fraction * (self.end_radius - self.start_radius)


@dataclass(frozen=True)
class Row:
    """A row as it stands. Severing makes a new row with a higher `revision`; indices stay what they were.

    Attributes:
        rods: All rods ever; one that has gone is None.
        revision: Grows with every cut.
        backdrop: Rods of the rows behind: they are seen and never reached.
    """

    rods: tuple[Rod | None, ...]
    revision: int = 0
    backdrop: tuple[Rod, ...] = ()

    def standing(self) -> Iterable[tuple[int, Rod]]:
        """Index and rod of what still stands."""
        return ((index, rod) for index, rod in enumerate(self.rods) if rod is not None)

    def sever(self, index: int, fraction: float) -> "Row":
        """The row after rod `index` was cut through at `fraction` of its length: all that it carried beyond has gone.

        Children of the cut rod that sit nearer to its start than the cut (buds on a cane) stay.

        Raises:
            IndexError: The rod is gone or there is no such rod.
        """
        cut = self.rods[index]
        if cut is None:
            raise IndexError(f"rod {index} has already gone")
        point, radius = cut.at(fraction)
        length = float(np.linalg.norm(cut.end - cut.start))
        gone: set[int] = set()
        for child, rod in self.standing():
            if rod.parent in gone:
                gone.add(child)
            elif rod.parent == index:
                along = float(np.dot(rod.start - cut.start, cut.end - cut.start)) / max(length**2, 1e-12)
                if along > fraction:
                    gone.add(child)
        rods = [None if i in gone else rod for i, rod in enumerate(self.rods)]
        rods[index] = replace(cut, end=point, end_radius=radius)
        return Row(tuple(rods), self.revision + 1, self.backdrop)
