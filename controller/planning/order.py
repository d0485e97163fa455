"""The order of the cuts: the one with the least time of the motions between them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from controller.config import ControllerConfig
from controller.motion.tool_motion import ToolMotion
from controller.work.cutting import ApproachSegments
from controller.work.posture_search import CutPlan
from rolling_panda.model.differential_drive import Array

#: The optimisation of the order ends when a round saves less than this (s).
_WORTH = 1e-6


def travel_times(config: ControllerConfig, flows: bool, start: tuple[Any, Array], cuts: Sequence[CutPlan]) -> Array:
    """Times (n+1 × n, s) of the tool motions from the start (row 0) and from each cut to each cut.

    They are the motions that the cut sequence drives, from clear of the canes to clear of the canes, at full speed.

    Args:
        config: Section `[controller]`.
        flows: Whether the whole-body method blends the segments of a motion.
        start: T_odom_tool (pin.SE3) and configuration (12) at the start.
        cuts: The cuts.
    """
    segments = ApproachSegments(config.work, flows)
    places = [start, *((cut.poses.clear, cut.q_clear) for cut in cuts)]
    return np.array(
        [
            [
                ToolMotion(
                    config.motion, config.whole_body, pose, q, segments.there(cut, pose, q), flows=flows
                ).duration
                for cut in cuts
            ]
            for pose, q in places
        ]
    )


def shortest(costs: Array) -> list[int]:
    """An order of n stops of little cost: nearest first, then turned round and moved about while that saves time.

    Args:
        costs: (n+1 × n) from the start (row 0) and from each stop to each; need not be symmetric.
    """
    n = costs.shape[1]
    order: list[int] = []
    at, left = 0, set(range(n))
    while left:
        nearest = min(left, key=lambda stop: (float(costs[at, stop]), stop))
        order.append(nearest)
        left.remove(nearest)
        at = nearest + 1
    best = length(costs, order)
    improved = True
    while improved:
        improved = False
        for candidate in _neighbours(order):
            cost = length(costs, candidate)
            if cost < best - _WORTH:
                order, best, improved = candidate, cost, True
                break
    return order


def length(costs: Array, order: Sequence[int]) -> float:
    """Cost of an order, from the start to its last stop."""
    total, at = 0.0, 0
    for stop in order:
        total += float(costs[at, stop])
        at = stop + 1
    return total


def _neighbours(order: list[int]) -> list[list[int]]:
    """Orders with one stretch turned round, or one stop moved elsewhere."""
    n = len(order)
    turned = [order[:i] + order[i:j][::-1] + order[j:] for i in range(n) for j in range(i + 2, n + 1)]
    moved = []
    for i in range(n):
        rest = order[:i] + order[i + 1 :]
        moved += [[*rest[:j], order[i], *rest[j:]] for j in range(n) if j != i]
    return turned + moved
