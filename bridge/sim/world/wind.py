"""Wind: every cane sways about its base. Wires hold it, so that its tip moves little more than its middle."""

import math
from collections.abc import Collection

import numpy as np

from bridge.sim.vineyard.row import Array, Rod, Row

#: Height along a cane at which its amplitude is the one configured (m), and the frequencies (Hz).
_AT, _FREQUENCIES = 0.3, (0.5, 2.0)


class Wind:
    """Moves the canes of a row. Rods keep their indices, and a place on a rod its fraction of the length."""

    def __init__(self, row: Row, amplitude: float, seed: int) -> None:
        """Draw direction, frequencies and phases.

        Args:
            row: Before any cut.
            amplitude: 0.3 m above the base of a cane (m).
            seed: Not negative.
        """
        azimuth = np.random.default_rng([seed, 0x317D]).uniform(0.0, math.tau)
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
        return Row(tuple(rods), row.revision, row.backdrop)

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


def bend(along: float) -> float:
    """Share of the amplitude at a length along the cane: like a beam near its base, at most 2."""
    ratio = (along / _AT) ** 2
    return 2.0 * ratio / (1.0 + ratio)
