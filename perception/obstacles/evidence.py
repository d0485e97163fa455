"""Where one kind of wood was seen, in cells of a cubic grid, with the evidence for each and against it.

Each cell has the logarithm of its odds (Hornung et al. 2013, OctoMap): a frame that shows the wood there adds to it,
and one whose depth ray passes through the cell, or that shows something else there, takes from it. What was seen often
is held for true until it is refuted; the rest is forgotten when it is not seen again.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.plant.model import Array
from perception.segmentation.frame import Index, View
from perception.segmentation.pixels import pixels_of
from rolling_panda.messages.types import WOOD_CLASSES, WoodClass

#: Log odds that a frame adds to a cell in which it shows the wood, and takes from one that it refutes (OctoMap's).
_HIT, _MISS = 0.85, 0.4
#: What a frame takes from a cell not yet held for true that it neither shows nor refutes, as what hides behind an edge:
#: such a cell must be shown by about one frame in ten.
_FORGOTTEN = 0.1
#: No cell is surer than so many frames make it, so that a dozen or so refute each.
_SURE = 6
#: Averages look so many frames back, the noise of one frame being most of what there is.
_MEMORY = 50
#: A cell's number along an axis has so many bits.
_BITS = 21
#: Standard deviation of a stereo camera's depth at 1 m (m); it grows with the square of the distance.
_NOISE = 0.004
#: Share of an image that has a depth where nothing covers the camera.
_LEAST_DEPTH = 0.2
_BACKGROUND, _GROUND = WOOD_CLASSES.index("background"), WOOD_CLASSES.index("ground")


@dataclass(frozen=True)
class Surface:
    """Cells held for true.

    Attributes:
        place: Mean of the points seen in each (N×3, m, odom).
        spread: Variance of these points along each axis (N×3, m²).
        away: Direction in which the camera looked at them (N×3): the wood's axis lies that way.
        weight: How many points a frame shows there (N).
    """

    place: Array
    spread: Array
    away: Array
    weight: Array

    def __len__(self) -> int:
        """How many."""
        return len(self.place)

    def take(self, which: "NDArray[np.bool_] | NDArray[np.intp]") -> "Surface":
        """Some of them, by a mask or their numbers."""
        return Surface(self.place[which], self.spread[which], self.away[which], self.weight[which])


class Evidence:
    """The cells of one kind of wood."""

    def __init__(self, kind: WoodClass, size: float, hits: int, most: int) -> None:
        """Begin with nothing seen.

        Args:
            kind: Of the wood.
            size: Of a cell (m).
            hits: Frames that must have shown a cell, more than refuted it.
            most: Cells at most; the farthest from the camera are forgotten.
        """
        self._kind, self._size, self._most = WOOD_CLASSES.index(kind), size, most
        # A rod thinner than a pixel: rays beside it say nothing about it.
        self._reach = 2 if kind == "wire" else 1
        self._held, self._sure = hits * _HIT - 1e-9, max(hits, _SURE) * _HIT
        self._key = np.zeros(0, dtype=np.int64)
        self._odds, self._known = np.zeros(0), np.zeros(0, dtype=bool)
        self._times, self._weight = np.zeros(0), np.zeros(0)
        self._place, self._square, self._away = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3))

    def __len__(self) -> int:
        """How many cells are remembered."""
        return len(self._key)

    def update(self, view: View, labels: NDArray[np.uint8], nearest: float, farthest: float, points: int) -> None:
        """Take one frame in.

        Args:
            view: The frame.
            labels: H×W class indices.
            nearest: Pixels nearer than this show nothing (m); their rays still pass through what is before them.
            farthest: The same for farther ones (m).
            points: Pixels used, about.
        """
        rows, cols = pixels_of(labels, (self._kind,))
        depth = view.depth[rows, cols]
        used = np.flatnonzero((depth > nearest) & (depth < farthest))
        used = used[:: max(1, len(used) // points)]
        rows, cols = rows[used], cols[used]
        whole = self._on_surface(view.depth, labels, rows, cols)
        rows, cols = rows[whole], cols[whole]
        seen = self._add(view, rows, cols)
        self._doubt(view, labels, seen, nearest, farthest)
        self._known = np.where(self._known, self._odds >= _HIT, self._odds >= self._held)
        self._forget(view.t)

    def held(self) -> Surface:
        """The cells held for true."""
        known = self._known
        place = self._place[known]
        away = self._away[known]
        away = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
        return Surface(place, np.maximum(self._square[known] - place**2, 0.0), away, self._weight[known])

    def _on_surface(self, depth: NDArray[np.float32], labels: NDArray[np.uint8], rows: Index, cols: Index) -> Index:
        """Which pixels have neighbours of their kind at their depth: at edges a camera mixes near and far."""
        height, width = depth.shape
        here = depth[rows, cols]
        near = 0.015 + 3 * _NOISE * here**2
        count = np.zeros(len(rows), dtype=int)
        for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1)):
            y, x = np.clip(rows + down, 0, height - 1), np.clip(cols + right, 0, width - 1)
            count += (labels[y, x] == self._kind) & (np.abs(depth[y, x] - here) < near)
        # A pixel at the image's border is its own neighbour, which does no harm.
        return np.flatnonzero(count >= (1 if self._reach > 1 else 3))

    def _add(self, view: View, rows: Index, cols: Index) -> NDArray[np.bool_]:
        """Take the points of one frame in; which of all cells it has shown."""
        if len(rows) == 0:
            return np.zeros(len(self._key), dtype=bool)
        points = view.points(rows, cols, view.depth[rows, cols])
        keys, inverse, counts = np.unique(_keys(points, self._size), return_inverse=True, return_counts=True)
        sums = np.stack([np.bincount(inverse, points[:, i]) for i in range(3)], axis=1) / counts[:, None]
        squares = np.stack([np.bincount(inverse, points[:, i] ** 2) for i in range(3)], axis=1) / counts[:, None]
        away = sums - view.t
        away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
        self._make_room(keys)
        cells = np.searchsorted(self._key, keys)
        self._odds[cells] = np.minimum(self._odds[cells] + _HIT, self._sure)
        self._times[cells] = np.minimum(self._times[cells] + 1, _MEMORY)
        times = self._times[cells]
        for mean, new in ((self._place, sums), (self._square, squares), (self._away, away)):
            mean[cells] += (new - mean[cells]) / times[:, None]
        self._weight[cells] += (counts - self._weight[cells]) / times
        seen = np.zeros(len(self._key), dtype=bool)
        seen[cells] = True
        return seen

    def _doubt(
        self, view: View, labels: NDArray[np.uint8], seen: NDArray[np.bool_], nearest: float, farthest: float
    ) -> None:
        """Take from the cells in view that the frame has not shown."""
        height, width = view.depth.shape
        others = np.flatnonzero(~seen & (np.abs(self._place - view.t) < farthest).all(axis=1))
        u, v, z = view.pixels(self._place[others]).T
        reach = self._reach
        inside = (z > 0.1) & (z < farthest) & (u > reach) & (v > reach)
        inside &= (u < width - 1 - reach) & (v < height - 1 - reach)
        others, z = others[inside], z[inside]
        cols, rows = np.rint(u[inside]).astype(int), np.rint(v[inside]).astype(int)
        steps = np.arange(-reach, reach + 1)
        y, x = rows[:, None, None] + steps[:, None], cols[:, None, None] + steps
        depth, told = view.depth[y, x], labels[y, x]
        # No return from what is taken for sky or ground: the ray went far. No return from anything else tells nothing,
        # nor does one where the camera may be covered.
        far = (depth <= 0.0) & ((told == _BACKGROUND) | (told == _GROUND))
        if np.count_nonzero(view.depth[::4, ::4]) > _LEAST_DEPTH * view.depth[::4, ::4].size:
            depth = np.where(far, np.float32(np.inf), depth)
        margin = 0.5 * self._size + 3 * _NOISE * z**2
        through = depth.min(axis=(1, 2)) > z + margin
        # From so near that the classes are to be trusted, something else is where the wood was taken to be.
        other = (np.abs(view.depth[rows, cols] - z) < margin) & ~(told == self._kind).any(axis=(1, 2)) & (z > nearest)
        self._odds[others[through | other]] -= _MISS
        hidden = others[~(through | other)]
        self._odds[hidden[~self._known[hidden]]] -= _FORGOTTEN

    def _make_room(self, keys: NDArray[np.int64]) -> None:
        """Add the cells that are new, in the order of their keys."""
        new = keys[~np.isin(keys, self._key)]
        if len(new) == 0:
            return
        order = np.argsort(np.concatenate([self._key, new]), kind="stable")
        self._key = np.concatenate([self._key, new])[order]
        self._known = np.concatenate([self._known, np.zeros(len(new), dtype=bool)])[order]
        for name in ("_odds", "_times", "_weight"):
            setattr(self, name, np.concatenate([getattr(self, name), np.zeros(len(new))])[order])
        for name in ("_place", "_square", "_away"):
            setattr(self, name, np.concatenate([getattr(self, name), np.zeros((len(new), 3))])[order])

    def _forget(self, eye: Array) -> None:
        """Let go of what was refuted, and of the farthest where it is too much."""
        keep = self._odds > 0.0
        if np.count_nonzero(keep) > self._most:
            away = np.where(keep, np.linalg.norm(self._place - eye, axis=1), np.inf)
            keep &= away <= np.partition(away, self._most - 1)[self._most - 1]
        if keep.all():
            return
        for name in ("_key", "_odds", "_known", "_times", "_weight", "_place", "_square", "_away"):
            setattr(self, name, getattr(self, name)[keep])


def _keys(points: Array, size: float) -> NDArray[np.int64]:
    """One number for each point's cell."""
    half = 1 << (_BITS - 1)
    cell = np.floor(points / size).astype(np.int64) + half
    out: NDArray[np.int64] = (cell[:, 0] << (2 * _BITS)) | (cell[:, 1] << _BITS) | cell[:, 2]
    return out
