"""Order, duration and feasibility of the targets, before the robot moves.

Pure: targets in, a schedule out. The feasibility of each target is checked separately. The order minimises the travel
time of base and arm from the robot's current configuration. Every motion between the targets is planned and checked.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from controller.motion.speed_limits import PlanLimits
from controller.motion.trajectory import quickest
from controller.planning.base_path import BasePlanner
from controller.planning.path import PathPlanner, Planned, Stand
from controller.whole_body.collision import Clearance
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q

#: The optimisation of the order ends when a round saves less than this (s).
_WORTH = 1e-6


@dataclass(frozen=True)
class Target:
    """A target configuration, for instance clear of the canes before a cut.

    Attributes:
        name: Id of the point.
        stand: The configuration.
        hold_s: Time at the target (s): approach, cut and retreat.
    """

    name: str
    stand: Stand
    hold_s: float = 0.0


@dataclass(frozen=True)
class Requirements:
    """Requirements for a feasible target.

    Attributes:
        clearance: Smallest distance along the motion (m).
        omega: Smallest manipulability of the arm at the target.
        margin: Smallest distance to a joint limit at the target (rad).
        duration: Longest travel time (s).
    """

    clearance: float = 0.015
    omega: float = 0.012
    margin: float = 0.05
    duration: float = 60.0


@dataclass(frozen=True)
class Stop:
    """A target of the schedule with the motion to it.

    Attributes:
        name: Name of the target.
        planned: Motion from the previous stop.
        begins: Start of the motion (s from the start of the work).
        arrives: End of the motion (s from the start of the work).
    """

    name: str
    planned: Planned
    begins: float
    arrives: float

    @property
    def clearance(self) -> Clearance:
        """Smallest distance along the motion with its two parts."""
        return self.planned.clearance

    @property
    def omega(self) -> float:
        """Manipulability of the arm at the target."""
        return self.planned.stand.omega


@dataclass(frozen=True)
class Schedule:
    """Stops in the order of work, total duration (s), and the refused targets with their reasons."""

    stops: tuple[Stop, ...]
    duration: float
    refused: dict[str, str] = field(default_factory=dict)


class Scheduler:
    """Orders targets and checks their feasibility."""

    def __init__(
        self, planner: PathPlanner, base: BasePlanner, limits: PlanLimits, tool_speed: float = math.inf
    ) -> None:
        """Bind the planner.

        Args:
            planner: Of motions.
            base: For the time of drives.
            limits: For the time of arm motions.
            tool_speed: Limit of the tool where motions will be followed by it (m/s).
        """
        self._planner, self._base, self._limits, self._tool_speed = planner, base, limits, tool_speed

    def plan(
        self, q: Array, targets: Sequence[Target], required: Requirements | None = None, wanted: Sequence[str] = ()
    ) -> Schedule:
        """Schedule of all feasible targets, from rest at a configuration (12).

        Args:
            q: Configuration (12) at the start.
            targets: In any order; names must differ.
            required: Requirements for each target.
            wanted: Names in the order set by a person; other targets come last. Without it the order
                is the fastest one found.
        """
        required = required or Requirements()
        refused: dict[str, str] = {}
        targets_by_name: dict[str, Target] = {}
        for target in targets:
            if target.name in targets_by_name:
                refused[target.name] = "two targets have this name; each needs its own"
            elif why := self._lacking_stand(target.stand, required):
                refused[target.name] = why
            targets_by_name[target.name] = target
        stands = [target for name, target in targets_by_name.items() if name not in refused]
        if wanted:
            places = {name: place for place, name in enumerate(wanted)}
            order = sorted(range(len(stands)), key=lambda i: places.get(stands[i].name, len(places)))
        else:
            order = shortest(self._costs(q, [target.stand for target in stands]))
        return self._schedule(q, [stands[i] for i in order], required, refused)

    def _schedule(self, q: Array, order: Sequence[Target], required: Requirements, refused: dict[str, str]) -> Schedule:
        """The motions in this order; a target that cannot be reached is left out and said."""
        stops: list[Stop] = []
        now, at = 0.0, q
        waiting = list(order)
        # A target that is not reachable from its neighbour may be reachable from the end of the schedule.
        for _ in range(2):
            begun, missed = len(stops), []
            for target in waiting:
                planned = self._planner.to_stand(at, target.stand)
                why = self._unmet_requirement(planned, required) if isinstance(planned, Planned) else planned.reason
                if why or not isinstance(planned, Planned):
                    refused[target.name] = why
                    missed.append(target)
                    continue
                refused.pop(target.name, None)
                arrives = now + planned.plan.duration
                stops.append(Stop(target.name, planned, now, arrives))
                now, at = arrives + target.hold_s, planned.plan.q[-1]
            waiting = missed if len(stops) > begun else []
        return Schedule(tuple(stops), now, refused)

    def _costs(self, q: Array, stands: Sequence[Stand]) -> Array:
        """Travel times (n+1 × n, s) from the start (row 0) and from each stand to each stand."""
        places = [q, *(stand.q for stand in stands)]
        goals = np.array([stand.q[:3] for stand in stands]).reshape(-1, 3)
        tools = [self._planner.tool(place) for place in places]
        costs = np.zeros((len(places), len(stands)))
        for i, place in enumerate(places):
            if not stands:
                break
            arm = [quickest(1.0, self._limits.arm_rates(stand.q[ARM_Q] - place[ARM_Q])).duration for stand in stands]
            costs[i] = np.maximum(self._base.duration(place[:3], goals), arm)
            # The mean speed of a motion is about half its largest.
            away = [np.linalg.norm(tools[i] - tool) for tool in tools[1:]]
            costs[i] = np.maximum(costs[i], 2.0 * np.array(away) / self._tool_speed)
        return costs

    def _unmet_requirement(self, planned: Planned, required: Requirements) -> str:
        """The requirement that a motion does not meet, as text; empty if it meets all."""
        stand, least = planned.stand, planned.clearance
        if least.distance < required.clearance:
            return (
                f"on the way {least.pair[0]} comes within {1e3 * least.distance:.0f} mm of {least.pair[1]}; "
                f"{1e3 * required.clearance:.0f} mm are required"
            )
        if why := self._lacking_stand(stand, required):
            return why
        if planned.plan.duration > required.duration:
            return f"the way takes {planned.plan.duration:.0f} s; at most {required.duration:.0f} s are allowed"
        return ""

    def _lacking_stand(self, stand: Stand, required: Requirements) -> str:
        if stand.omega < required.omega:
            return f"the arm's manipulability there is {stand.omega:.3f}; at least {required.omega:.3f} is required"
        if stand.margin < required.margin:
            return f"a joint would be {stand.margin:.2f} rad from its limit; {required.margin:.2f} rad are required"
        return ""


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
