"""Planner of the accepted cuts: a collision-free posture for each, the fastest order, and the rollout of the work."""

import hashlib
import math
from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np

from controller.config import ControllerConfig
from controller.motion.tool_motion import ToolMotion
from controller.planning.preview_plan import Preview, PreviewRequest
from controller.planning.rollout import Rollout
from controller.planning.work_plan import PlannedCut, PlanRequest, WorkPlan
from controller.whole_body.registry import make_method
from controller.work.cutting import ApproachSegments
from controller.work.posture_search import CutClearance, CutPlan, PostureSearch, completed
from rolling_panda.config import RobotConfig
from rolling_panda.errors import ControlError
from rolling_panda.messages.perception import Obstacles
from rolling_panda.messages.types import Header, Reason
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import RobotModel
from rolling_panda.transport.inbox import Received

#: Number of cuts that are rolled out; later ones when the work comes near them.
AHEAD = 10


class CutPlanner:
    """Answers plan requests. Equal requests have equal answers, from any instance.

    A point is refused for want of a posture, for want of clearance there, or because the work that is rolled out does
    not cut it.
    """

    def __init__(self, config: ControllerConfig, robot_config: RobotConfig) -> None:
        """Build the models (about half a second)."""
        self._config, self._robot_config = config, robot_config
        self._robot = RobotModel(robot_config)
        self._flows = make_method(self._robot, config.whole_body, 1.0 / config.rate_hz).flows
        self._clearance = CutClearance(RobotModel(robot_config), config.whole_body.hierarchy)
        self._search = PostureSearch(
            RobotModel(robot_config),
            config.work,
            config.whole_body.joint_margin,
            self._clearance,
        )
        self._rollout = Rollout(config, robot_config)

    def plan(self, request: PlanRequest) -> WorkPlan:
        """The work on the points of a request; takes a few tenths of a second a point.

        Raises:
            ControlError: The request's configuration is not finite.
        """
        if not np.isfinite(request.q).all():
            raise ControlError(f"a plan from {request.q.tolist()} was asked for; every coordinate must be finite")
        cuts, refused = self._postures(request)
        order = self._order(request, cuts)
        rolled = self._roll(request, cuts, order)
        while rolled.refused:
            # Without the first refused point the later motions begin elsewhere. Where none of them led to a cut, the
            # points are refused together; the next plan tries them again.
            first = next(iter(rolled.refused))
            cut_after = any(cut.cut_s is not None for cut in rolled.cuts[order.index(first) :])
            refused |= {first: rolled.refused[first]} if cut_after else rolled.refused
            order = [name for name in order if name not in refused]
            rolled = self._roll(request, cuts, order)
        points = {point.point_id: point for point in request.points}
        figures = {cut.point_id: cut for cut in rolled.cuts}
        planned = tuple(PlannedCut(points[name], cuts[name], figures.get(name)) for name in order)
        later = len(order) - len(figures)
        duration = rolled.duration * (1.0 + later / len(figures)) if figures else 0.0
        track = np.array([(row.base.x, row.base.y) for row in rolled.rows]).reshape(-1, 2)
        return WorkPlan(
            request, planned, refused, track, duration, self._digest(request, planned, refused, rolled.digest)
        )

    def _postures(self, request: PlanRequest) -> tuple[dict[str, CutPlan], dict[str, Reason]]:
        """A posture for each cut, and the reason where there is none."""
        self._clearance.update(Received(Obstacles(header=Header(), capsules=request.obstacles), 0.0), request.canes)
        turned, tries = dict(request.turned), dict(request.tries)
        cuts: dict[str, CutPlan] = {}
        refused: dict[str, Reason] = {}
        for point in request.points:
            name = point.point_id
            found = completed(self._search.find(point, request.q, turned.get(name), tries.get(name, ())))
            if isinstance(found, CutPlan):
                cuts[name] = found
            else:
                refused[name] = found.reason
        return cuts, refused

    def _order(self, request: PlanRequest, cuts: dict[str, CutPlan]) -> list[str]:
        """The order of work: as people want it, points that they do not name last, else the fastest one found.

        Cuts with a failed try come after the others, unless people want them elsewhere.
        """
        names = list(cuts)
        if request.order:
            places = {name: place for place, name in enumerate(request.order)}
            return sorted(names, key=lambda name: places.get(name, len(places)))
        start = self._robot.pose(request.q, self._robot.tool_id).copy(), request.q
        stops = list(cuts.values())
        times = travel_times(self._config, self._flows, start, stops)
        fastest = [names[i] for i in shortest(times, leaving_times(self._config, request.q, stops))]
        tried = dict(request.tries)
        return sorted(self._freed(request, cuts, fastest), key=lambda name: name in tried)

    def _freed(self, request: PlanRequest, cuts: dict[str, CutPlan], order: list[str]) -> list[str]:
        """The order with a stub before the cut on the same spur whose open blades would push a cane, if there is one.

        The canes that go with the stub often are the ones that would be pushed.
        """
        points = {point.point_id: point for point in request.points}
        stubs = {
            (point.vine, point.spur): point.point_id
            for point in request.points
            if point.kind == "renewal cut" and point.point_id in cuts
        }
        for name in order.copy():
            point = points[name]
            stub = stubs.get((point.vine, point.spur), name)
            tight = stub != name and self._clearance.beside(cuts[name].poses, point) < 0.0
            if tight and order.index(stub) > order.index(name):
                order.remove(stub)
                order.insert(order.index(name), stub)
        return order

    def _roll(self, request: PlanRequest, cuts: dict[str, CutPlan], order: Sequence[str]) -> Preview:
        """Rollout of the first cuts of an order."""
        points = {point.point_id: point for point in request.points}
        return self._rollout.roll(
            PreviewRequest(
                request.number,
                request.q,
                tuple(points[name] for name in order[:AHEAD]),
                request.obstacles,
                cuts,
                request.close_up_s,
                request.turned,
                request.tries,
                request.canes,
            )
        )

    def _digest(self, request: PlanRequest, cuts: Sequence[PlannedCut], refused: dict[str, Reason], rolled: str) -> str:
        encode = msgspec.msgpack.Encoder(order="deterministic").encode
        out = hashlib.sha256()
        for part in (
            self._config,
            self._robot_config,
            request.points,
            request.obstacles,
            request.canes,
            request.order,
            request.turned,
            request.tries,
            request.close_up_s,
            refused,
            rolled,
        ):
            out.update(encode(part))
        out.update(np.ascontiguousarray(request.q, dtype="<f8").tobytes())
        for cut in cuts:
            out.update(cut.point.point_id.encode())
            for q in (cut.cut.q_clear, cut.cut.q_stand_off, cut.cut.q_cut):
                out.update(np.ascontiguousarray(q, dtype="<f8").tobytes())
        return out.hexdigest()


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


