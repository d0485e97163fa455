"""The true row for the page's 3-D view: at rest, and the canes near the tool as wind and arm displace them.

It is for display: nothing that is computed here goes back into the simulation.
"""

from collections.abc import Collection

import numpy as np

from bridge.sim.vineyard.row import Array, Rod, Row
from bridge.sim.world.canes import Canes
from bridge.sim.world.wind import Wind, bend
from rolling_panda.messages.perception import Capsule, MovedCapsule
from rolling_panda.model.wire_values import vector3

_DISPLAYED = frozenset({"post", "trunk", "cordon", "spur", "cane", "node", "wire", "hose", "old cut"})
#: A cane is near when one of its rods begins within this distance of the tool along the row (m). Which canes are near
#: is looked up again when the tool has moved by the second distance (m), or the row has changed.
_NEAR, _LOOK_EVERY = 0.4, 0.2
#: Rods that swing by less than this (m) are left out, and a smaller motion is not told.
_LEAST = 0.003
#: Numbers of a cane: vine, spur, cane.
_Cane = tuple[int, int, int]


def displayed(row: Row) -> list[tuple[int, Rod]]:
    """Index and rod of all that is displayed, in the order of `capsules`."""
    return [(index, rod) for index, rod in row.standing() if rod.kind in _DISPLAYED]


def capsules(row: Row) -> tuple[Capsule, ...]:
    """The row at rest, and after it the wood on the ground."""
    lying = (rod for rod in row.lying if rod.kind in _DISPLAYED)
    return tuple(
        Capsule(rod.kind, vector3(rod.start), vector3(rod.end), float(rod.start_radius), float(rod.end_radius))
        for rod in (*(rod for _, rod in displayed(row)), *lying)
    )


class RowMotion:
    """Canes near the tool, as wind and arm displace them. The same calls give the same results."""

    def __init__(self, row: Row, wind: Wind | None, canes: Canes | None) -> None:
        """Nothing has been told yet.

        Args:
            row: Before any cut.
            wind: Sways the canes; None without wind.
            canes: They bend before the arm; None where they give way to all.
        """
        self._wind, self._canes = wind, canes
        self._lengths: dict[int, tuple[float, float]] = {}
        beyond: dict[tuple[int, int], float] = {}
        for index, rod in row.standing():
            if rod.cane >= 0:
                at = beyond.get((rod.parent, rod.organ), 0.0)
                beyond[index, rod.organ] = at + float(np.linalg.norm(rod.end - rod.start))
                # What grows on a cane goes with the node that it grows on.
                node = self._lengths.get(rod.parent, (0.0, 0.0))[0] if rod.organ >= 0 else at
                self._lengths[index] = node, at
        self._starts = np.array([rod.start for _, rod in row.standing()]).reshape(-1, 3)
        self._owners = [(rod.vine, rod.spur, rod.cane) for _, rod in row.standing()]
        amplitude = 0.0 if wind is None else wind.amplitude
        shares = [(0.0, 0.0) if wind is None else wind.shares(index) for index in range(len(row.rods))]
        self._shares = np.array(shares).reshape(-1, 2)
        self._swinging = (amplitude * self._shares[:, 1] >= _LEAST).tolist()
        self._revision = self._told_revision = -1
        self._looked: Array | None = None
        self._bent: set[_Cane] = set()
        self._told, self._told_ends = np.zeros(0, int), np.zeros((0, 2, 3))

    def changed(self, row: Row, tool: Array, at: float) -> tuple[MovedCapsule, ...] | None:
        """The displaced capsules, while all others are at rest; None if they have not moved since they were last told.

        Args:
            row: The row at rest.
            tool: Position of the tool (3, m, world).
            at: Simulated time (s).
        """
        bends = {} if self._canes is None else self._canes.bends()
        bent = {numbers[:3] for numbers in bends}
        if self._looked is None or float(np.linalg.norm(tool - self._looked)) > _LOOK_EVERY:
            self._look(row, tool, bent)
        elif row.revision != self._revision or not bent <= self._bent:
            self._look(row, self._looked, bent | self._bent)
        ends = self._ends.copy()
        if self._wind is not None:
            ends += self._reach[:, :, None] * self._wind.pushes(self._swings, at)[:, None, :]
        for (*cane, organ), (displacement, touched) in bends.items():
            own = (self._numbers[:, :3] == cane).all(axis=1)
            # A lateral that is pushed bends where it grows.
            lengths = self._cane_lengths
            if organ >= 0:
                own &= self._numbers[:, 3] == organ
                lengths = self._organ_lengths
            ends[own] += bend(lengths[own], touched)[:, :, None] * displacement
        still = np.array_equal(self._places, self._told) and self._told_revision == row.revision
        nothing = not len(self._places) and not len(self._told)
        if nothing or still and float(np.abs(ends - self._told_ends).max(initial=0.0)) < _LEAST:
            return None
        # Whoever draws the row begins anew with each of its revisions.
        self._told, self._told_ends, self._told_revision = self._places, ends, row.revision
        pairs = zip(self._places.tolist(), ends.tolist(), strict=True)
        return tuple(MovedCapsule(place, tuple(start), tuple(end)) for place, (start, end) in pairs)

    def _look(self, row: Row, tool: Array, bent: Collection[_Cane]) -> None:
        """Choose the rods that are told: those that swing on canes near the tool, and all rods of bent canes."""
        self._revision, self._looked, self._bent = row.revision, tool.copy(), set(bent)
        near = np.flatnonzero(np.abs(self._starts - tool)[:, 0] < _NEAR)
        close = {self._owners[index] for index in near.tolist()}
        told = {
            index
            for index in self._lengths
            if self._owners[index] in bent or (self._owners[index] in close and self._swinging[index])
        }
        chosen = [(place, index, rod) for place, (index, rod) in enumerate(displayed(row)) if index in told]
        rods = [rod for _, _, rod in chosen]
        self._places, indices = np.array([place for place, _, _ in chosen], int), [index for _, index, _ in chosen]
        self._ends = np.array([end for rod in rods for end in (rod.start, rod.end)]).reshape(-1, 2, 3)
        self._numbers = np.array([(rod.vine, rod.spur, rod.cane, rod.organ) for rod in rods], int).reshape(-1, 4)
        long = np.linalg.norm(self._ends[:, 1] - self._ends[:, 0], axis=1)
        cane, organ = np.array([self._lengths[index] for index in indices]).reshape(-1, 2).T
        grown = self._numbers[:, 3] >= 0
        self._cane_lengths = np.stack([cane, np.where(grown, cane, cane + long)], 1)
        self._organ_lengths = np.stack([organ, organ + long], 1)
        self._reach = self._shares[indices]
        if self._wind is not None:
            self._swings = self._wind.swings(indices)
