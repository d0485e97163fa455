"""Collision-free arm paths: straight, through a tucked posture, or by RRT-Connect.

The search is RRT-Connect (Kuffner and LaValle, 2000): two trees of postures, one from each end, grow towards random
postures and towards each other. The path is then shortened by cutting corners. The random seed is fixed: equal requests
have equal results.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.control.plan_limits import PlanLimits
from controller.whole_body.collision import CollisionModel, Pair
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.robot import ARM_Q

#: Largest joint step (rad) between two collision checks.
_LOOK = 0.02
#: Largest joint step of the trees (rad), largest number of their extensions, and number of shortcut attempts.
_GROW, _GROWTHS, _CUTS = 0.5, 400, 40
#: Postures (joints 2 to 7) with the arm folded over its base, as intermediate goals.
_TUCKS = np.array([[-0.785, 0.0, -2.356, 0.0, 1.571, 0.785], [-1.2, 0.0, -2.7, 0.0, 1.9, 0.785]])
#: A start below the clearance comes nearer by this at most (m) while the arm leaves, checked in such steps (rad).
_GIVE, _FINE, _ESCAPES = 0.0002, 0.01, 300


@dataclass(frozen=True)
class ArmPath:
    """A path of the arm: postures (k×7, rad), connected by straight lines in joint space."""

    postures: Array


@dataclass(frozen=True)
class Blocked:
    """No path was found; `reason` is the reason as text."""

    reason: str


class ArmPathPlanner:
    """Plans paths of the arm with the base at rest."""

    def __init__(self, collision: CollisionModel, limits: PlanLimits, seed: int = 0) -> None:
        """Bind the collision model.

        Args:
            collision: Collision model of robot and obstacles.
            limits: Joint limits with margin, and the clearance.
            seed: Random seed of the search.
        """
        self._collision, self._limits, self._seed = collision, limits, seed

    def find(self, q: Array, goal: Array) -> ArmPath | Blocked:
        """A way from the configuration q (12) to the arm posture `goal` (7), the base standing as in q.

        A start too near to something, or even touching it, is left first, straight to the nearest clear posture found.
        """
        rng = np.random.default_rng(self._seed)
        place, start = q.copy(), q[ARM_Q].copy()
        worst = self._least(place, goal)
        if worst[0] < self._limits.clearance:
            return Blocked(f"the arm's goal leaves {1e3 * worst[0]:.0f} mm between {worst[1][0]} and {worst[1][1]}")
        head = [start]
        near = self._least(place, start)
        if near[0] < self._limits.clearance:
            out = self._escape(place, start, near[0], rng)
            if out is None:
                return Blocked(
                    f"the arm starts with {1e3 * near[0]:.0f} mm between {near[1][0]} and {near[1][1]}, and no "
                    f"short path leads out; move it by hand"
                )
            head.append(out)
        for way in self._guesses(head[-1], goal):
            if all(self._free(place, a, b) for a, b in zip(way, way[1:], strict=False)):
                return ArmPath(np.array(head + self._shortened(place, way, rng)[1:]))
        found = self._search(place, head[-1], goal, rng)
        if found is None:
            return Blocked(f"no path of the arm keeps {1e3 * self._limits.clearance:.0f} mm from every obstacle")
        return ArmPath(np.array(head + self._shortened(place, found, rng)[1:]))

    def _guesses(self, start: Array, goal: Array) -> Iterator[list[Array]]:
        yield [start, goal]
        for tuck in _TUCKS:
            here, there = np.concatenate([start[:1], tuck]), np.concatenate([goal[:1], tuck])
            here, there = (np.clip(posture, self._limits.lower, self._limits.upper) for posture in (here, there))
            yield [start, here, goal]
            yield [start, there, goal]
            yield [start, here, there, goal]

    def _escape(self, place: Array, start: Array, near: float, rng: np.random.Generator) -> Array | None:
        """The nearest of random postures that is clear, and gets clear without coming nearer first."""
        sizes = np.linspace(0.05, 1.5, _ESCAPES)
        for size in sizes:
            out: Array = np.clip(start + size * rng.uniform(-1.0, 1.0, 7), self._limits.lower, self._limits.upper)
            if self._least(place, out)[0] < self._limits.clearance + 0.005:
                continue
            if self._free(place, start, out, near - _GIVE, _FINE):
                return out
        return None

    def _search(self, place: Array, start: Array, goal: Array, rng: np.random.Generator) -> list[Array] | None:
        """RRT-Connect; the nodes from start to goal."""
        trees = (_Tree(start), _Tree(goal))
        lower = np.minimum(self._limits.lower, start)
        upper = np.maximum(self._limits.upper, start)
        for growth in range(_GROWTHS):
            here, there = trees[growth % 2], trees[1 - growth % 2]
            new = self._grow(place, here, rng.uniform(lower, upper))
            if new is None:
                continue
            target, last = here.nodes[new], -1
            while True:
                last_new = self._grow(place, there, target, None if last < 0 else last)
                if last_new is None:
                    break
                last = last_new
                if np.array_equal(there.nodes[last], target):
                    ways = [here.way(new), there.way(last)]
                    if growth % 2:
                        ways.reverse()
                    return ways[0] + ways[1][::-1][1:]
        return None

    def _grow(self, place: Array, tree: "_Tree", towards: Array, nearest: int | None = None) -> int | None:
        """One step of a tree; the new node's index, None where something is in the way."""
        index = tree.nearest(towards) if nearest is None else nearest
        at = tree.nodes[index]
        largest = float(np.abs(towards - at).max())
        step = towards if largest <= _GROW else at + (towards - at) * (_GROW / largest)
        if not self._free(place, at, step):
            return None
        return tree.add(step, index)

    def _shortened(self, place: Array, way: list[Array], rng: np.random.Generator) -> list[Array]:
        """The same way with corners cut: first nodes left out, then random points joined."""
        at = 0
        while at < len(way) - 2:
            for far in range(len(way) - 1, at + 1, -1):
                if self._free(place, way[at], way[far]):
                    way = way[: at + 1] + way[far:]
                    break
            at += 1
        for _ in range(_CUTS if len(way) > 2 else 0):
            i, j = sorted(rng.integers(0, len(way) - 1, 2))
            if i == j:
                continue
            a = way[i] + rng.uniform() * (way[i + 1] - way[i])
            b = way[j] + rng.uniform() * (way[j + 1] - way[j])
            if _length([a, b]) < 0.95 * _length([a, *way[i + 1 : j + 1], b]) and self._free(place, a, b):
                way = [*way[: i + 1], a, b, *way[j + 1 :]]
        return way

    def _free(self, place: Array, a: Array, b: Array, least: float | None = None, look: float = _LOOK) -> bool:
        """Whether the straight line from a to b is free. It checks the middle first, where most collisions are."""
        count = int(np.ceil(float(np.abs(b - a).max()) / look))
        needed = self._limits.clearance if least is None else least
        for fraction in _halving(count):
            if self._least(place, a + fraction * (b - a))[0] < needed:
                return False
        return True

    def _least(self, place: Array, arm: Array) -> tuple[float, Pair]:
        place[ARM_Q] = arm
        found = self._collision.least(place)
        return found.distance, found.pair


class _Tree:
    """Tree of postures that are reachable from its root."""

    def __init__(self, root: Array) -> None:
        self.nodes = [root]
        self._parents = [-1]

    def nearest(self, to: Array) -> int:
        return int(np.abs(np.array(self.nodes) - to).max(axis=1).argmin())

    def add(self, node: Array, parent: int) -> int:
        self.nodes.append(node)
        self._parents.append(parent)
        return len(self.nodes) - 1

    def way(self, index: int) -> list[Array]:
        """From the root to a node."""
        out = []
        while index >= 0:
            out.append(self.nodes[index])
            index = self._parents[index]
        return out[::-1]


def _halving(count: int) -> Array:
    """The fractions 1/count … 1: the end first, then by bisection."""
    if count <= 1:
        return np.array([1.0])
    order = np.arange(1, count + 1)
    reversed_bits = [int(f"{i:0{count.bit_length()}b}"[::-1], 2) for i in order]
    rest: Array = order[np.argsort(reversed_bits)] / count
    return np.concatenate([[1.0], rest[rest < 1.0]])


def _length(way: list[Array]) -> float:
    return sum(float(np.abs(b - a).max()) for a, b in zip(way, way[1:], strict=False))
