"""Plant topology: canes rooted at the spur that they touch."""

from dataclasses import replace

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from perception.arrays import Array, Index, Labels, Mask, distance
from perception.config import SkeletonConfig
from perception.plant.model import SURFACE_OFFSET, Cane, Node, Plant, Span, Spur
from perception.segmentation.depth_inpainting import inpaint_depth, interpolate_lost_depth
from perception.segmentation.frame import (
    ANY_WOOD,
    BACKGROUND,
    CANE,
    CORDON,
    NODE,
    OLD_CUT,
    SPUR,
    TRUNK,
    View,
    class_pixels,
)
from perception.skeleton.centreline import Centreline, base_radius, centrelines
from perception.skeleton.fragments import find_cane_pixels, find_fragments
from perception.skeleton.linking import link_fragments
from rolling_panda import reasons
from rolling_panda.messages.types import CutKind, Reason

#: 8-connectivity.
_CONNECTIVITY = np.ones((3, 3), dtype=bool)
#: Least pixels of a spur and of a trunk.
_MIN_SPUR, _MIN_TRUNK = 12, 300
#: Blobs of spur nearer than this, with centres nearer than this, are one spur behind something thin (m).
_SAME_SPUR, _NEAR_SPUR = 0.025, 0.08
#: Points of a stub are nearer than this to its median depth, and in so many rounds nearer than this to its axis (m).
_STUB_DEPTH, _STUB_ROUNDS, _STUB_ACROSS = 0.03, 2, 0.015
#: Percentiles of the points across a stub, which are seen evenly over its width.
_WIDTH = (5.0, 95.0)
#: Stride of the cordon pixels, and number of pixels for a direction.
_CORDON_STRIDE, _MIN_CORDON = 4, 50
#: Last year's cane of a Guyot vine is seen from so near to its trunk on, and at least so far from it (m). Its straight
#: continuation meets the trunk to within this (m).
_AT_TRUNK, _FROM_TRUNK, _MEETS = 0.08, 0.11, 0.03


def perceive_plant(view: View, labels: Labels, config: SkeletonConfig) -> Plant:
    """Spurs and canes of one frame.

    Args:
        view: The frame.
        labels: H×W class indices.
        config: Skeleton and topology.
    """
    whole, measured = _mended(view, labels, config)
    return _root_canes(whole, labels, _trace(whole, labels, measured, config), config)


def trace_canes(view: View, labels: Labels, config: SkeletonConfig, measured_only: bool = False) -> list[Centreline]:
    """Centre lines of the canes of one frame, not yet rooted; arguments as of `perceive_plant`.

    With `measured_only` they end where the camera lost depth: they tell a place in space, rather than a course.
    """
    whole, measured = _mended(view, labels, config)
    if measured_only:
        whole = replace(whole, depth=np.where(measured, whole.depth, np.float32(0.0)))
    return _trace(whole, labels, measured, config)


def trace_old_canes(view: View, labels: Labels, config: SkeletonConfig) -> list[Cane]:
    """Last year's canes of Guyot vines, each from where it leaves its trunk; arguments as of `perceive_plant`.

    They are laid along the row and have the class of a cordon.
    """
    trunks = _clouds(view, labels, (TRUNK,), _MIN_TRUNK, config)
    if not trunks:
        return []
    tree, out = cKDTree(np.concatenate(trunks)), []
    others = np.where(np.isin(labels, (CANE, NODE)), np.uint8(BACKGROUND), labels)
    for line in trace_canes(view, np.where(labels == CORDON, np.uint8(CANE), others), config):
        gaps, _ = tree.query([line.axis[0], line.axis[-1]])
        cane = _cane(line, bool(gaps[1] < gaps[0]), float(gaps.min()))
        off, _ = tree.query(cane.base - float(gaps.min()) * cane.tangent(float(cane.arc[0])))
        if gaps.min() < _AT_TRUNK and gaps.max() > _FROM_TRUNK and off < _MEETS:
            out.append(cane)
    return out


def wood_of_cut(labels: Labels, kind: CutKind) -> Labels:
    """The classes (H×W) of a picture from near, with the wood that a cut of a kind may be on as canes.

    A renewal cut is on a stub. A removal is on last year's cane: from near the network takes it for any wood.
    """
    if kind == "renewal cut":
        return np.where(labels == SPUR, np.uint8(CANE), labels)
    if kind == "removal":
        return np.where(np.isin(labels, ANY_WOOD), np.uint8(CANE), labels)
    return labels


