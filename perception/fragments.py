"""Cane pixels to fragments: stretches of cane without a fork, as pixels in order along their skeleton.

Canes that cross in the image are taken apart where their depths differ; where they do not, the skeleton forks and
is cut there. Joining what belongs together is the next step (`perception.linking`).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree
from skimage.morphology import skeletonize

from perception.config import SkeletonConfig
from perception.frame import Index, View
from perception.plant import Array
from rolling_panda.messages import WOOD_CLASSES

CANE, NODE = WOOD_CLASSES.index("cane"), WOOD_CLASSES.index("node")
_EIGHT = np.ones((3, 3), dtype=bool)
_HALF = ((0, 1), (1, 0), (1, 1), (1, -1))
#: Skeleton pixels averaged into one point of a fragment.
_BIN = 4


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
    """

    rows: Index
    cols: Index
    depth: Array
    points: Array
    node: NDArray[np.bool_]
    component: Index


@dataclass(frozen=True)
class Fragment:
    """A stretch of cane without a fork: surface points in order along it, M×3 in odom (m), M ≥ 1."""

    line: Array
    pixels: int


def find_wood(view: View, labels: NDArray[np.uint8], config: SkeletonConfig) -> Wood:
    """Cane and node pixels within range, and how they hang together without a step in depth."""
    mask = ((labels == CANE) | (labels == NODE)) & (view.depth > config.nearest) & (view.depth < config.farthest)
    rows, cols = np.nonzero(mask)
    depth = view.depth[rows, cols].astype(float)
    return Wood(
        rows,
        cols,
        depth,
        view.points(rows, cols, depth),
        labels[rows, cols] == NODE,
        _components(mask, rows, cols, depth, config.depth_step),
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
    layer = _layers(wood, shape)
    for number in range(int(layer.max()) + 1):
        chosen = np.nonzero(layer == number)[0]
        image = np.zeros(shape, dtype=bool)
        image[wood.rows[chosen], wood.cols[chosen]] = True
        out += _layer_fragments(wood, chosen, skeletonize(image), config)
    return out


def _layer_fragments(wood: Wood, chosen: Index, skeleton: Any, config: SkeletonConfig) -> list[Fragment]:
    neighbours = ndimage.convolve(skeleton.astype(np.uint8), _EIGHT.astype(np.uint8), mode="constant") - 1
    forks = skeleton & (neighbours >= 3)
    paths = skeleton & ~forks
    labelled, count = ndimage.label(paths, structure=_EIGHT)
    if count == 0:
        return []
    rows, cols = np.nonzero(paths)
    owner = labelled[rows, cols] - 1
    order = np.zeros(len(rows), dtype=np.intp)
    by_owner = np.argsort(owner, kind="stable")
    starts = np.searchsorted(owner[by_owner], np.arange(count + 1))
    for k in range(count):
        members = by_owner[starts[k] : starts[k + 1]]
        order[members[_walk(rows[members], cols[members])]] = np.arange(len(members))
    # Every cane pixel joins the skeleton pixel nearest to it.
    _, nearest = cKDTree(np.stack([rows, cols], axis=1)).query(
        np.stack([wood.rows[chosen], wood.cols[chosen]], axis=1), workers=1
    )
    pixel_owner = owner[nearest]
    pixel_bin = order[nearest] // _BIN
    out = []
    by_pixel = np.argsort(pixel_owner, kind="stable")
    bounds = np.searchsorted(pixel_owner[by_pixel], np.arange(count + 1))
    for k in range(count):
        length = int(starts[k + 1] - starts[k])
        if length < config.least_pixels:
            continue
        members = by_pixel[bounds[k] : bounds[k + 1]]
        bins = np.minimum(pixel_bin[members], max(0, length // _BIN - 1))
        weight = np.bincount(bins)
        points = wood.points[chosen[members]]
        line = np.stack([np.bincount(bins, points[:, i]) for i in range(3)], axis=1)[weight > 0]
        out.append(Fragment(line / weight[weight > 0][:, None], length))
    return out


def _walk(rows: Index, cols: Index) -> Index:
    """Indices of the pixels of one simple path, in order from one end."""
    index = {(int(r), int(c)): i for i, (r, c) in enumerate(zip(rows, cols, strict=True))}
    steps = ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))
    start = 0
    for i, (r, c) in enumerate(index):
        if sum((r + dr, c + dc) in index for dr, dc in steps) <= 1:
            start = i
            break
    keys = list(index)
    here, seen, out = keys[start], {start}, [start]
    while True:
        for dr, dc in steps:
            beside = index.get((here[0] + dr, here[1] + dc))
            if beside is not None and beside not in seen:
                break
        else:
            break
        seen.add(beside)
        out.append(beside)
        here = keys[beside]
    # What a walk cannot reach (a corner of a loop) is put at its end.
    out += [i for i in range(len(keys)) if i not in seen]
    return np.array(out, dtype=np.intp)


def _components(mask: NDArray[np.bool_], rows: Index, cols: Index, depth: Array, step: float) -> Index:
    pairs = _neighbours(mask, rows, cols)
    near = np.abs(depth[pairs[:, 0]] - depth[pairs[:, 1]]) < step
    joined = pairs[near]
    graph = sparse.coo_matrix((np.ones(len(joined), dtype=bool), (joined[:, 0], joined[:, 1])), (len(rows), len(rows)))
    if not len(rows):
        return np.zeros(0, dtype=np.intp)
    _, labels = csgraph.connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.intp)


def _neighbours(mask: NDArray[np.bool_], rows: Index, cols: Index) -> Index:
    """Pairs of cane pixels that touch, as indices, P×2."""
    height, width = mask.shape
    number = np.full(mask.shape, -1, dtype=np.intp)
    number[rows, cols] = np.arange(len(rows))
    out = []
    for dr, dc in _HALF:
        r, c = rows + dr, cols + dc
        inside = (r < height) & (c >= 0) & (c < width)
        beside = number[r[inside], c[inside]]
        here = np.nonzero(inside)[0]
        out.append(np.stack([here[beside >= 0], beside[beside >= 0]], axis=1))
    return np.concatenate(out)


def _layers(wood: Wood, shape: tuple[int, ...]) -> Index:
    """A layer number for each pixel, so that components that touch in the image lie in different layers."""
    mask = np.zeros(shape, dtype=bool)
    mask[wood.rows, wood.cols] = True
    pairs = wood.component[_neighbours(mask, wood.rows, wood.cols)]
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
