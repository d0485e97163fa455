"""Wood that was seen before, as it was seen from a few places along the row."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from perception.arrays import Array, Index
from perception.localisation.sighting import KINDS, Sighting

#: Sightings that a new one is compared with, and how near along the row they have to be (m).
_COMPARED, _WITHIN = 4, 1.2


@dataclass(frozen=True)
class Matches:
    """Samples of a sighting and the lines of the map that they may be on.

    Attributes:
        rows: Index of each sample.
        places: Of the line nearest to each (N×3, m, map).
        directions: Of that line (N×3).
    """

    rows: Index
    places: Array
    directions: Array


@dataclass(frozen=True)
class Neighbourhood:
    """The lines around a place, by kind."""

    lines: tuple[Sighting, ...]
    trees: tuple[cKDTree | None, ...]

    def __len__(self) -> int:
        """Number of samples."""
        return sum(len(lines) for lines in self.lines)

    def match(self, seen: Sighting, points: Array, kind: int, within: float, aligned: float) -> Matches:
        """Nearest lines of one kind.

        Args:
            seen: The sighting.
            points: Its samples where they are now thought to be (N×3, m, map).
            kind: Index in `KINDS`.
            within: Largest distance (m).
            aligned: Smallest cosine between a line and the sample's own.
        """
        rows, tree, lines = seen.of_kind(kind), self.trees[kind], self.lines[kind]
        if tree is None or not len(rows):
            none = np.zeros((0, 3))
            return Matches(rows[:0], none, none)
        distance, nearest = tree.query(points[rows], distance_upper_bound=within)
        found = np.isfinite(distance)
        rows, nearest = rows[found], nearest[found]
        parallel = np.abs(np.einsum("ij,ij->i", seen.directions[rows], lines.directions[nearest])) > aligned
        rows, nearest = rows[parallel], nearest[parallel]
        return Matches(rows, lines.points[nearest], lines.directions[nearest])


@dataclass
class RowMap:
    """Sightings in the map, each with where the camera was (3, m). It grows with the row, not with time."""

    sightings: list[Sighting] = field(default_factory=list)
    cameras: list[Array] = field(default_factory=list)

    def add(self, seen: Sighting, camera: Array) -> None:
        """Keep a sighting, in the map."""
        self.sightings.append(seen)
        self.cameras.append(camera)

    def distance(self, camera: Array) -> float:
        """From a place (3, m) to the nearest from which a sighting was kept (m); infinite without any."""
        return min((float(np.linalg.norm(each - camera)) for each in self.cameras), default=np.inf)

    def around(self, camera: Array) -> Neighbourhood:
        """The lines seen from the places nearest to one (3, m)."""
        away = np.array([np.linalg.norm(each - camera) for each in self.cameras])
        order = [int(k) for k in np.argsort(away)[:_COMPARED] if away[k] < _WITHIN]
        return neighbourhood([self.sightings[k] for k in order])


def neighbourhood(sightings: Sequence[Sighting]) -> Neighbourhood:
    """The lines of some sightings."""
    lines, trees = [], []
    for kind in range(len(KINDS)):
        rows = [each.of_kind(kind) for each in sightings]
        none = np.zeros((0, 3))
        points = np.concatenate([none, *(each.points[r] for each, r in zip(sightings, rows, strict=True))])
        directions = np.concatenate([none, *(each.directions[r] for each, r in zip(sightings, rows, strict=True))])
        count = np.zeros(len(points), dtype=np.intp)
        lines.append(Sighting(points, directions, count + kind, count, np.ones(len(points))))
        trees.append(cKDTree(points) if len(points) else None)
    return Neighbourhood(tuple(lines), tuple(trees))