def leaving_times(config: ControllerConfig, q: Array, cuts: Sequence[CutPlan]) -> Array:
    """Times (n, s) to drive on from each cut to where the base has come farthest along the row: work goes on there.

    Args:
        config: Section `[controller]`.
        q: Configuration (12) at the start.
        cuts: The cuts.
    """
    heading = config.work.row_heading
    along = np.array([q[:2], *(cut.q_cut[:2] for cut in cuts)]) @ [math.cos(heading), math.sin(heading)]
    out: Array = (along.max() - along[1:]) / config.whole_body.base_speed
    return out


def shortest(costs: Array, ends: Array | None = None) -> list[int]:
    """An order of n stops of little cost: nearest first, then turned round and moved about while that saves time.

    Args:
        costs: (n+1 × n) from the start (row 0) and from each stop to each; need not be symmetric.
        ends: (n) of ending at each stop; None for nothing.
    """
    n = costs.shape[1]
    order: list[int] = []
    at, left = 0, set(range(n))
    while left:
        nearest = min(left, key=lambda stop: (float(costs[at, stop]), stop))
        order.append(nearest)
        left.remove(nearest)
        at = nearest + 1
    best = length(costs, order, ends)
    improved = True
    while improved:
        improved = False
        for candidate in _neighbours(order):
            cost = length(costs, candidate, ends)
            if cost < best - _WORTH:
                order, best, improved = candidate, cost, True
                break
    return order


def length(costs: Array, order: Sequence[int], ends: Array | None = None) -> float:
    """Cost of an order, from the start to its last stop, and of ending there."""
    total, at = 0.0, 0
    for stop in order:
        total += float(costs[at, stop])
        at = stop + 1
    return total + (float(ends[order[-1]]) if ends is not None and len(order) else 0.0)


def _neighbours(order: list[int]) -> list[list[int]]:
    """Orders with one stretch turned round, or one stop moved elsewhere."""
    n = len(order)
    turned = [order[:i] + order[i:j][::-1] + order[j:] for i in range(n) for j in range(i + 2, n + 1)]
    moved = []
    for i in range(n):
        rest = order[:i] + order[i + 1 :]
        moved += [[*rest[:j], order[i], *rest[j:]] for j in range(n) if j != i]
    return turned + moved
