"""From chains to canes: centre line, width, nodes and hidden stretches from the pixels of each chain."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from perception.arrays import Array, Index, Mask, interpolate
from perception.config import SkeletonConfig
from perception.plant.model import SURFACE_OFFSET, CaneEnd, Node, Span
from perception.segmentation.frame import View
from perception.skeleton.fragments import CanePixels

#: The radius is measured over this first stretch (m) and given for this distance from the base (m).
_RADIUS_STRETCH, _RADIUS_AT = 0.35, 0.06
#: Widths are measured over stretches of this length (m), with about this error (m): half a pixel.
_WIDTH_STEP, _WIDTH_NOISE = 0.01, 0.001
#: Relative loss of diameter of a cane in a metre.
_TAPER = 0.42
#: Radius of a common cane, where none can be measured, and the range of measured radii (m).
_FALLBACK_RADIUS, _MIN_RADIUS, _MAX_RADIUS = 0.004, 0.001, 0.05
#: Pixels that a chain needs, and their largest distance from its samples (m).
_MIN_PIXELS, _MAX_DISTANCE = 20, 0.02
#: Least distance of consecutive axis samples (m).
_MIN_STEP = 1e-5
#: Pixels lie at one place if their spread along a line is less than this share of their square distances.
_LEAST_SPREAD = 1e-9
#: An end with another cane within this depth beyond it is joined to that cane (m).
_JOINED = 0.02
#: Least length of a hidden stretch (m): half a node. The same gap separates two nodes.
_MIN_HIDDEN = 0.006
#: An end is probed this far beyond its last point (m); something nearer than this in front of it occludes it (m).
_PROBE, _OCCLUDER = 0.008, 0.01


@dataclass(frozen=True)
class Centreline:
    """A cane, not yet rooted.

    Attributes:
        axis: Centre line, N×3 in odom (m).
        arc: Arc length from the first axis point (N, m).
        width_arc: Arc lengths of width measurements (K, m).
        width: Diameter there (K, m).
        nodes: By arc length.
        hidden: Stretches that are occluded, or have no measured depth.
        ends: Why it ends at its first and at its last point.
    """

    axis: Array
    arc: Array
    width_arc: Array
    width: Array
    nodes: tuple[Node, ...]
    hidden: tuple[Span, ...]
    ends: tuple[CaneEnd, CaneEnd]


def centrelines(view: View, pixels: CanePixels, chains: list[Array], config: SkeletonConfig) -> list[Centreline]:
    """Measure each chain.

    Args:
        view: The frame.
        pixels: Its cane pixels.
        chains: Polylines along the canes, each M×3 in odom (m).
        config: Sampling and smoothing.
    """
    lines = [line for line in (_resample(chain, config.sample_spacing) for chain in chains) if line is not None]
    if not lines:
        return []
    samples = np.concatenate(lines)
    distance, nearest = cKDTree(samples).query(pixels.points, workers=1, distance_upper_bound=_MAX_DISTANCE)
    near = np.nonzero(np.isfinite(distance))[0]
    near = near[np.argsort(nearest[near], kind="stable")]
    first = np.concatenate([[0], np.cumsum([len(line) for line in lines])])
    bounds = np.searchsorted(nearest[near], first)
    stations = [_arc(line) for line in lines]
    along = _project(samples, np.concatenate(stations), first, pixels.points[near], nearest[near])
    u, v, _ = view.pixels(samples).T
    cane = pixels.mask()
    out = []
    for k, line in enumerate(lines):
        own, part = slice(bounds[k], bounds[k + 1]), slice(first[k], first[k + 1])
        chain = _Chain(line, stations[k], u[part], v[part], near[own], along[own])
        measured = _measure(view, pixels, cane, chain, config)
        if measured is not None:
            out.append(measured)
    return out


@dataclass(frozen=True)
class _Chain:
    """A resampled chain with its pixels.

    Attributes:
        line: Samples, N×3 in odom (m).
        stations: Arc length of each sample (N, m).
        u: Column of each sample (N, px).
        v: Row of each sample (N, px).
        members: Indices of its pixels (M).
        along: Arc length of each pixel (M, m).
    """

    line: Array
    stations: Array
    u: Array
    v: Array
    members: Index
    along: Array


def _measure(view: View, pixels: CanePixels, cane: Mask, chain: _Chain, config: SkeletonConfig) -> Centreline | None:
    stations, members, along = chain.stations, chain.members, chain.along
    if len(members) < _MIN_PIXELS:
        return None
    width_arc, width = _widths(view, pixels, chain, config.width_bias)
    radius = _radius(float(np.median(width))) if len(width) else _FALLBACK_RADIUS
    axis = _smooth(stations, along, pixels.points[members], config.smoothing_sigma)
    # Scattered pixels give no line.
    if not np.isfinite(axis).all() or np.linalg.norm(np.diff(axis, axis=0), axis=1).min() < _MIN_STEP:
        return None
    axis = _to_axis(view, axis, radius)
    return Centreline(
        axis=axis,
        arc=stations,
        width_arc=width_arc,
        width=width,
        nodes=_nodes(pixels, members, along, config),
        hidden=_hidden(along[pixels.measured[members]], float(stations[-1])),
        ends=_ends(view, cane, axis),
    )


def _radius(diameter: float) -> float:
    return float(np.clip(diameter / 2, _MIN_RADIUS, _MAX_RADIUS))


def _arc(line: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def _resample(chain: Array, step: float) -> Array | None:
    """The chain sampled evenly, after a moving average: depth noise would make the arc length too long."""
    if len(chain) < 3:
        return None
    kernel = np.ones(5) / 5
    padded = np.concatenate([2 * chain[:1] - chain[2:0:-1], chain, 2 * chain[-1:] - chain[-2:-4:-1]])
    if len(padded) < len(chain) + 4:
        return None
    smooth = np.stack([np.convolve(padded[:, i], kernel, mode="valid") for i in range(3)], axis=1)
    arc = _arc(smooth)
    if arc[-1] < 2 * step:
        return None
    stations = np.linspace(0.0, arc[-1], max(3, round(arc[-1] / step) + 1))
    return interpolate(stations, arc, smooth)


def _project(samples: Array, stations: Array, first: Index, points: Array, k: Index) -> Array:
    """Arc length of each point projected on its line near sample `k`; the ends are extended straight.

    `samples` has the samples of all lines one after the other; those of a line begin at its `first`.
    """
    before, after = np.arange(len(samples)) - 1, np.arange(len(samples)) + 1
    before[first[:-1]], after[first[1:] - 1] = first[:-1], first[1:] - 1
    chord = samples[after] - samples[before]
    chord /= np.linalg.norm(chord, axis=1, keepdims=True)
    out: Array = stations[k] + np.einsum("ij,ij->i", points - samples[k], chord[k])
    return out


def _smooth(stations: Array, along: Array, points: Array, sigma: float) -> Array:
    """Local linear regression of the surface points over arc length, at each station; NaN where there is none.

    Points are averaged in bins first, so that the cost does not grow with their number.
    """
    step = sigma / 3
    bins = np.clip(((along + step) / step).astype(int), 0, int(stations[-1] / step) + 2)
    count = np.bincount(bins).astype(float)
    used = count > 0
    s = np.bincount(bins, along)[used] / count[used]
    p = np.stack([np.bincount(bins, points[:, i])[used] / count[used] for i in range(3)], axis=1)
    u = s[None] - stations[:, None]
    w = np.exp(-0.5 * (u / sigma) ** 2) * count[used][None]
    # A wide kernel of low weight bridges hidden stretches.
    w += np.exp(-0.5 * (u / (5 * sigma)) ** 2) * 1e-3
    s0, s1, s2 = w.sum(1), (w * u).sum(1), (w * u**2).sum(1)
    spread = s0 * s2 - s1**2
    # Points that all lie at one place along the line have no direction.
    spread[spread <= _LEAST_SPREAD * s0 * s2] = np.nan
    weights = w * (s2[:, None] - s1[:, None] * u) / spread[:, None]
    out: Array = weights @ p
    return out


def _to_axis(view: View, surface: Array, radius: float) -> Array:
    """Move the mean of the visible surface to the axis, away from the camera and square to the cane."""
    direction = np.gradient(surface, axis=0)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    ray = surface - view.t
    square = ray - np.einsum("ij,ij->i", ray, direction)[:, None] * direction
    out: Array = surface + SURFACE_OFFSET * radius * square / np.linalg.norm(square, axis=1, keepdims=True)
    return out


def base_radius(line: Centreline, reverse: bool) -> float:
    """Radius of a cane near its base, as a robust mean over a long stretch.

    Discretisation makes the width of an upright cane err by up to half a pixel over a decimetre. Outliers come from
    occlusion and from wood beside the cane.

    Args:
        line: The cane.
        reverse: Whether the base is at its last point.
    """
    s, width = line.width_arc, line.width
    s = float(line.arc[-1]) - s if reverse else s
    near = s < max(_RADIUS_STRETCH, float(s.min(initial=np.inf)) + 0.05)
    if not near.any():
        return _FALLBACK_RADIUS
    # The taper cannot be measured over so short a stretch.
    base = width[near] / (1.0 - _TAPER * (s[near] - _RADIUS_AT))
    middle = float(np.median(base))
    good = np.abs(base - middle) < max(_WIDTH_NOISE, 0.2 * middle)
    width_at_base = float(np.mean(base[good])) if good.any() else middle
    return _radius(width_at_base)


def _widths(view: View, pixels: CanePixels, chain: _Chain, bias: float) -> tuple[Array, Array]:
    """Arc lengths and widths (m) of stretches without nodes: pixels per length in the image, scaled by depth."""
    line, stations, along = chain.line, chain.stations, chain.along
    pixel_arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(chain.u), np.diff(chain.v)))])
    edges = np.arange(0.0, float(stations[-1]) + 1e-9, _WIDTH_STEP)
    bins = np.floor(along / _WIDTH_STEP).astype(int)
    inside = (bins >= 0) & (bins < len(edges) - 1)
    bins, members, size = bins[inside], chain.members[inside], max(0, len(edges) - 1)
    count = np.bincount(bins, minlength=size)
    node = np.bincount(bins, pixels.node[members], minlength=size)
    depth = np.bincount(bins, pixels.depth[members], minlength=size) / np.maximum(count, 1)
    length = np.diff(np.interp(edges, stations, pixel_arc))
    focal = float(np.sqrt(view.intrinsics.fx * view.intrinsics.fy))
    used = (count > 0) & (node == 0) & (length > 1.0)
    s = (edges[:-1] + _WIDTH_STEP / 2)[used]
    pixels_wide = np.maximum(count[used] / length[used] - bias, 0.5)
    return s, pixels_wide * depth[used] / focal * _foreshortening(view, line, stations, s)


def _foreshortening(view: View, line: Array, stations: Array, arc: Array) -> Array:
    """True width over width in the image plane at some arc lengths: perspective stretches the image off its centre."""
    point, beyond, before = interpolate(np.concatenate([arc, arc + 0.01, arc - 0.01]), stations, line).reshape(3, -1, 3)
    ray = (point - view.t) @ view.R
    along = (beyond - before) @ view.R
    # Directions in the image plane: along the cane and across it.
    image = along[:, :2] * ray[:, 2:] - ray[:, :2] * along[:, 2:]
    across = np.stack([-image[:, 1], image[:, 0]], axis=1) / np.linalg.norm(image, axis=1, keepdims=True)
    (a, b, c), (x, y, z) = along.T, ray.T
    square = np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=1)
    square /= np.linalg.norm(square, axis=1, keepdims=True)
    out: Array = np.abs(np.einsum("ij,ij->i", across, square[:, :2]))
    return out


def _nodes(pixels: CanePixels, members: Index, along: Array, config: SkeletonConfig) -> tuple[Node, ...]:
    """Runs of node pixels along the cane."""
    node = np.sort(along[pixels.node[members]])
    if not len(node):
        return ()
    runs = np.split(node, np.nonzero(np.diff(node) > _MIN_HIDDEN)[0] + 1)
    return tuple(Node(float((run[0] + run[-1]) / 2), len(run)) for run in runs if len(run) >= config.min_node_pixels)


def _hidden(along: Array, length: float) -> tuple[Span, ...]:
    """Stretches without a pixel of measured depth: where depth is interpolated, a node may be missed as well."""
    seen = np.sort(np.concatenate([[0.0], along[(along > 0.0) & (along < length)], [length]]))
    gaps = np.nonzero(np.diff(seen) > _MIN_HIDDEN)[0]
    return tuple(Span(float(seen[g]), float(seen[g + 1])) for g in gaps)


def _ends(view: View, cane: Mask, axis: Array) -> tuple[CaneEnd, CaneEnd]:
    """Why a cane ends at its first and at its last point."""
    tips = axis[[0, -1]]
    outward = tips - axis[[1, -2]]
    length = np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    first, last = view.pixels(tips + outward / length * _PROBE)
    return _end(view, cane, *first.tolist()), _end(view, cane, *last.tolist())


def _end(view: View, cane: Mask, u: float, v: float, z: float) -> CaneEnd:
    """Why a cane is not visible at a pixel and depth just beyond its end."""
    height, width = view.depth.shape
    col, row = round(u), round(v)
    if not (3 <= col < width - 3 and 3 <= row < height - 3 and z > 0.0):
        return "image border"
    patch = view.depth[row - 1 : row + 2, col - 1 : col + 2]
    nearer = (patch > 0.0) & (patch < z - _OCCLUDER)
    joined = cane[row, col] and abs(float(view.depth[row, col]) - z) < _JOINED
    return "hidden" if nearer.any() or joined else "free"
