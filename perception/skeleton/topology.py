"""Which cane grows from which spur: canes rooted at the two-year wood they touch."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from perception.config import SkeletonConfig
from perception.plant.model import Array, Cane, Node, Plant, Span, Spur
from perception.plant.undecided_sites import MoreToSee
from perception.segmentation.frame import View
from perception.segmentation.pixels import pixels_of
from perception.skeleton.centreline import Centreline, base_radius
from rolling_panda.messages.types import WOOD_CLASSES

_SPUR, _CORDON, _TRUNK, _OLD_CUT = (WOOD_CLASSES.index(name) for name in ("spur", "cordon", "trunk", "old cut"))
_EIGHT = np.ones((3, 3), dtype=bool)
#: Spur pixels fewer than these are a speck.
_LEAST_SPUR, _LEAST_TRUNK = 12, 300
#: Pieces of spur nearer than this are one spur that something thin crosses (m).
_SAME_SPUR = 0.025


def build_plant(view: View, labels: NDArray[np.uint8], lines: list[Centreline], config: SkeletonConfig) -> Plant:
    """Root every cane at the spur it grows from.

    Args:
        view: The frame.
        labels: Its classes.
        lines: Canes without roots.
        config: How near is touching.
    """
    # An old cut is the end of the stub on which it is; those on trunk and arms touch no spur.
    clouds = _merge(_clouds(view, labels, (_SPUR, _OLD_CUT), _LEAST_SPUR, config))
    trunks = _clouds(view, labels, (_TRUNK,), _LEAST_TRUNK, config)
    cordon = _cordon(view, labels, config)
    rooted: list[list[Cane]] = [[] for _ in clouds]
    loose: list[Array] = []
    strays: set[int] = set()
    if clouds:
        tree = cKDTree(np.concatenate(clouds))
        owner = np.repeat(np.arange(len(clouds)), [len(cloud) for cloud in clouds])
        canes = [line for line in lines if line.arc[-1] >= config.least_cane]
        ends = np.array([(line.axis[0], line.axis[-1]) for line in canes]).reshape(-1, 2, 3)
        for line, gaps, nearest in zip(canes, *tree.query(ends), strict=True):
            end = int(np.argmin(gaps))
            if gaps[end] > config.reach:
                loose.append(line.axis)
                if gaps[end] < config.stray:
                    strays.add(int(owner[nearest[end]]))
            else:
                rooted[int(owner[nearest[end]])].append(_cane(line, end == 1, float(gaps[end])))
    else:
        loose = [line.axis for line in lines]
    along = _row_direction(cordon, view)
    old_wood = cKDTree(cordon) if len(cordon) else None
    spurs = [
        _spur(view, cloud, old_wood, canes, _doubt(view, cloud, k in strays, config))
        for k, (cloud, canes) in enumerate(zip(clouds, rooted, strict=True))
    ]
    spurs.sort(key=lambda spur: float(spur.position @ along))
    return Plant(tuple(spurs), np.array([cloud.mean(axis=0) for cloud in trunks]).reshape(-1, 3), tuple(loose))


def _cane(line: Centreline, reverse: bool, gap: float) -> Cane:
    # What lies between the spur's bark and the first point that was seen is part of the cane, and counts as hidden.
    length = float(line.arc[-1])
    nodes, hidden, axis, end = line.nodes, line.hidden, line.axis, line.ends[1]
    arc = line.arc
    if reverse:
        nodes = tuple(Node(length - node.arc, node.pixels) for node in reversed(nodes))
        hidden = tuple(Span(length - span.end, length - span.start) for span in reversed(hidden))
        axis, end, arc = axis[::-1], line.ends[0], length - arc[::-1]
    radius = base_radius(line, reverse)
    start = max(0.0, gap - radius)
    return Cane(
        axis=axis,
        arc=arc + start,
        radius=radius,
        nodes=tuple(Node(node.arc + start, node.pixels) for node in nodes),
        hidden=tuple(Span(span.start + start, span.end + start) for span in hidden),
        end=end,
        base_gap=start,
    )


def _clouds(
    view: View, labels: NDArray[np.uint8], kinds: tuple[int, ...], least: int, config: SkeletonConfig
) -> list[Array]:
    """Surface points of each blob of some classes that has enough pixels of the first, each N×3 in odom (m)."""
    rows, cols = pixels_of(labels, kinds)
    depth = view.depth[rows, cols]
    near = (depth > config.nearest) & (depth < config.farthest)
    rows, cols, depth = rows[near], cols[near], depth[near].astype(float)
    if not len(rows):
        return []
    first, last = (rows.min(), cols.min()), (rows.max() + 1, cols.max() + 1)
    mask = np.zeros((last[0] - first[0], last[1] - first[1]), dtype=bool)
    mask[rows - first[0], cols - first[1]] = True
    labelled, count = ndimage.label(mask, structure=_EIGHT)
    owner = labelled[rows - first[0], cols - first[1]] - 1
    enough = np.bincount(owner, labels[rows, cols] == kinds[0], minlength=count) >= least
    points = view.points(rows, cols, depth)
    order = np.argsort(owner, kind="stable")
    bounds = np.searchsorted(owner[order], np.arange(count + 1))
    return [points[order[bounds[k] : bounds[k + 1]]] for k in range(count) if enough[k]]


def _merge(clouds: list[Array]) -> list[Array]:
    out: list[Array] = []
    for cloud in sorted(clouds, key=len, reverse=True):
        for k, other in enumerate(out):
            if np.linalg.norm(other.mean(axis=0) - cloud.mean(axis=0)) < 0.08:
                if float(cKDTree(other).query(cloud)[0].min()) < _SAME_SPUR:
                    out[k] = np.concatenate([other, cloud])
                    break
        else:
            out.append(cloud)
    return out


def _cordon(view: View, labels: NDArray[np.uint8], config: SkeletonConfig) -> Array:
    rows, cols = pixels_of(labels, (_CORDON,))
    depth = view.depth[rows, cols]
    near = np.flatnonzero((depth > config.nearest) & (depth < config.farthest))[::4]
    return view.points(rows[near], cols[near], depth[near].astype(float))


def _row_direction(cordon: Array, view: View) -> Array:
    """Unit vector along the row: the cordon's, turned to the camera's right where both allow."""
    right: Array = view.R[:, 0]
    if len(cordon) < 50:
        return right
    direction: Array = _principal(cordon - cordon.mean(axis=0))[1][0]
    return direction if float(direction[np.argmax(np.abs(direction))]) > 0.0 else -direction


def _spur(view: View, cloud: Array, cordon: cKDTree | None, canes: list[Cane], doubt: str) -> Spur:
    centre = cloud.mean(axis=0)
    spread, axes = _principal(cloud - centre)
    axis, radius = None, 0.0
    if cordon is not None and spread[0] > 1.5 * spread[1]:
        along = (cloud - centre) @ axes[0]
        ends = centre + np.outer(np.percentile(along, [2, 98]), axes[0])
        gaps, _ = cordon.query(ends)
        ends = ends if gaps[0] <= gaps[1] else ends[::-1]
        across = (cloud - centre) @ axes[1]
        least, most = np.percentile(across, [5, 95])
        radius = float(most - least) / 2 * 1.05
        ray = centre - view.t
        axis = ends + _surface(ray, axes[0]) * radius * np.pi / 4
    return Spur(centre, axis, radius, tuple(sorted(canes, key=lambda cane: -cane.length)), doubt)


def _principal(off: Array) -> tuple[Array, Array]:
    """Spreads along the principal axes of points about their mean, largest first, and the axes as rows."""
    squares, axes = np.linalg.eigh(off.T @ off)
    return np.sqrt(np.maximum(squares[::-1], 0.0)), axes.T[::-1]


def _doubt(view: View, cloud: Array, stray: bool, config: SkeletonConfig) -> str:
    """Why some of the spur's canes may be out of sight."""
    height, width = view.depth.shape
    u, v, _ = view.pixels(cloud).T
    margin = config.border
    if u.min() < margin or u.max() > width - margin or v.min() < margin or v.max() > height - 1:
        return MoreToSee("the spur is at the edge of the image, so not all of its canes may be in view")
    if stray:
        return MoreToSee("a cane seems to start here, but its base is hidden")
    return ""


def _surface(ray: Array, axis: Array) -> Array:
    square = ray - float(ray @ axis) * axis
    out: Array = square / np.linalg.norm(square)
    return out
