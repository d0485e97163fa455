"""Cane pixels to fragments: stretches of cane without a fork, as pixels in order along their skeleton.

Canes that cross in the image are taken apart where their depths differ; where they do not, the skeleton forks and
is cut there. Joining what belongs together is the next step (`perception.skeleton.linking`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree
from skimage.morphology import skeletonize

from perception.config import SkeletonConfig
from perception.plant.model import Array
from perception.segmentation.frame import Index, View
from perception.segmentation.pixels import pixels_of
from rolling_panda.messages.types import WOOD_CLASSES

CANE, NODE = WOOD_CLASSES.index("cane"), WOOD_CLASSES.index("node")
_HALF = ((0, 1), (1, 0), (1, 1), (1, -1))
#: A pixel of a skeleton with so many neighbours is a fork.
_FORK = 3
#: Skeleton pixels averaged into one point of a fragment.
_BIN = 4
#: Half the width of a wide cane (px), and the places within it in rings, from near to far.
_HALF_WIDTH = 5
_SQUARE = np.indices((2 * _HALF_WIDTH + 1,) * 2).reshape(2, -1).T - _HALF_WIDTH
_FAR = (_SQUARE**2).sum(axis=1)
_RINGS = tuple(_SQUARE[size == _FAR] for size in np.unique(_FAR[_FAR <= _HALF_WIDTH**2]))


@dataclass(frozen=True)
class Wood:
    """The cane pixels of a frame.

    Attributes:
        rows: Of each pixel.
        cols: Of each pixel.
        depth: Of each pixel (m); all have a return.
        points: On the surface, N×3 in odom (m).
        node: Which pixels were classed as a node.
        component: Connected component by depth, one number a pixel.
        touching: Pairs of pixels that touch in the image, P×2.
    """

    rows: Index
    cols: Index
    depth: Array
    points: Array
    node: NDArray[np.bool_]
    component: Index
    touching: Index


@dataclass(frozen=True)
class Fragment:
    """A stretch of cane without a fork: surface points in order along it, M×3 in odom (m), M ≥ 1."""

    line: Array
    pixels: int


def find_wood(view: View, labels: NDArray[np.uint8], config: SkeletonConfig) -> Wood:
    """Cane and node pixels within range, and how they hang together without a step in depth."""
    rows, cols = pixels_of(labels, (CANE, NODE))
    near = view.depth[rows, cols]
    kept = (near > config.nearest) & (near < config.farthest)
    rows, cols, depth = rows[kept], cols[kept], near[kept].astype(float)
    touching = _neighbours(labels.shape, rows, cols)
    return Wood(
        rows,
        cols,
        depth,
        view.points(rows, cols, depth),
        labels[rows, cols] == NODE,
        _components(touching, depth, config.depth_step),
        touching,
    )


def find_fragments(wood: Wood, shape: tuple[int, ...], config: SkeletonConfig) -> list[Fragment]:
    """Skeletonise each component and cut the skeletons at their forks.

    Args:
        wood: Cane pixels.
        shape: Of the image.
        config: What is too small.
    """
    if not len(wood.rows):
        return []
    out: list[Fragment] = []
    layer = _layers(wood)
    for number in range(int(layer.max()) + 1):
        chosen = np.nonzero(layer == number)[0]
        # Only the part of the image in which there is cane costs time.
        rows, cols = wood.rows[chosen], wood.cols[chosen]
        rows, cols = rows - (rows.min() - 1), cols - (cols.min() - 1)
        image = np.zeros((rows.max() + 2, cols.max() + 2), dtype=bool)
        image[rows, cols] = True
        out += _layer_fragments(wood.points[chosen], rows, cols, skeletonize(image), config)
    return out


def _layer_fragments(
    points: Array, rows: Index, cols: Index, skeleton: NDArray[np.bool_], config: SkeletonConfig
) -> list[Fragment]:
    """Fragments of one layer: surface points of its pixels and where these are in an image with an empty border."""
    at, beside = np.nonzero(skeleton)
    neighbours = sum(skeleton[at + dr, beside + dc].astype(np.int8) for dr in (-1, 0, 1) for dc in (-1, 0, 1)) - 1
    simple = neighbours < _FORK
    at, beside = at[simple], beside[simple]
    if not len(at):
        return []
    owner, order, lengths = _paths(skeleton.shape, at, beside)
    # Every cane pixel joins the skeleton pixel nearest to it.
    nearest = _nearest(skeleton.shape, at, beside, rows, cols)
    bins = np.maximum(1, lengths // _BIN)
    first = np.concatenate([[0], np.cumsum(bins)])
    joined = owner[nearest]
    into = first[joined] + np.minimum(order[nearest] // _BIN, bins[joined] - 1)
    weight = np.bincount(into, minlength=first[-1])
    sums = np.stack([np.bincount(into, points[:, i], minlength=first[-1]) for i in range(3)], axis=1)
    line = sums / np.maximum(weight, 1)[:, None]
    out = []
    for k in np.flatnonzero(lengths >= config.least_pixels):
        part = slice(first[k], first[k + 1])
        out.append(Fragment(line[part][weight[part] > 0], int(lengths[k])))
    return out


def _nearest(shape: tuple[int, ...], at: Index, beside: Index, rows: Index, cols: Index) -> Index:
    """For each pixel the index of the skeleton pixel nearest to it in the image.

    Canes are some pixels wide, so it is looked for ring by ring, in a third of the time that a tree takes. The tree
    decides for the few pixels that have none near, or two as near as each other.
    """
    # With an empty border, row after row: every pixel's neighbours are a fixed step away.
    stride = shape[1] + 2 * _HALF_WIDTH
    number = np.full((shape[0] + 2 * _HALF_WIDTH) * stride, -1, dtype=np.int32)
    number[(at + _HALF_WIDTH) * stride + beside + _HALF_WIDTH] = np.arange(len(at))
    place = (rows + _HALF_WIDTH) * stride + cols + _HALF_WIDTH
    out = np.full(len(rows), -1, dtype=np.intp)
    left = np.arange(len(rows))
    for ring in _RINGS:
        # Numbers begin at −1, where there is none: of a ring that holds one number the sum tells which.
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
    """Pixels of simple paths: the path of each, its place along it from one end, and the number of pixels of each path.

    A closed loop is walked both ways from one of its pixels.
    """
    pairs = _neighbours(shape, rows, cols)
    size = len(rows)
    graph = sparse.coo_matrix((np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])), (size, size))
    count, owner = csgraph.connected_components(graph, directed=False)
    degree = np.bincount(pairs.ravel(), minlength=size)
    # The last written stays: of each path the pixel with the fewest neighbours.
    ends = np.zeros(count, dtype=np.intp)
    inwards = np.argsort(-degree, kind="stable")
    ends[owner[inwards]] = inwards
    along = csgraph.dijkstra(graph, directed=False, indices=ends, unweighted=True, min_only=True)
    return owner.astype(np.intp), along.astype(np.intp), np.bincount(owner, minlength=count)


def _components(pairs: Index, depth: Array, step: float) -> Index:
    if not len(depth):
        return np.zeros(0, dtype=np.intp)
    near = np.abs(depth[pairs[:, 0]] - depth[pairs[:, 1]]) < step
    joined = pairs[near]
    graph = sparse.coo_matrix((np.ones(len(joined)), (joined[:, 0], joined[:, 1])), (len(depth), len(depth)))
    _, labels = csgraph.connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.intp)


def _neighbours(shape: tuple[int, ...], rows: Index, cols: Index) -> Index:
    """Pairs of cane pixels that touch, as indices, P×2."""
    height, width = shape
    # With an empty border, row after row: every pixel's neighbours are a fixed step away.
    stride = width + 2
    number = np.full((height + 1) * stride, -1, dtype=np.int32)
    at = rows * stride + cols + 1
    number[at] = np.arange(len(rows))
    out = []
    for dr, dc in _HALF:
        beside = number[at + dr * stride + dc]
        here = np.flatnonzero(beside >= 0)
        out.append(np.stack([here, beside[here].astype(np.intp)], axis=1))
    return np.concatenate(out)


def _layers(wood: Wood) -> Index:
    """A layer number for each pixel, so that components that touch in the image lie in different layers."""
    pairs = wood.component[wood.touching]
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    sizes = np.bincount(wood.component)
    # Specks from noise would only add layers; they are put with the first and cost nothing.
    beside: dict[int, set[int]] = {}
    for a, b in pairs:
        if min(sizes[a], sizes[b]) >= 3:
            beside.setdefault(int(a), set()).add(int(b))
            beside.setdefault(int(b), set()).add(int(a))
    layer = np.zeros(len(sizes), dtype=np.intp)
    done: set[int] = set()
    for component in np.argsort(-sizes, kind="stable"):
        taken = {int(layer[other]) for other in beside.get(int(component), set()) & done}
        layer[component] = next(n for n in range(len(taken) + 1) if n not in taken)
        done.add(int(component))
    out: Index = layer[wood.component]
    return out
