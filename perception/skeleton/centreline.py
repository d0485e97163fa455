"""Chains to canes: centre line, radius, nodes and hidden stretches from the pixels that belong to each chain."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from perception.config import SkeletonConfig
from perception.plant.model import Array, CaneEnd, Node, Span
from perception.segmentation.frame import Index, View
from perception.skeleton.fragments import Wood

#: The seen half of a round rod lies on average π/4 of the radius in front of its axis.
_SURFACE = np.pi / 4
#: The radius is measured over this first stretch (m) and given for this distance from the base (m).
_RADIUS_REACH, _RADIUS_AT = 0.35, 0.06
#: Widths are measured over stretches of this length (m), each good to about this much (m): half a pixel or so.
_WIDTH_STEP, _WIDTH_NOISE = 0.01, 0.001
#: Share of its diameter that a cane loses in a metre.
_TAPER = 0.42
#: Where a cane shows too little to measure its radius (m): that of a common cane.
_FALLBACK_RADIUS = 0.004
#: Consecutive samples of an axis nearer than this make no direction (m).
_STANDSTILL = 1e-5
#: Where another cane goes on beyond an end, no farther than this from it in depth, the two run into each other (m).
_JOINED = 0.02
#: A piece of cane without pixels is hidden where it is at least this long (m); half a node.
_HIDDEN = 0.006


@dataclass(frozen=True)
class Centreline:
    """A cane without its root.

    Attributes:
        axis: Centre line, N×3 in odom (m).
        arc: Arc length from the first axis point (N, m).
        width_arc: Where along it the width was measured (K, m).
        width: Diameter there (K, m).
        nodes: What was seen of them, by arc length.
        hidden: Stretches not seen.
        ends: Why it is seen no further than its first and its last point.
    """

    axis: Array
    arc: Array
    width_arc: Array
    width: Array
    nodes: tuple[Node, ...]
    hidden: tuple[Span, ...]
    ends: tuple[CaneEnd, CaneEnd]


def centrelines(view: View, wood: Wood, chains: list[Array], config: SkeletonConfig) -> list[Centreline]:
    """Measure each chain.

    Args:
        view: The frame.
        wood: Its cane pixels.
        chains: Rough centre lines, each M×3 in odom (m), in order along the cane.
        config: Sampling and smoothing.
    """
    lines = [line for line in (_resample(chain, config.sample) for chain in chains) if line is not None]
    if not lines:
        return []
    samples = np.concatenate(lines)
    distance, nearest = cKDTree(samples).query(wood.points, workers=1, distance_upper_bound=0.02)
    pixels = np.nonzero(np.isfinite(distance))[0]
    pixels = pixels[np.argsort(nearest[pixels], kind="stable")]
    first = np.concatenate([[0], np.cumsum([len(line) for line in lines])])
    bounds = np.searchsorted(nearest[pixels], first)
    stations = [_arc(line) for line in lines]
    along = _project(samples, np.concatenate(stations), first, wood.points[pixels], nearest[pixels])
    u, v, _ = view.pixels(samples).T
    cane = np.zeros(view.depth.shape, dtype=bool)
    cane[wood.rows, wood.cols] = True
    out = []
    for k, line in enumerate(lines):
        own, part = slice(bounds[k], bounds[k + 1]), slice(first[k], first[k + 1])
        rough = _Rough(line, stations[k], u[part], v[part], pixels[own], along[own])
        measured = _measure(view, wood, cane, rough, config)
        if measured is not None:
            out.append(measured)
    return out


@dataclass(frozen=True)
class _Rough:
    """A line before it is measured.

    Attributes:
        line: Samples of it, N×3 in odom (m).
        stations: Arc length of each (N, m).
        u: Column of each in the image (N, px).
        v: Row of each (N, px).
        members: The pixels that are nearest to it (M).
        along: Arc length at each of them (M, m).
    """

    line: Array
    stations: Array
    u: Array
    v: Array
    members: Index
    along: Array


def _measure(
    view: View, wood: Wood, cane: NDArray[np.bool_], rough: _Rough, config: SkeletonConfig
) -> Centreline | None:
    line, stations, members, along = rough.line, rough.stations, rough.members, rough.along
    if len(members) < 20:
        return None
    length = float(stations[-1])
    width_arc, width = _widths(view, wood, rough, config.widening)
    radius = float(np.clip(np.median(width) / 2, 0.001, 0.05)) if len(width) else _FALLBACK_RADIUS
    axis = _smooth(line, stations, along, wood.points[members], config.smoothing)
    steps = np.linalg.norm(np.diff(axis, axis=0), axis=1)
    # Scattered pixels of a speck give no line.
    if not np.isfinite(axis).all() or steps.min() < _STANDSTILL:
        return None
    axis = _to_axis(view, axis, radius)
    return Centreline(
        axis=axis,
        arc=stations,
        width_arc=width_arc,
        width=width,
        nodes=_nodes(wood, members, along, config),
        hidden=_hidden(along, length),
        ends=_ends(view, cane, axis),
    )


def _arc(line: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def _resample(chain: Array, step: float) -> Array | None:
    """The chain smoothed enough that its arc length is that of the cane, sampled evenly."""
    if len(chain) < 3:
        return None
    # Noise in depth would lengthen a chain of raw points: order by the principal axis of a moving window instead.
    kernel = np.ones(5) / 5
    padded = np.concatenate([2 * chain[:1] - chain[2:0:-1], chain, 2 * chain[-1:] - chain[-2:-4:-1]])
    if len(padded) < len(chain) + 4:
        return None
    smooth = np.stack([np.convolve(padded[:, i], kernel, mode="valid") for i in range(3)], axis=1)
    arc = _arc(smooth)
    if arc[-1] < 2 * step:
        return None
    stations = np.linspace(0.0, arc[-1], max(3, round(arc[-1] / step) + 1))
    return np.stack([np.interp(stations, arc, smooth[:, i]) for i in range(3)], axis=1)


def _project(samples: Array, stations: Array, first: Index, points: Array, k: Index) -> Array:
    """Arc length of the foot of each point on its line, sample `k` being nearest; beyond the ends it runs on straight.

    The samples of all lines stand one after the other, those of each from one `first` to the next.
    """
    before, after = np.arange(len(samples)) - 1, np.arange(len(samples)) + 1
    before[first[:-1]], after[first[1:] - 1] = first[:-1], first[1:] - 1
    chord = samples[after] - samples[before]
    chord /= np.linalg.norm(chord, axis=1, keepdims=True)
    out: Array = stations[k] + np.einsum("ij,ij->i", points - samples[k], chord[k])
    return out


def _smooth(line: Array, stations: Array, along: Array, points: Array, width: float) -> Array:
    """Local straight-line regression of the surface points over arc length, at each station.

    Pixels are first averaged in bins as long as half the kernel, so that the cost does not grow with their number.
    """
    step = width / 3
    bins = np.clip(((along + step) / step).astype(int), 0, int(stations[-1] / step) + 2)
    count = np.bincount(bins).astype(float)
    used = count > 0
    s = np.bincount(bins, along)[used] / count[used]
    p = np.stack([np.bincount(bins, points[:, i])[used] / count[used] for i in range(3)], axis=1)
    u = s[None] - stations[:, None]
    w = np.exp(-0.5 * (u / width) ** 2) * count[used][None]
    # Where everything near is hidden, the nearest that was seen on either side still carries the line.
    w += np.exp(-0.5 * (u / (5 * width)) ** 2) * 1e-3
    s0, s1, s2 = w.sum(1), (w * u).sum(1), (w * u**2).sum(1)
    weights = w * (s2[:, None] - s1[:, None] * u) / np.maximum(s0 * s2 - s1**2, 1e-18)[:, None]
    out: Array = weights @ p
    return out


def _to_axis(view: View, surface: Array, radius: float) -> Array:
    """Move the mean of the seen surface to the axis, away from the camera and square to the cane."""
    direction = np.gradient(surface, axis=0)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    ray = surface - view.t
    square = ray - np.einsum("ij,ij->i", ray, direction)[:, None] * direction
    out: Array = surface + _SURFACE * radius * square / np.linalg.norm(square, axis=1, keepdims=True)
    return out


def base_radius(line: Centreline, reverse: bool) -> float:
    """Radius of a cane near its base, from the stretch next to it.

    Whole pixels make the width of an upright cane err by up to half a pixel over a hand's breadth, so a long stretch
    stands for it, without the places where something in front makes it look narrow or something beside it wide.

    Args:
        line: The cane.
        reverse: Whether the base is at its last point.
    """
    s, width = line.width_arc, line.width
    s = float(line.arc[-1]) - s if reverse else s
    near = s < max(_RADIUS_REACH, float(s.min(initial=np.inf)) + 0.05)
    if not near.any():
        return _FALLBACK_RADIUS
    # A cane thins outwards; over so short a stretch the pixels cannot tell how fast, so the common taper stands for it.
    base = width[near] / (1.0 - _TAPER * (s[near] - _RADIUS_AT))
    middle = float(np.median(base))
    good = np.abs(base - middle) < max(_WIDTH_NOISE, 0.2 * middle)
    width_at_base = float(np.mean(base[good])) if good.any() else middle
    return float(np.clip(width_at_base / 2, 0.001, 0.05))


def _widths(view: View, wood: Wood, rough: _Rough, widening: float) -> tuple[Array, Array]:
    """Arc lengths and widths (m) of stretches without nodes: pixels a unit of length of the image, scaled by depth."""
    line, stations, along = rough.line, rough.stations, rough.along
    pixel_arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(rough.u), np.diff(rough.v)))])
    edges = np.arange(0.0, float(stations[-1]) + 1e-9, _WIDTH_STEP)
    bins = np.floor(along / _WIDTH_STEP).astype(int)
    inside = (bins >= 0) & (bins < len(edges) - 1)
    bins, pixels, size = bins[inside], rough.members[inside], max(0, len(edges) - 1)
    count = np.bincount(bins, minlength=size)
    node = np.bincount(bins, wood.node[pixels], minlength=size)
    depth = np.bincount(bins, wood.depth[pixels], minlength=size) / np.maximum(count, 1)
    length = np.diff(np.interp(edges, stations, pixel_arc))
    focal = float(np.sqrt(view.intrinsics.fx * view.intrinsics.fy))
    use = (count > 0) & (node == 0) & (length > 1.0)
    s = (edges[:-1] + _WIDTH_STEP / 2)[use]
    pixels_wide = np.maximum(count[use] / length[use] - widening, 0.5)
    return s, pixels_wide * depth[use] / focal * _squareness(view, line, stations, s)


def _squareness(view: View, line: Array, stations: Array, arc: Array) -> Array:
    """True width over width in the image plane at some arc lengths: away from its middle an image is drawn out."""
    places = np.concatenate([arc, arc + 0.01, arc - 0.01])
    point, beyond, before = np.stack([np.interp(places, stations, line[:, i]) for i in range(3)], axis=1).reshape(
        3, -1, 3
    )
    ray = (point - view.t) @ view.R
    along = (beyond - before) @ view.R
    # Directions in the image plane: along the cane's image, and square to it.
    drawn = along[:, :2] * ray[:, 2:] - ray[:, :2] * along[:, 2:]
    across = np.stack([-drawn[:, 1], drawn[:, 0]], axis=1) / np.linalg.norm(drawn, axis=1, keepdims=True)
    (a, b, c), (x, y, z) = along.T, ray.T
    square = np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=1)
    square /= np.linalg.norm(square, axis=1, keepdims=True)
    out: Array = np.abs(np.einsum("ij,ij->i", across, square[:, :2]))
    return out


def _nodes(wood: Wood, members: Index, along: Array, config: SkeletonConfig) -> tuple[Node, ...]:
    """Runs of node pixels along the cane."""
    node = np.sort(along[wood.node[members]])
    if not len(node):
        return ()
    runs = np.split(node, np.nonzero(np.diff(node) > 0.006)[0] + 1)
    return tuple(Node(float((run[0] + run[-1]) / 2), len(run)) for run in runs if len(run) >= config.least_node_pixels)


def _hidden(along: Array, length: float) -> tuple[Span, ...]:
    """Stretches without a pixel."""
    seen = np.sort(np.concatenate([[0.0], along[(along > 0.0) & (along < length)], [length]]))
    gaps = np.nonzero(np.diff(seen) > _HIDDEN)[0]
    return tuple(Span(float(seen[g]), float(seen[g + 1])) for g in gaps)


def _ends(view: View, cane: NDArray[np.bool_], axis: Array) -> tuple[CaneEnd, CaneEnd]:
    """Why a cane is seen no further than its first and its last point."""
    tips = axis[[0, -1]]
    outward = tips - axis[[1, -2]]
    length = np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    first, last = view.pixels(tips + outward / length * 0.008)
    return _why(view, cane, *first.tolist()), _why(view, cane, *last.tolist())


def _why(view: View, cane: NDArray[np.bool_], u: float, v: float, z: float) -> CaneEnd:
    """Why a cane is not seen at a pixel and depth just beyond; where cane pixels go on, it runs into another one."""
    height, width = view.depth.shape
    col, row = round(u), round(v)
    if not (3 <= col < width - 3 and 3 <= row < height - 3 and z > 0.0):
        return "image border"
    patch: NDArray[np.float32] = view.depth[row - 1 : row + 2, col - 1 : col + 2]
    nearer = (patch > 0.0) & (patch < z - 0.01)
    joined = cane[row, col] and abs(float(view.depth[row, col]) - z) < _JOINED
    return "hidden" if nearer.any() or joined else "free"
