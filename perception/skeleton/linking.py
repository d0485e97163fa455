"""Fragments to chains: joins the pieces of one cane across forks, wires and canes in front of it.

Two ends are joined where one continues the other: nearly straight on in space, over a short gap, with something in
front of the gap. A gap that shows the background is no gap in the view but the end of the wood.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.config import SkeletonConfig
from perception.plant.model import Array
from perception.segmentation.frame import View
from perception.skeleton.fragments import Fragment

#: A fragment shorter than this many pixels has no direction of its own and starts no chain.
_SHORT = 10
#: Points at the end of a fragment that give its direction.
_TAIL = 6


@dataclass(frozen=True)
class _End:
    fragment: int
    last: bool
    point: Array
    outward: Array


def link(view: View, fragments: list[Fragment], seen: NDArray[np.bool_], config: SkeletonConfig) -> list[Array]:
    """Rough centre lines of canes, M×3 in odom (m), as chains of fragments.

    Args:
        view: The frame.
        fragments: Stretches without forks; those too short to have a direction are left out.
        seen: H×W, where cane is seen.
        config: How far and how straight to join.
    """
    long = [fragment for fragment in fragments if fragment.pixels >= _SHORT and len(fragment.line) >= 2]
    ends = _ends(long)
    partner = _match(view, ends, seen, config)
    chains, used = [], set()
    for start in range(len(long)):
        if start in used:
            continue
        # Walk back to one end of the chain first; a closed loop is opened where the walk began.
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
    """Both ends of each fragment, in order. Tails of the same length are worked on together."""
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
    return [_End(k // 2, k % 2 == 1, points[k], outward[k]) for k in range(len(tails))]


def _match(view: View, ends: list[_End], seen: NDArray[np.bool_], config: SkeletonConfig) -> list[int]:
    """For each end the end it is joined to, or -1: the best continuations first."""
    partner = [-1] * len(ends)
    if not ends:
        return partner
    points = np.array([end.point for end in ends])
    outward = np.array([end.outward for end in ends])
    owner = np.array([end.fragment for end in ends])
    gap = points[None] - points[:, None]
    distance = np.linalg.norm(gap, axis=2)
    ahead = np.einsum("ijk,ik->ij", gap, outward)
    # How far the continuation of i passes by j, and the other way round.
    miss = np.sqrt(np.maximum(distance**2 - ahead**2, 0.0))
    facing = -outward @ outward.T
    allowed = config.miss + 0.15 * distance
    good = (
        (owner[:, None] != owner[None])
        & (distance < config.bridge)
        & (ahead > -0.012)
        & (ahead.T > -0.012)
        & (miss < allowed)
        & (miss.T < allowed)
        & (facing > np.cos(config.bend))
    )
    cost = (miss + miss.T) / allowed + (1.0 - facing) * 10.0 + distance / config.bridge
    for i, j in sorted(zip(*np.nonzero(np.triu(good)), strict=True), key=lambda pair: (float(cost[pair]), pair)):
        if partner[i] < 0 and partner[j] < 0 and _covered(view, points[i], points[j], seen):
            partner[i], partner[j] = int(j), int(i)
    return partner


def _covered(view: View, start: Array, end: Array, seen: NDArray[np.bool_]) -> bool:
    """Whether nothing between two points shows what lies behind them."""
    fractions = np.linspace(0.0, 1.0, max(3, int(np.linalg.norm(end - start) / 0.002)))
    line = start + fractions[:, None] * (end - start)
    u, v, z = view.pixels(line).T
    height, width = seen.shape
    cols, rows = np.rint(u).astype(int), np.rint(v).astype(int)
    inside = (cols >= 1) & (cols < width - 1) & (rows >= 1) & (rows < height - 1) & (z > 0)
    if not inside.all():
        return False
    covered = np.zeros(len(z), dtype=bool)
    for dr, dc in ((0, 0), (0, 1), (0, -1), (1, 0), (-1, 0)):
        depth = view.depth[rows + dr, cols + dc]
        covered |= seen[rows + dr, cols + dc] | ((depth > 0.0) & (depth < z + 0.01))
    return bool(covered.mean() > 0.85)
