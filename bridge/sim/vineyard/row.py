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
        spur: Spur on the vine, -1 for none; of last year's cane of a Guyot vine the spur beside it.
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

    @property
    def last_years(self) -> bool:
        """Whether it is a piece of last year's cane of a Guyot vine, which is labelled as cordon."""
        return self.kind == "cordon" and self.spur >= 0

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
        lying: Severed wood on the ground: visible only.
    """

    rods: tuple[Rod | None, ...]
    revision: int = 0
    backdrop: tuple[Rod, ...] = ()
    lying: tuple[Rod, ...] = ()

    def standing(self) -> Iterable[tuple[int, Rod]]:
        """Index and rod of all that are not removed."""
        return ((index, rod) for index, rod in enumerate(self.rods) if rod is not None)

    def sever(self, index: int, fraction: float, hangs: Array | None = None, lies: float | None = None) -> "Row":
        """The row after a cut through rod `index` at `fraction` of its length.

        Args:
            index: Of the rod.
            fraction: Of its length.
            hangs: How far all that it carried beyond is moved (3, m), where it hangs in the wires; None where it falls
                and is gone.
            lies: Azimuth of what falls, on the ground where it then lies (rad, world); None where it is taken away.

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
        lying = self.lying
        if hangs is None and lies is not None:
            fallen = [rod for rod in (self.rods[i] for i in sorted(gone)) if rod is not None]
            lying += _laid([replace(cut, start=point, start_radius=radius), *fallen], lies)
        if hangs is not None:
            for i in gone:
                rod = self.rods[i]
                assert rod is not None
                parent = -1 if rod.parent == index else rod.parent
                rods[i] = replace(rod, start=rod.start + hangs, end=rod.end + hangs, parent=parent, hanging=True)
            start, end = point + hangs, cut.end + hangs
            rods.append(replace(cut, start=start, end=end, start_radius=radius, parent=-1, hanging=True))
        return Row(tuple(rods), self.revision + 1, self.backdrop, lying)

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


def _laid(piece: list[Rod], azimuth: float) -> tuple[Rod, ...]:
    """A piece of wood on flat ground under where it stood; its first rod begins at the cut."""
    ends = np.array([(rod.start, rod.end) for rod in piece]).reshape(-1, 3)
    root = ends[0]
    tip = ends[int(np.argmax(np.linalg.norm(ends - root, axis=1)))]
    along = (tip - root) / max(float(np.linalg.norm(tip - root)), 1e-9)
    down = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    # The shortest turn that lays it down; then all of it sinks onto the ground.
    axis, cosine = np.cross(along, down), float(along @ down)
    turned = ends - root
    turned = turned + np.cross(axis, turned) + np.cross(axis, np.cross(axis, turned)) / max(1.0 + cosine, 1e-6)
    turned[:, :2] += (ends.mean(axis=0) - turned.mean(axis=0))[:2]
    turned[:, 2] = np.array([(rod.start_radius, rod.end_radius) for rod in piece]).ravel()
    return tuple(
        replace(rod, start=start, end=end, parent=-1)
        for rod, (start, end) in zip(piece, turned.reshape(-1, 2, 3), strict=True)
    )
