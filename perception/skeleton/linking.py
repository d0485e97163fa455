"""From fragments to chains: joins the fragments of one cane across forks and occlusions.

Two ends are joined where one continues the other nearly straight over a short, occluded gap. A gap that shows the
background is the end of the wood.
"""

from dataclasses import dataclass

import numpy as np

from perception.arrays import Array, Mask
from perception.config import SkeletonConfig
from perception.segmentation.frame import View
from perception.skeleton.fragments import Fragment

#: Shorter fragments have no reliable direction (px).
_MIN_PIXELS = 10
#: Points at the end of a fragment from which its direction is fitted.
_TAIL = 6
#: Largest overlap of two ends along their direction (m).
_MAX_OVERLAP = 0.012
#: Share of the samples of a gap that must be occluded.
_MIN_OCCLUDED = 0.85


@dataclass(frozen=True)
class _End:
    fragment: int
    point: Array
    outward: Array


def link_fragments(view: View, fragments: list[Fragment], cane: Mask, config: SkeletonConfig) -> list[Array]:
    """Chains of fragments: polylines along canes, each M×3 in odom (m).

    Args:
        view: The frame.
        fragments: Fragments; short ones are ignored.
        cane: Cane pixels, H×W.
        config: Largest gap and bend.
    """
    long = [fragment for fragment in fragments if fragment.pixels >= _MIN_PIXELS and len(fragment.line) >= 2]
    ends = _ends(long)
    partner = _match(view, ends, cane, config)
    chains, used = [], set()
    for start in range(len(long)):
        if start in used:
            continue
        # Go back to one end of the chain; a closed loop is opened at its start.
        at, visited = 2 * start, {start}
        while partner[at] >= 0 and partner[at] // 2 not in visited:
            at = partner[at] ^ 1
            visited.add(at // 2)
        pieces = []
        while at // 2 not in used:
            used.add(at // 2)
            line = long[at // 2].line
            pieces.append(line if at % 2 == 0 else line[::-1])
            following = partner[at ^ 1]
            if following < 0:
                break
            at = following
        chains.append(np.concatenate(pieces))
    return chains


def _ends(fragments: list[Fragment]) -> list[_End]:
    """Both ends of each fragment, in order; tails of equal length are fitted together."""
    tails = [tail for each in fragments for tail in (each.line[:_TAIL][::-1], each.line[-_TAIL:])]
    sizes = np.array([len(tail) for tail in tails], dtype=int)
    points, outward = np.zeros((len(tails), 3)), np.zeros((len(tails), 3))
    for size in np.unique(sizes):
        those = np.flatnonzero(sizes == size)
        tail = np.array([tails[k] for k in those])
        centre = tail.mean(axis=1)
        axis = np.linalg.svd(tail - centre[:, None], full_matrices=False)[2][:, 0]
        forwards = np.einsum("ij,ij->i", axis, tail[:, -1] - tail[:, 0]) > 0.0
        axis = np.where(forwards[:, None], axis, -axis)
        outward[those] = axis
        points[those] = centre + axis * np.einsum("ij,ij->i", tail[:, -1] - centre, axis)[:, None]
    return [_End(k // 2, points[k], outward[k]) for k in range(len(tails))]


def _match(view: View, ends: list[_End], cane: Mask, config: SkeletonConfig) -> list[int]:
    """For each end the end it is joined to, or -1: greedy, the lowest cost first."""
    partner = [-1] * len(ends)
    if not ends:
        return partner
    points = np.array([end.point for end in ends])
    outward = np.array([end.outward for end in ends])
    owner = np.array([end.fragment for end in ends])
    gap = points[None] - points[:, None]
    distance = np.linalg.norm(gap, axis=2)
    ahead = np.einsum("ijk,ik->ij", gap, outward)
    # Lateral distance of j from the continuation of i.
    lateral = np.sqrt(np.maximum(distance**2 - ahead**2, 0.0))
    facing = -outward @ outward.T
    allowed = config.max_lateral_offset + 0.15 * distance
    good = (
        (owner[:, None] != owner[None])
        & (distance < config.max_gap)
        & (ahead > -_MAX_OVERLAP)
        & (ahead.T > -_MAX_OVERLAP)
        & (lateral < allowed)
        & (lateral.T < allowed)
        & (facing > np.cos(config.max_bend))
    )
    cost = (lateral + lateral.T) / allowed + (1.0 - facing) * 10.0 + distance / config.max_gap
    for i, j in sorted(zip(*np.nonzero(np.triu(good)), strict=True), key=lambda pair: (float(cost[pair]), pair)):
        if partner[i] < 0 and partner[j] < 0 and _occluded(view, points[i], points[j], cane):
            partner[i], partner[j] = int(j), int(i)
    return partner


def _occluded(view: View, start: Array, end: Array, cane: Mask) -> bool:
    """Whether the line between two points is hidden by something nearer, or on cane."""
    fractions = np.linspace(0.0, 1.0, max(3, int(np.linalg.norm(end - start) / 0.002)))
    line = start + fractions[:, None] * (end - start)
    u, v, z = view.pixels(line).T
    height, width = cane.shape
    cols, rows = np.rint(u).astype(int), np.rint(v).astype(int)
    inside = (cols >= 1) & (cols < width - 1) & (rows >= 1) & (rows < height - 1) & (z > 0)
    if not inside.all():
        return False
    occluded = np.zeros(len(z), dtype=bool)
    for dr, dc in ((0, 0), (0, 1), (0, -1), (1, 0), (-1, 0)):
        depth = view.depth[rows + dr, cols + dc]
        occluded |= cane[rows + dr, cols + dc] | ((depth > 0.0) & (depth < z + 0.01))
    return bool(occluded.mean() > _MIN_OCCLUDED)
