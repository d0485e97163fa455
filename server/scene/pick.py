"""What a line of sight meets first: rods, triangles of the robot, or the ground."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rolling_panda.messages.perception import Capsule
from rolling_panda.model.differential_drive import Array

#: A cane is thinner than a finger is steady: who passes an axis by less than this (m) means it.
_NEAR_ENOUGH = 0.012
_TINY = 1e-12


@dataclass(frozen=True)
class Ray:
    """From `origin` (3, m) along `direction` (3, unit)."""

    origin: Array
    direction: Array

    def at(self, distance: float) -> Array:
        """The place (3, m) at a distance (m)."""
        place: Array = self.origin + distance * self.direction
        return place


@dataclass(frozen=True)
class Hit:
    """What is met, how far along the ray (m)."""

    distance: float
    what: str


def nearest(hits: Iterable[Hit]) -> Hit | None:
    """The hit that comes first; None where nothing is met."""
    met = [hit for hit in hits if math.isfinite(hit.distance)]
    return min(met, key=lambda hit: hit.distance) if met else None


def hit_rods(ray: Ray, rods: Sequence[Capsule]) -> Hit:
    """The first rod that a ray meets or all but meets; infinitely far where there is none."""
    if not rods:
        return Hit(math.inf, "")
    start, end = (np.array([getattr(rod, name) for rod in rods]) for name in ("start", "end"))
    radius = np.array([max(rod.start_radius, rod.end_radius) for rod in rods])
    axis, aside = end - start, ray.origin - start
    e = np.maximum((axis * axis).sum(axis=1), _TINY)
    b, c, f = axis @ ray.direction, aside @ ray.direction, (axis * aside).sum(axis=1)
    # Nearest on the line through the rod, then on the rod itself, then on the ray.
    along = (b * f - c * e) / np.maximum(e - b * b, _TINY)
    share = np.clip((b * along + f) / e, 0.0, 1.0)
    along = np.maximum(b * share - c, 0.0)
    gap = np.linalg.norm(aside + along[:, None] * ray.direction - share[:, None] * axis, axis=1)
    surface = along - np.sqrt(np.maximum(radius**2 - gap**2, 0.0))
    distance = np.where(gap <= np.maximum(radius, _NEAR_ENOUGH), np.maximum(surface, 0.0), np.inf)
    first = int(np.argmin(distance))
    return Hit(float(distance[first]), rods[first].kind)


def hit_triangles(ray: Ray, corners: Array, what: str) -> Hit:
    """The first triangle (n×3×3, m) that a ray meets from either side (Möller and Trumbore 1997)."""
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(ray.direction, ac)
    area = (ab * p).sum(axis=1)
    flat = np.abs(area) < _TINY
    scale = 1.0 / np.where(flat, 1.0, area)
    t = ray.origin - a
    u = (t * p).sum(axis=1) * scale
    q = np.cross(t, ab)
    v = (q @ ray.direction) * scale
    distance = (q * ac).sum(axis=1) * scale
    met = ~flat & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance > 0.0)
    return Hit(float(np.where(met, distance, np.inf).min(initial=math.inf)), what)


def hit_ground(ray: Ray) -> Hit:
    """Where a ray meets z = 0 from above."""
    down = float(-ray.direction[2])
    return Hit(float(ray.origin[2]) / down if down > 1e-6 and ray.origin[2] > 0.0 else math.inf, "ground")