def _mended(view: View, labels: Labels, config: SkeletonConfig) -> tuple[View, Mask]:
    """The frame with depth that was lost on wood interpolated, and where depth was measured."""
    measured = inpaint_depth(view, labels, config)
    return interpolate_lost_depth(measured, labels, config), measured.depth > 0.0


def _trace(view: View, labels: Labels, measured: Mask, config: SkeletonConfig) -> list[Centreline]:
    pixels = find_cane_pixels(view, labels, measured, config)
    chains = link_fragments(view, find_fragments(pixels, config), pixels.mask(), config)
    return centrelines(view, pixels, chains, config)


def _root_canes(view: View, labels: Labels, lines: list[Centreline], config: SkeletonConfig) -> Plant:
    """Root every cane at the spur that one of its ends touches."""
    # An old cut is the end of its stub; those on trunk and cordon touch no spur.
    clouds = _merge(_clouds(view, labels, (SPUR, OLD_CUT), _MIN_SPUR, config))
    trunks = _clouds(view, labels, (TRUNK,), _MIN_TRUNK, config)
    cordon = _cordon(view, labels, config)
    rooted: list[list[Cane]] = [[] for _ in clouds]
    unrooted: list[Array] = []
    strays: set[int] = set()
    if clouds:
        tree = cKDTree(np.concatenate(clouds))
        owner = np.repeat(np.arange(len(clouds)), [len(cloud) for cloud in clouds])
        canes = [line for line in lines if line.arc[-1] >= config.min_cane_length]
        ends = np.array([(line.axis[0], line.axis[-1]) for line in canes]).reshape(-1, 2, 3)
        for line, gaps, nearest in zip(canes, *tree.query(ends), strict=True):
            end = int(np.argmin(gaps))
            if gaps[end] > config.root_distance:
                unrooted.append(line.axis)
                if gaps[end] < config.stray_distance:
                    strays.add(int(owner[nearest[end]]))
            else:
                rooted[int(owner[nearest[end]])].append(_cane(line, end == 1, float(gaps[end])))
    else:
        unrooted = [line.axis for line in lines]
    along = _row_direction(cordon, view)
    old_wood = cKDTree(cordon) if len(cordon) else None
    spurs = [
        _spur(view, cloud, old_wood, canes, _incomplete(view, cloud, k in strays, config))
        for k, (cloud, canes) in enumerate(zip(clouds, rooted, strict=True))
    ]
    spurs.sort(key=lambda spur: float(spur.position @ along))
    return Plant(tuple(spurs), np.array([cloud.mean(axis=0) for cloud in trunks]).reshape(-1, 3), tuple(unrooted))


def _cane(line: Centreline, reverse: bool, gap: float) -> Cane:
    # The stretch between the spur's surface and the first visible point is part of the cane.
    length = float(line.arc[-1])
    nodes, hidden, axis, end = line.nodes, line.hidden, line.axis, line.ends[1]
    arc = line.arc
    if reverse:
        nodes = tuple(Node(length - node.arc, node.pixels) for node in reversed(nodes))
        hidden = tuple(Span(length - span.end, length - span.start) for span in reversed(hidden))
        axis, end, arc = axis[::-1], line.ends[0], length - arc[::-1]
    radius = base_radius(line, reverse)
    start = max(0.0, gap - radius)
    cane = Cane(axis, arc, radius, tuple(nodes), tuple(hidden), end, base_gap=start)
    return cane.shifted(start)


def _clouds(
    view: View, labels: Labels, classes: tuple[int, ...], min_pixels: int, config: SkeletonConfig
) -> list[Array]:
    """Point cloud of each blob of some classes with enough pixels of the first class, each N×3 in odom (m)."""
    rows, cols, depth = _in_range(view, labels, classes, config)
    if not len(rows):
        return []
    first, last = (rows.min(), cols.min()), (rows.max() + 1, cols.max() + 1)
    mask = np.zeros((last[0] - first[0], last[1] - first[1]), dtype=bool)
    mask[rows - first[0], cols - first[1]] = True
    labelled, count = ndimage.label(mask, structure=_CONNECTIVITY)
    owner = labelled[rows - first[0], cols - first[1]] - 1
    enough = np.bincount(owner, labels[rows, cols] == classes[0], minlength=count) >= min_pixels
    points = view.points(rows, cols, depth)
    order = np.argsort(owner, kind="stable")
    bounds = np.searchsorted(owner[order], np.arange(count + 1))
    return [points[order[bounds[k] : bounds[k + 1]]] for k in range(count) if enough[k]]


