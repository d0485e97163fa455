"""Elastic canes: they bend before whatever touches them, and push back.

A cane is a beam that is held at its base. What touches it displaces it there. Its force is that of the beam with a load
at this place, 3 E I / L³ times the displacement, up to the load at which the wood yields. A cane that is let go springs
back. The canes that the camera sees, and that the blades cut, are the unbent ones. A lateral shoot is a beam that is
held where it grows; its cane stands still. Tendrils and leaves give way to all.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bridge.sim.vineyard.row import Array, Row

#: Bending strength of canes (Pa): estimate for dormant wood.
_STRENGTH = 80e6
#: Nearer to its base a cane is as stiff as here (m): there the spur gives way too.
_SHORTEST = 0.05
#: Time in which a cane that is let go springs back (s), and between two looks at which canes are near.
_BACK_S, _LOOK_S = 0.05, 0.02
#: Canes within this distance of a part are near (m): nothing moves as far between two looks.
_NEAR = 0.08
#: A cane that is displaced by less stands as it grew (m), for display.
_STRAIGHT = 1e-4
#: Numbers of a cane, or of a lateral shoot on it: vine, spur, cane, organ.
Numbers = tuple[int, int, int, int]


@dataclass(frozen=True)
class Push:
    """Force of a cane.

    Attributes:
        part: Index of the part that it acts on.
        force: (3, N).
    """

    part: int
    force: Array


class Canes:
    """Pushes parts of the robot, which are spheres."""

    def __init__(self, modulus: float, radii: Array, dt: float) -> None:
        """Begin with straight canes.

        Args:
            modulus: Young's modulus (Pa).
            radii: Of the parts (n, m).
            dt: Time step (s).
        """
        self._modulus, self._radii = modulus, radii
        self._relax, self._every = math.exp(-dt / _BACK_S), max(1, round(_LOOK_S / dt))
        self._revision, self._steps = -1, 0
        self._bent: dict[Numbers, Array] = {}
        self._touched: dict[Numbers, float] = {}

    def push(self, row: Row, centers: Array) -> list[Push]:
        """Forces on the parts after one time step.

        Args:
            row: Of which the canes are.
            centers: Middles of the parts (n×3, m, world).
        """
        if row.revision != self._revision:
            self._read(row)
        if self._steps % self._every == 0:
            around = self._around(centers)
            self._near = around[(self._gaps(centers, around)[0] < _NEAR).any(axis=0)]
        self._steps += 1
        for bent in self._bent.values():
            bent *= self._relax
        return self._touch(centers) if len(self._near) else []

    def bends(self) -> dict[Numbers, tuple[Array, float]]:
        """Displacement (3, m) of each bent cane or lateral, and the length along it at which it is (m)."""
        least = _STRAIGHT**2
        return {numbers: (bent, self._touched[numbers]) for numbers, bent in self._bent.items() if bent @ bent > least}

    def _read(self, row: Row) -> None:
        """Rods of canes and laterals, with the length of the same below each."""
        self._revision, self._steps = row.revision, 0
        rods = [(index, rod) for index, rod in row.standing() if rod.cane >= 0 and rod.kind != "background"]
        self._numbers = [(rod.vine, rod.spur, rod.cane, rod.organ) for _, rod in rods]
        thick: dict[Numbers, float] = {}
        below: list[float] = []
        beyond: dict[tuple[int, int], float] = {}
        for (index, rod), numbers in zip(rods, self._numbers, strict=True):
            thick.setdefault(numbers, rod.start_radius)
            below.append(beyond.get((rod.parent, rod.organ), 0.0))
            beyond[index, rod.organ] = below[-1] + float(np.linalg.norm(rod.end - rod.start))
        self._start = np.array([rod.start for _, rod in rods]).reshape(-1, 3)
        self._along = np.array([rod.end for _, rod in rods]).reshape(-1, 3) - self._start
        self._square = np.maximum((self._along**2).sum(axis=1), 1e-12)
        self._radius = np.array([max(rod.start_radius, rod.end_radius) for _, rod in rods])
        ends = np.stack([self._start, self._start + self._along])
        self._low, self._high = ends.min(axis=0) - self._radius[:, None], ends.max(axis=0) + self._radius[:, None]
        self._below = np.array(below)
        self._base = np.array([thick[numbers] for numbers in self._numbers])
        self._bent = {numbers: bent for numbers, bent in self._bent.items() if numbers in thick}

    def _around(self, centers: Array) -> Any:
        """Rods that could be near: those beside the box of the parts, or all while any is bent."""
        if self._bent:
            return np.arange(len(self._start))
        reach = self._radii[:, None] + _NEAR
        low, high = (centers - reach).min(axis=0), (centers + reach).max(axis=0)
        return np.flatnonzero(((self._high > low) & (self._low < high)).all(axis=1))

    def _gaps(self, centers: Array, rods: Any) -> tuple[Array, Array, Array]:
        """Gaps (n×k), offsets of the parts from the axes (n×k×3, m) and places on the rods 0…1 (n×k)."""
        bent = np.array([self._bent.get(self._numbers[rod], np.zeros(3)) for rod in rods]) if self._bent else 0.0
        offset = centers[:, None, :] - (self._start[rods] + bent)[None]
        place = np.clip((offset * self._along[rods]).sum(axis=2) / self._square[rods], 0.0, 1.0)
        offset = offset - place[:, :, None] * self._along[rods]
        gaps = np.linalg.norm(offset, axis=2) - self._radii[:, None] - self._radius[rods]
        return gaps, offset, place

    def _touch(self, centers: Array) -> list[Push]:
        gaps, offset, place = self._gaps(centers, self._near)
        pushes: list[Push] = []
        done: set[Numbers] = set()
        hits = np.argwhere(gaps < 0.0)
        # The deepest of each cane: its rods and the parts overlap one another.
        for part, column in hits[np.argsort(gaps[tuple(hits.T)])].tolist():
            rod = int(self._near[column])
            numbers = self._numbers[rod]
            if numbers in done:
                continue
            done.add(numbers)
            away = offset[part, column]
            distance = float(np.linalg.norm(away))
            if distance < 1e-6:
                continue
            bent = self._bent.get(numbers, np.zeros(3)) + gaps[part, column] / distance * away
            along = self._along_cane(rod, float(place[part, column]))
            self._bent[numbers], self._touched[numbers] = bent, along
            pushes.append(Push(part, self._force(rod, along, bent, away / distance)))
        self._bent = {numbers: bent for numbers, bent in self._bent.items() if bent @ bent > 1e-10}
        return pushes

    def _along_cane(self, rod: int, place: float) -> float:
        """Length from the foot of a cane to a place 0…1 on a rod (m), at least the shortest."""
        return max(float(self._below[rod]) + place * math.sqrt(float(self._square[rod])), _SHORTEST)

    def _force(self, rod: int, length: float, bent: Array, away: Array) -> Array:
        """Force on the part (3, N): along the contact's normal, which friction is left away from."""
        radius = float(self._base[rod])
        second = math.pi * radius**4 / 4.0
        stiffness = 3.0 * self._modulus * second / length**3
        most = _STRENGTH * second / (radius * length)
        force: Array = min(max(stiffness * float(-bent @ away), 0.0), most) * away
        return force
