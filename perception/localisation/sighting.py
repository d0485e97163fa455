"""What a frame shows that a place can be recognised by: samples of canes, posts, trunks, cordons and wires."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.ndimage import find_objects
from scipy.ndimage import label as components

from perception.arrays import Array, Index, Labels, interpolate
from perception.segmentation.frame import CORDON, POST, TRUNK, WIRE, View

#: Kinds of samples. Canes, posts and trunks tell the place along the row; cordons and wires run along it.
KINDS = ("cane", "upright", "cordon", "wire")
CANE, UPRIGHT, ALONG, WIRES = range(len(KINDS))
#: Spacing of samples of a cane, and the length from its base that is used (m): the wind moves what is beyond.
_SPACING, _LENGTH, _LEAST = 0.01, 0.25, 4
#: Rows of an upright in one sample, columns of a cordon or a wire in one (px), and least pixels of a sample.
_ROWS, _COLUMNS, _PIXELS = 16, 16, 4
#: Smallest area of an upright (px), and its distance from the border of the image (px).
_AREA, _BORDER = 400, 4
#: Depth range of samples (m).
_NEAR, _FAR = 0.3, 1.5
#: Samples to either side in the direction of a cordon.
_AROUND = 6
#: A wire is one where its pixels of a column are within this (px).
_THIN = 8
#: Independent observations that the samples of one body are worth, and of one column of a cordon or a wire.
_BODY, _COLUMN = 2.0, 0.15


class Axis(Protocol):
    """A centre line: a rooted cane from its base outwards, or one whose base is not known."""

    @property
    def axis(self) -> Array:
        """Points (N×3, m)."""

    @property
    def arc(self) -> Array:
        """Their arc lengths (N, m)."""


@dataclass(frozen=True)
class Sighting:
    """Samples of lines.

    Attributes:
        points: On the lines (N×3, m).
        directions: Of the lines there, unit (N×3).
        kinds: Index in `KINDS` (N).
        bodies: Number of the cane, post or trunk; of cordons and wires a column (N).
        weights: Independent observations that each sample is worth (N).
    """

    points: Array
    directions: Array
    kinds: Index
    bodies: Index
    weights: Array

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.points)

    def moved(self, R: Array, t: Array) -> "Sighting":
        """The samples in another frame, in which this one is turned by R (3×3) and at t (3)."""
        return Sighting(self.points @ R.T + t, self.directions @ R.T, self.kinds, self.bodies, self.weights)

    def of_kind(self, kind: int) -> Index:
        """Indices of the samples of a kind."""
        return np.flatnonzero(self.kinds == kind)


def sighting(view: View, labels: Labels, canes: Sequence[Axis]) -> Sighting:
    """Samples of one frame, in the frame of its view.

    Args:
        view: The frame.
        labels: H×W class indices.
        canes: Canes of the frame.
    """
    parts = [*_canes(canes), *_uprights(view, labels), *_along(view, labels)]
    return joined(parts)


def joined(parts: Sequence[tuple[int, Array, Array, float]]) -> Sighting:
    """A sighting from bodies: kind, points (N×3), directions (N×3), and weight of all its samples."""
    if not parts:
        none = np.zeros(0, dtype=np.intp)
        return Sighting(np.zeros((0, 3)), np.zeros((0, 3)), none, none, np.zeros(0))
    sizes = [len(points) for _, points, _, _ in parts]
    return Sighting(
        np.concatenate([points for _, points, _, _ in parts]),
        np.concatenate([directions for _, _, directions, _ in parts]),
        np.repeat([kind for kind, _, _, _ in parts], sizes).astype(np.intp),
        np.repeat(np.arange(len(parts)), sizes).astype(np.intp),
        np.repeat([weight / size for (_, _, _, weight), size in zip(parts, sizes, strict=True)], sizes),
    )


def _canes(canes: Sequence[Axis]) -> list[tuple[int, Array, Array, float]]:
    out = []
    for cane in canes:
        at = np.arange(float(cane.arc[0]), min(float(cane.arc[-1]), _LENGTH), _SPACING)
        if len(at) < _LEAST:
            continue
        chord = interpolate(at + _SPACING, cane.arc, cane.axis) - interpolate(at - _SPACING, cane.arc, cane.axis)
        out.append((CANE, interpolate(at, cane.arc, cane.axis), _unit(chord), _BODY))
    return out


def _uprights(view: View, labels: Labels) -> list[tuple[int, Array, Array, float]]:
    """Middle lines of the visible surface of posts and trunks."""
    out = []
    blobs, count = components((labels == POST) | (labels == TRUNK))
    width = labels.shape[1]
    for k, box in enumerate(find_objects(blobs, count)):
        if box is None or box[1].start < _BORDER or box[1].stop > width - _BORDER:
            continue
        rows, cols = np.nonzero(blobs[box] == k + 1)
        if len(rows) < _AREA:
            continue
        rows, cols = rows + box[0].start, cols + box[1].start
        points = _binned(view, rows, cols, rows // _ROWS)
        if len(points) >= _LEAST:
            out.append((UPRIGHT, points, np.tile(_principal(points), (len(points), 1)), _BODY))
    return out


def _along(view: View, labels: Labels) -> list[tuple[int, Array, Array, float]]:
    """Middle lines of cordons and wires. A wire is too thin for a direction of its own: it has the cordon's."""
    out = []
    rows, cols = np.nonzero(labels == CORDON)
    points, row = _binned(view, rows, cols, cols // _COLUMNS), view.R[:, 0]
    if len(points) > 2 * _AROUND:
        row = _principal(points)
        out.append((ALONG, points, _local(points), _COLUMN * len(points)))
    rows, cols = np.nonzero(labels == WIRE)
    if len(rows) >= _PIXELS:
        # Column by column, a gap of a few rows separates two wires.
        order = np.lexsort((rows, cols // _COLUMNS))
        rows, cols = rows[order], cols[order]
        new = (np.diff(rows) > _THIN) | (np.diff(cols // _COLUMNS) != 0)
        points = _binned(view, rows, cols, np.concatenate([[0], np.cumsum(new)]))
        if len(points):
            out.append((WIRES, points, np.tile(row, (len(points), 1)), _COLUMN * len(points)))
    return out


def _local(points: Array) -> Array:
    """Direction of a bent line at each of its points, from those around it."""
    last = len(points)
    return np.array([_principal(points[max(0, k - _AROUND) : min(last, k + _AROUND + 1)]) for k in range(last)])


def _binned(view: View, rows: Index, cols: Index, bins: Index) -> Array:
    """Mean place of the pixels of each bin (N×3) with enough depth."""
    depth = view.depth[rows, cols]
    valid = (depth > _NEAR) & (depth < _FAR)
    rows, cols, depth = rows[valid], cols[valid], depth[valid].astype(float)
    _, bins, counts = np.unique(bins[valid], return_inverse=True, return_counts=True)
    if not len(counts):
        return np.zeros((0, 3))
    order = np.argsort(bins, kind="stable")
    ends = np.cumsum(counts)
    middle = np.array([np.median(part) for part in np.split(depth[order], ends[:-1])])
    near = np.abs(depth - middle[bins]) < 0.05
    total = np.maximum(np.bincount(bins[near], minlength=len(counts)), 1)
    u, v, z = (np.bincount(bins[near], each[near], len(counts)) / total for each in (cols, rows, depth))
    points: Array = view.points(v, u, z)[counts >= _PIXELS]
    return points


def _principal(points: Array) -> Array:
    """Direction of a line of points; its sign says nothing."""
    off = points - points.mean(axis=0)
    direction: Array = np.linalg.eigh(off.T @ off)[1][:, -1]
    return direction


def _unit(vectors: Array) -> Array:
    out: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)
    return out
