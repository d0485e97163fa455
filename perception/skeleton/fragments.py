"""From cane pixels to fragments: ordered stretches of skeleton without a fork.

Canes that cross in the image are separated where their depths differ. Elsewhere the skeleton forks and is cut there;
`perception.skeleton.linking` joins the fragments of one cane.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree
from skimage.morphology import skeletonize

from perception.arrays import Array, Index, Labels, Mask, neighbours
from perception.config import SkeletonConfig
from perception.segmentation.frame import CANE, NODE, View, class_pixels

#: Neighbours of a skeleton pixel that make it a fork.
_FORK = 3
#: Skeleton pixels averaged into one point of a fragment.
_BIN = 4
#: Half the width of a wide cane (px), and the offsets within it in rings, from near to far.
_HALF_WIDTH = 5
_SQUARE = np.indices((2 * _HALF_WIDTH + 1,) * 2).reshape(2, -1).T - _HALF_WIDTH
_SQUARED = (_SQUARE**2).sum(axis=1)
_RINGS = tuple(_SQUARE[size == _SQUARED] for size in np.unique(_SQUARED[_SQUARED <= _HALF_WIDTH**2]))


@dataclass(frozen=True)
class CanePixels:
    """Cane and node pixels of a frame, with N pixels.

    Attributes:
        shape: Height and width of the image.
        rows: Row (N).
        cols: Column (N).
        depth: Valid depth (N, m).
        points: Surface points, N×3 in odom (m).
        node: Whether the class is node (N).
        measured: Whether the camera has depth there (N).
        component: Connected component without a depth step (N).
        touching: Pairs of neighbours in the image, P×2.
    """

    shape: tuple[int, ...]
    rows: Index
    cols: Index
    depth: Array
    points: Array
    node: Mask
    measured: Mask
    component: Index
    touching: Index

    def mask(self) -> Mask:
        """The pixels as an image, H×W."""
        image = np.zeros(self.shape, dtype=bool)
        image[self.rows, self.cols] = True
        return image


@dataclass(frozen=True)
class Fragment:
    """A stretch of skeleton without a fork: surface points in order, M×3 in odom (m), M ≥ 1, and its length (px)."""

    line: Array
    pixels: int


def find_cane_pixels(view: View, labels: Labels, measured: Mask, config: SkeletonConfig) -> CanePixels:
    """Cane and node pixels within the depth range, with their connected components.

    Args:
        view: The frame, with corrected depth.
        labels: H×W class indices.
        measured: Where the camera has depth, H×W.
        config: Depth range and depth step.
    """
    rows, cols = class_pixels(labels, (CANE, NODE))
    near = view.depth[rows, cols]
    valid = (near > config.min_depth) & (near < config.max_depth)
    rows, cols, depth = rows[valid], cols[valid], near[valid].astype(float)
    touching = neighbours(labels.shape, rows, cols)
    return CanePixels(
        labels.shape,
        rows,
        cols,
        depth,
        view.points(rows, cols, depth),
        labels[rows, cols] == NODE,
        measured[rows, cols],
        _components(touching, depth, config.depth_step),
        touching,
    )


def find_fragments(pixels: CanePixels, config: SkeletonConfig) -> list[Fragment]:
    """Skeletonise each component and cut the skeletons at their forks.

    Args:
        pixels: Cane pixels.
        config: Least size of a fragment.
    """
    if not len(pixels.rows):
        return []
    out: list[Fragment] = []
    layer = _layers(pixels)
    for number in range(int(layer.max()) + 1):
        chosen = np.nonzero(layer == number)[0]
        # Cropped to the canes, for speed.
        rows, cols = pixels.rows[chosen], pixels.cols[chosen]
        rows, cols = rows - (rows.min() - 1), cols - (cols.min() - 1)
        image = np.zeros((rows.max() + 2, cols.max() + 2), dtype=bool)
        image[rows, cols] = True
        out += _layer_fragments(pixels.points[chosen], rows, cols, skeletonize(image), config)
    return out


def _layer_fragments(points: Array, rows: Index, cols: Index, skeleton: Mask, config: SkeletonConfig) -> list[Fragment]:
    """Fragments of one layer, from its surface points and pixels in an image with an empty border."""
    at, beside = np.nonzero(skeleton)
    neighbours = sum(skeleton[at + dr, beside + dc].astype(np.int8) for dr in (-1, 0, 1) for dc in (-1, 0, 1)) - 1
    simple = neighbours < _FORK
    at, beside = at[simple], beside[simple]
    if not len(at):
        return []
    owner, order, lengths = _paths(skeleton.shape, at, beside)
    nearest = _nearest(skeleton.shape, at, beside, rows, cols)
    bins = np.maximum(1, lengths // _BIN)
    first = np.concatenate([[0], np.cumsum(bins)])
    joined = owner[nearest]
    into = first[joined] + np.minimum(order[nearest] // _BIN, bins[joined] - 1)
    weight = np.bincount(into, minlength=first[-1])
    sums = np.stack([np.bincount(into, points[:, i], minlength=first[-1]) for i in range(3)], axis=1)
    line = sums / np.maximum(weight, 1)[:, None]
    out = []
    for k in np.flatnonzero(lengths >= config.min_fragment_pixels):
        part = slice(first[k], first[k + 1])
        out.append(Fragment(line[part][weight[part] > 0], int(lengths[k])))
    return out


def _nearest(shape: tuple[int, ...], at: Index, beside: Index, rows: Index, cols: Index) -> Index:
    """Index of the nearest skeleton pixel of each pixel.

    Canes are a few pixels wide: a search ring by ring takes a third of the time of a k-d tree. The tree is used for the
    few pixels without a near or with no unique nearest skeleton pixel.
    """
    # Flattened with an empty border, so that every neighbour is at a constant offset.
    stride = shape[1] + 2 * _HALF_WIDTH
    number = np.full((shape[0] + 2 * _HALF_WIDTH) * stride, -1, dtype=np.int32)
    number[(at + _HALF_WIDTH) * stride + beside + _HALF_WIDTH] = np.arange(len(at))
    place = (rows + _HALF_WIDTH) * stride + cols + _HALF_WIDTH
    out = np.full(len(rows), -1, dtype=np.intp)
    left = np.arange(len(rows))
    for ring in _RINGS:
        # Empty pixels are −1: in a ring with one number the sum gives that number.
        found = [number[place + step] for step in (ring @ [stride, 1]).tolist()]
        hits, total = np.zeros(len(left), dtype=np.int8), np.zeros(len(left), dtype=np.int64)
        for each in found:
            hits += each >= 0
            total += each
        single = hits == 1
        out[left[single]] = total[single] + len(found) - 1
        none = hits == 0
        left, place = left[none], place[none]
        if not len(left):
            break
    rest = np.flatnonzero(out < 0)
    if len(rest):
        tree = cKDTree(np.stack([at, beside], axis=1))
        out[rest] = tree.query(np.stack([rows[rest], cols[rest]], axis=1), workers=1)[1]
    return out


def _paths(shape: tuple[int, ...], rows: Index, cols: Index) -> tuple[Index, Index, Index]:
    """Path of each pixel, its distance from one end of the path, and the length of each path (px).

    A closed loop starts at one of its pixels and is ordered in both directions.
    """
    pairs = neighbours(shape, rows, cols)
    size = len(rows)
    graph = sparse.coo_matrix((np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])), (size, size))
    count, owner = csgraph.connected_components(graph, directed=False)
    degree = np.bincount(pairs.ravel(), minlength=size)
    # The last assignment wins: of each path the pixel with the fewest neighbours.
    ends = np.zeros(count, dtype=np.intp)
    by_degree = np.argsort(-degree, kind="stable")
    ends[owner[by_degree]] = by_degree
    along = csgraph.dijkstra(graph, directed=False, indices=ends, unweighted=True, min_only=True)
    return owner.astype(np.intp), along.astype(np.intp), np.bincount(owner, minlength=count)


def _components(pairs: Index, depth: Array, step: float) -> Index:
    """Connected component of each pixel, without a depth step between neighbours."""
    if not len(depth):
        return np.zeros(0, dtype=np.intp)
    near = np.abs(depth[pairs[:, 0]] - depth[pairs[:, 1]]) < step
    joined = pairs[near]
    graph = sparse.coo_matrix((np.ones(len(joined)), (joined[:, 0], joined[:, 1])), (len(depth), len(depth)))
    _, labels = csgraph.connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.intp)


def _layers(pixels: CanePixels) -> Index:
    """Layer of each pixel (greedy graph colouring): components that touch in the image are in different layers."""
    pairs = pixels.component[pixels.touching]
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    sizes = np.bincount(pixels.component)
    # Specks of noise are ignored, since they would only add layers.
    beside: dict[int, set[int]] = {}
    for a, b in pairs:
        if min(sizes[a], sizes[b]) >= 3:
            beside.setdefault(int(a), set()).add(int(b))
            beside.setdefault(int(b), set()).add(int(a))
    layer = np.zeros(len(sizes), dtype=np.intp)
    done: set[int] = set()
    for component in np.argsort(-sizes, kind="stable"):
        used = {int(layer[other]) for other in beside.get(int(component), set()) & done}
        layer[component] = next(n for n in range(len(used) + 1) if n not in used)
        done.add(int(component))
    out: Index = layer[pixels.component]
    return out