def _in_range(
    view: View, labels: Labels, classes: tuple[int, ...], config: SkeletonConfig
) -> tuple[Index, Index, Array]:
    """Rows, columns and depth (m) of the pixels of some classes within the depth range."""
    rows, cols = class_pixels(labels, classes)
    depth = view.depth[rows, cols]
    valid = (depth > config.min_depth) & (depth < config.max_depth)
    return rows[valid], cols[valid], depth[valid].astype(float)


def _merge(clouds: list[Array]) -> list[Array]:
    out: list[Array] = []
    for cloud in sorted(clouds, key=len, reverse=True):
        for k, other in enumerate(out):
            near = distance(other.mean(axis=0), cloud.mean(axis=0)) < _NEAR_SPUR
            if near and cKDTree(other).query(cloud)[0].min() < _SAME_SPUR:
                out[k] = np.concatenate([other, cloud])
                break
        else:
            out.append(cloud)
    return out


def _cordon(view: View, labels: Labels, config: SkeletonConfig) -> Array:
    rows, cols, depth = (each[::_CORDON_STRIDE] for each in _in_range(view, labels, (CORDON,), config))
    return view.points(rows, cols, depth)


def _row_direction(cordon: Array, view: View) -> Array:
    """Unit vector along the row: that of the cordon, else the camera's right."""
    right: Array = view.R[:, 0]
    if len(cordon) < _MIN_CORDON:
        return right
    direction: Array = _principal(cordon - cordon.mean(axis=0))[1][0]
    return direction if float(direction[np.argmax(np.abs(direction))]) > 0.0 else -direction


def _spur(view: View, cloud: Array, cordon: cKDTree | None, canes: list[Cane], incomplete: Reason | None) -> Spur:
    wood = _of_stub(view, cloud)
    centre = wood.mean(axis=0)
    spread, axes = _principal(wood - centre)
    axis, radius = None, 0.0
    if cordon is not None and spread[0] > 1.5 * spread[1]:
        along = (wood - centre) @ axes[0]
        ends = centre + np.outer(np.percentile(along, [2, 98]), axes[0])
        gaps, _ = cordon.query(ends)
        ends = ends if gaps[0] <= gaps[1] else ends[::-1]
        ray = centre - view.t
        depth = ray - float(ray @ axes[0]) * axes[0]
        depth /= np.linalg.norm(depth)
        least, most = np.percentile((wood - centre) @ np.cross(axes[0], depth), _WIDTH)
        radius = float(most - least) / 2 * 100.0 / (_WIDTH[1] - _WIDTH[0])
        axis = ends + depth * radius * SURFACE_OFFSET
    return Spur(centre, axis, radius, tuple(sorted(canes, key=lambda cane: -cane.length)), incomplete)


def _of_stub(view: View, cloud: Array) -> Array:
    """The points of a spur that are on its stub (N×3, m, odom); all of them where hardly any is.

    Others are mixed pixels: at the edge of wood, with a depth between wood and background. A few of them, far behind a
    stub, turn its principal axis.
    """
    depth = (cloud - view.t) @ view.R[:, 2]
    wood = cloud[np.abs(depth - np.median(depth)) < _STUB_DEPTH]
    for _ in range(_STUB_ROUNDS):
        if len(wood) < _MIN_SPUR:
            return cloud
        off = wood - wood.mean(axis=0)
        axis = _principal(off)[1][0]
        near = np.linalg.norm(off - np.outer(off @ axis, axis), axis=1) < _STUB_ACROSS
        if near.all():
            break
        wood = wood[near]
    return wood if len(wood) >= _MIN_SPUR else cloud


def _principal(off: Array) -> tuple[Array, Array]:
    """Spread of centred points along their principal axes, largest first, and the axes as rows."""
    squares, axes = np.linalg.eigh(off.T @ off)
    return np.sqrt(np.maximum(squares[::-1], 0.0)), axes.T[::-1]


def _incomplete(view: View, cloud: Array, stray: bool, config: SkeletonConfig) -> Reason | None:
    """Why some of the spur's canes may be out of view; None if none are."""
    height, width = view.depth.shape
    u, v, _ = view.pixels(cloud).T
    margin = config.border_margin
    if u.min() < margin or u.max() > width - margin or v.min() < margin or v.max() > height - 1:
        return reasons.spur_at_image_edge()
    if stray:
        return reasons.stray_cane_hidden()
    return None
