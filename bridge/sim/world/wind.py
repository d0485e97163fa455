"""Wind: every cane sways about its base. Wires hold it, so that its tip moves little more than its middle."""

import math
from collections.abc import Collection, Sequence
from typing import TypeVar

import numpy as np

from bridge.sim.vineyard.row import Array, Rod, Row

#: Height along a cane at which its amplitude is the one configured (m), and the frequencies (Hz).
_AT, _FREQUENCIES = 0.3, (0.5, 2.0)
Lengths = TypeVar("Lengths", float, Array)
#: Reach of a rod that stands still: shares of the amplitude at its ends, frequency (Hz), phase (rad).
_STILL = (0.0, 0.0, 0.0, 0.0)


class Wind:
    """Moves the canes of a row. Rods keep their indices, and a place on a rod its fraction of the length.

    Attributes:
        amplitude: 0.3 m above the base of a cane (m).
    """

    def __init__(self, row: Row, amplitude: float, seed: int) -> None:
        """Draw direction, frequencies and phases.

        Args:
            row: Before any cut.
            amplitude: 0.3 m above the base of a cane (m).
            seed: Not negative.
        """
        azimuth = np.random.default_rng([seed, 0x317D]).uniform(0.0, math.tau)
        self.amplitude = amplitude
        self._direction = amplitude * np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
        canes: dict[tuple[int, int, int], tuple[float, float]] = {}
        self._reach: dict[int, tuple[float, float, float, float]] = {}
        beyond: dict[int, float] = {}
        for index, rod in row.standing():
            if rod.cane < 0:
                continue
            cane = (rod.vine, rod.spur, rod.cane)
            if cane not in canes:
                # A stream for each, so that a cane sways alike whatever else stands.
                rng = np.random.default_rng([seed, 0x317D, *cane])
                canes[cane] = float(rng.uniform(*_FREQUENCIES)), float(rng.uniform(0.0, math.tau))
            base = beyond.get(rod.parent, 0.0)
            beyond[index] = base + float(np.linalg.norm(rod.end - rod.start))
            self._reach[index] = (bend(base), bend(beyond[index]), *canes[cane])

    def blown(self, row: Row, at: float, near: Collection[int] | None = None) -> Row:
        """The row at a time (s); only rods `near` are moved where given."""
        rods = [
            rod if rod is None or (near is not None and index not in near) else self._moved(index, rod, at)
            for index, rod in enumerate(row.rods)
        ]
        return Row(tuple(rods), row.revision, row.backdrop, row.lying)

    def shares(self, index: int) -> tuple[float, float]:
        """How far both ends of a rod swing, as multiples of the amplitude; 0 for one that stands still."""
        reach = self._reach.get(index)
        return (0.0, 0.0) if reach is None else reach[:2]

    def swings(self, indices: Sequence[int]) -> Array:
        """Frequency (Hz) and phase (rad) of each rod (n×2)."""
        return np.array([self._reach.get(index, _STILL)[2:] for index in indices]).reshape(-1, 2)

    def pushes(self, swings: Array, at: float) -> Array:
        """Displacement at a time (s) that each rod's share is of (n×3, m, world), from its frequency and phase."""
        pushes: Array = np.sin(math.tau * swings[:, 0] * at + swings[:, 1])[:, None] * self._direction
        return pushes

    def _moved(self, index: int, rod: Rod, at: float) -> Rod:
        reach = self._reach.get(index)
        if reach is None:
            return rod
        first, last, frequency, phase = reach
        push: Array = self._direction * math.sin(math.tau * frequency * at + phase)
        start, end = rod.start + first * push, rod.end + last * push
        # Thousands of rods a picture, for which `replace` takes as long as their mesh.
        radii, numbers = (rod.start_radius, rod.end_radius), (rod.parent, rod.vine, rod.spur, rod.cane)
        return Rod(rod.kind, start, end, *radii, *numbers, rod.hanging, rod.organ)


def bend(along: Lengths, at: float = _AT) -> Lengths:
    """Share of a cane's displacement at a length along it: like a beam near its base, 1 at `at` (m), at most 2."""
    ratio = (along / at) ** 2
    return 2.0 * ratio / (1.0 + ratio)
