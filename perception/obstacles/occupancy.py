"""Occupancy grid of one class of wood, after OctoMap (Hornung et al. 2013).

Each cell has log odds: a frame that shows the wood there adds to them, and a frame whose depth ray passes through the
cell, or that shows something else there, subtracts. A cell becomes occupied after several hits and stays so until it is
refuted; other cells decay when they are not seen again.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.arrays import Array, Index, Labels, Mask
from perception.plant.capsules import CapsuleSet
from perception.segmentation.frame import BACKGROUND, GROUND, View, class_pixels
from rolling_panda.messages.types import WOOD_CLASSES, WoodClass

#: Log odds of a hit and of a miss (OctoMap's).
_HIT, _MISS = 0.85, 0.4
#: Decay of a cell that is in view, not occupied, and neither hit nor missed: it needs a hit in about ten frames.
_DECAY = 0.1
#: Hits at the clamping threshold (OctoMap's), so that about a dozen misses free any cell.
_MAX_HITS = 6
#: Frames that a mean covers.
_WINDOW = 50
#: Bits of a cell index along an axis.
_BITS = 21
#: Standard deviation of a stereo camera's depth at 1 m (m); it grows with the square of the distance.
_DEPTH_NOISE = 0.004
#: Smallest fraction of valid depth in the image of an uncovered camera.
_MIN_VALID_DEPTH = 0.2
#: Smallest depth at which a cell can be checked (m).
_MIN_DEPTH = 0.1
_EIGHT_NEIGHBOURS = ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1))


@dataclass(frozen=True)
class OccupiedCells:
    """The occupied cells of a grid.

    Attributes:
        position: Mean of the points in each (N×3, m, odom).
        variance: Variance of these points along each axis (N×3, m²).
        view_direction: Mean viewing direction (N×3): the axis of the wood is behind the surface.
        weight: Mean number of points in a frame (N).
    """

    position: Array
    variance: Array
    view_direction: Array
    weight: Array

    def __len__(self) -> int:
        """Number of cells."""
        return len(self.position)

    def select(self, which: Mask | Index) -> "OccupiedCells":
        """Some of the cells, by mask or index."""
        return OccupiedCells(self.position[which], self.variance[which], self.view_direction[which], self.weight[which])


class OccupancyGrid:
    """A sparse cubic grid for one class of wood."""

    def __init__(self, kind: WoodClass, cell_size: float, min_hits: int, max_cells: int) -> None:
        """Start without cells.

        Args:
            kind: Class of the wood.
            cell_size: Side of a cell (m).
            min_hits: Frames that must have shown a cell, more than refuted it.
            max_cells: Largest number of cells; those farthest from the camera are dropped.
        """
        self._class, self._size, self._max_cells = WOOD_CLASSES.index(kind), cell_size, max_cells
        # A wire may be thinner than a pixel: rays beside it do not refute it.
        self._half_window = 2 if kind == "wire" else 1
        self._threshold, self._clamp = min_hits * _HIT - 1e-9, max(min_hits, _MAX_HITS) * _HIT
        self._key = np.zeros(0, dtype=np.int64)
        self._odds, self._occupied = np.zeros(0), np.zeros(0, dtype=bool)
        self._hits, self._weight = np.zeros(0), np.zeros(0)
        self._position, self._square, self._direction = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3))

    def __len__(self) -> int:
        """Number of cells."""
        return len(self._key)

    def update(
        self, view: View, labels: Labels, min_depth: float, max_depth: float, max_points: int, only_add: bool = False
    ) -> None:
        """Add one frame.

        Args:
            view: The frame.
            labels: H×W class indices.
            min_depth: Nearer pixels make no hit, but their rays still make misses (m).
            max_depth: The same for farther pixels (m).
            max_points: Approximate number of pixels used.
            only_add: No misses: a frame whose classes are doubtful forgets nothing.
        """
        rows, cols = class_pixels(labels, (self._class,))
        depth = view.depth[rows, cols]
        used = np.flatnonzero((depth > min_depth) & (depth < max_depth))
        used = used[:: max(1, len(used) // max_points)]
        rows, cols = rows[used], cols[used]
        inner = self._off_edges(view.depth, labels, rows, cols)
        hit = self._add_hits(view, rows[inner], cols[inner])
        if not only_add:
            self._add_misses(view, labels, hit, min_depth, max_depth)
        self._occupied = np.where(self._occupied, self._odds >= _HIT, self._odds >= self._threshold)
        self._prune(view.t)

    def occupied(self) -> OccupiedCells:
        """The occupied cells."""
        chosen = self._occupied
        position, direction = self._position[chosen], self._direction[chosen]
        direction = direction / np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
        variance = np.maximum(self._square[chosen] - position**2, 0.0)
        return OccupiedCells(position, variance, direction, self._weight[chosen])

    def forget(self, wood: CapsuleSet, within: float) -> None:
        """Forget the cells nearer than this to the surface of some wood (m)."""
        if len(self._key):
            self._odds[wood.nearest(self._position) < within] = 0.0
            self._occupied &= self._odds > 0.0

    def _off_edges(self, depth: NDArray[np.float32], labels: Labels, rows: Index, cols: Index) -> Index:
        """Indices of pixels with neighbours of their class at their depth: edges have mixed depths."""
        height, width = depth.shape
        here = depth[rows, cols]
        near = 0.015 + 3 * _DEPTH_NOISE * here**2
        count = np.zeros(len(rows), dtype=int)
        for down, right in _EIGHT_NEIGHBOURS:
            y, x = np.clip(rows + down, 0, height - 1), np.clip(cols + right, 0, width - 1)
            count += (labels[y, x] == self._class) & (np.abs(depth[y, x] - here) < near)
        return np.flatnonzero(count >= (1 if self._half_window > 1 else 3))

    def _add_hits(self, view: View, rows: Index, cols: Index) -> Mask:
        """Add the points of one frame; returns which of all cells were hit."""
        if len(rows) == 0:
            return np.zeros(len(self._key), dtype=bool)
        points = view.points(rows, cols, view.depth[rows, cols])
        keys, inverse, counts = np.unique(_keys(points, self._size), return_inverse=True, return_counts=True)
        sums = np.stack([np.bincount(inverse, points[:, i]) for i in range(3)], axis=1) / counts[:, None]
        squares = np.stack([np.bincount(inverse, points[:, i] ** 2) for i in range(3)], axis=1) / counts[:, None]
        direction = sums - view.t
        direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
        self._insert(keys)
        cells = np.searchsorted(self._key, keys)
        self._odds[cells] = np.minimum(self._odds[cells] + _HIT, self._clamp)
        self._hits[cells] = np.minimum(self._hits[cells] + 1, _WINDOW)
        hits = self._hits[cells]
        for mean, new in ((self._position, sums), (self._square, squares), (self._direction, direction)):
            mean[cells] += (new - mean[cells]) / hits[:, None]
        self._weight[cells] += (counts - self._weight[cells]) / hits
        hit = np.zeros(len(self._key), dtype=bool)
        hit[cells] = True
        return hit

    def _add_misses(self, view: View, labels: Labels, hit: Mask, min_depth: float, max_depth: float) -> None:
        """Subtract from the cells in view that the frame has not hit."""
        height, width = view.depth.shape
        others = np.flatnonzero(~hit & (np.abs(self._position - view.t) < max_depth).all(axis=1))
        u, v, z = view.pixels(self._position[others]).T
        half = self._half_window
        inside = (z > _MIN_DEPTH) & (z < max_depth) & (u > half) & (v > half)
        inside &= (u < width - 1 - half) & (v < height - 1 - half)
        others, z = others[inside], z[inside]
        cols, rows = np.rint(u[inside]).astype(int), np.rint(v[inside]).astype(int)
        steps = np.arange(-half, half + 1)
        y, x = rows[:, None, None] + steps[:, None], cols[:, None, None] + steps
        depth, classes = view.depth[y, x], labels[y, x]
        # An invalid depth on sky or ground is a long ray, unless the camera is covered. Any other one is ignored.
        far = (depth <= 0.0) & ((classes == BACKGROUND) | (classes == GROUND))
        if np.count_nonzero(view.depth[::4, ::4]) > _MIN_VALID_DEPTH * view.depth[::4, ::4].size:
            depth = np.where(far, np.float32(np.inf), depth)
        margin = 0.5 * self._size + 3 * _DEPTH_NOISE * z**2
        through = depth.min(axis=(1, 2)) > z + margin
        # Something of another class is in the cell.
        replaced = np.abs(view.depth[rows, cols] - z) < margin
        replaced &= ~(classes == self._class).any(axis=(1, 2)) & (z > min_depth)
        self._odds[others[through | replaced]] -= _MISS
        hidden = others[~(through | replaced)]
        self._odds[hidden[~self._occupied[hidden]]] -= _DECAY

    def _insert(self, keys: NDArray[np.int64]) -> None:
        """Insert new cells in the order of their keys."""
        new = keys[~np.isin(keys, self._key)]
        if len(new) == 0:
            return
        order = np.argsort(np.concatenate([self._key, new]), kind="stable")
        self._key = np.concatenate([self._key, new])[order]
        self._occupied = np.concatenate([self._occupied, np.zeros(len(new), dtype=bool)])[order]
        for name in ("_odds", "_hits", "_weight"):
            setattr(self, name, np.concatenate([getattr(self, name), np.zeros(len(new))])[order])
        for name in ("_position", "_square", "_direction"):
            setattr(self, name, np.concatenate([getattr(self, name), np.zeros((len(new), 3))])[order])

    def _prune(self, camera: Array) -> None:
        """Drop refuted cells, and the farthest ones above the largest number."""
        keep = self._odds > 0.0
        if np.count_nonzero(keep) > self._max_cells:
            range_ = np.where(keep, np.linalg.norm(self._position - camera, axis=1), np.inf)
            keep &= range_ <= np.partition(range_, self._max_cells - 1)[self._max_cells - 1]
        if keep.all():
            return
        for name in ("_key", "_odds", "_occupied", "_hits", "_weight", "_position", "_square", "_direction"):
            setattr(self, name, getattr(self, name)[keep])


def _keys(points: Array, size: float) -> NDArray[np.int64]:
    """Key of the cell of each point."""
    half = 1 << (_BITS - 1)
    cell = np.floor(points / size).astype(np.int64) + half
    out: NDArray[np.int64] = (cell[:, 0] << (2 * _BITS)) | (cell[:, 1] << _BITS) | cell[:, 2]
    return out
