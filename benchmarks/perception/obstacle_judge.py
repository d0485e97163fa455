"""Judges obstacles by the simulator's own row: whether such wood stands there, and what of that in view is not told."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bridge.sim.camera.renderer import RgbdImage
from bridge.sim.vineyard.row import Array, Rod, Row
from perception.config import ObstacleConfig
from rolling_panda.messages.perception import Capsule
from rolling_panda.messages.robot import Intrinsics
from rolling_panda.messages.types import WoodClass

KINDS: tuple[WoodClass, ...] = ("post", "trunk", "cordon", "wire")
#: Samples along a rod are so far apart (m), and so many around it.
_STEP, _AROUND = 0.02, 12
#: Wood without an obstacle within this distance is missing (m).
_NEAR = 0.03
#: A tie is no stretch of wire: shorter ones do not count as wood in view (m).
_TIE = 0.05


@dataclass(frozen=True)
class Told:
    """One obstacle, as it was told at some time.

    Attributes:
        kind: What it was told to be.
        start: Its end (m, odom).
        end: The other.
        radius: As told (m).
        p95: 95th percentile, over its surface, of the distance to the surface of the nearest true wood of its kind (m).
        any_p95: The same to true wood of any kind, where it is farther than 30 mm from its own (m).
        angle_deg: Of posts and trunks, to the axis of the nearest true one between the same heights; else 0.
        thickness: Of posts and trunks, the radius over that of the nearest true one there; else 1.
    """

    kind: WoodClass
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float
    p95: float
    any_p95: float
    angle_deg: float
    thickness: float


@dataclass
class Verdict:
    """What was told, at all times that were looked at, and what was in view and not told at the end.

    Attributes:
        told: Every obstacle each time.
        seen: Length of the true wood that was in view, by kind (m).
        missing: Of that, without an obstacle of its kind within 30 mm at the end (m).
    """

    told: list[Told] = field(default_factory=list)
    seen: dict[WoodClass, float] = field(default_factory=dict)
    missing: dict[WoodClass, float] = field(default_factory=dict)


class ObstacleJudge:
    """Looks along with the camera, and judges what is told now and then."""

    def __init__(self, row: Row, config: ObstacleConfig) -> None:
        """Know the truth.

        Args:
            row: As it stands.
            config: For what counts as in view.
        """
        self._config = config
        self._rods = {kind: [rod for _, rod in row.standing() if rod.kind == kind] for kind in KINDS}
        self._every = [rod for _, rod in row.standing()]
        places, owners, kinds = [], [], []
        for index, rod in row.standing():
            length = float(np.linalg.norm(rod.end - rod.start))
            if rod.kind in KINDS and length > _TIE:
                shares = (np.arange(max(1, round(length / _STEP))) + 0.5) / max(1, round(length / _STEP))
                places.append(rod.start + shares[:, None] * (rod.end - rod.start))
                owners += [index] * len(shares)
                kinds += [rod.kind] * len(shares)
        self._place, self._owner, self._kind = np.concatenate(places), np.array(owners), np.array(kinds)
        self._looks = np.zeros(len(self._place), dtype=int)
        self._verdict = Verdict()

    def see(self, image: RgbdImage, k: Intrinsics, T_world_camera: Array) -> None:
        """Note which wood a picture shows within the distances at which obstacles are taken in.

        Args:
            image: With the index of the rod that each pixel shows.
            k: Of its lens.
            T_world_camera: Where the camera really is (4×4).
        """
        config = self._config
        x, y, z = ((self._place - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]).T
        nearest = np.where(self._kind == "wire", config.min_depth, config.min_depth_thick)
        safe = np.maximum(z, 1e-6)
        u, v = np.rint(k.fx * x / safe + k.cx), np.rint(k.fy * y / safe + k.cy)
        ahead = (z > nearest) & (z < config.max_depth) & (u > 0) & (u < k.width - 1) & (v > 0) & (v < k.height - 1)
        rows, cols = v[ahead].astype(int), u[ahead].astype(int)
        # The lens looks a little elsewhere than it is taken to: a pixel beside will do.
        shown = np.zeros(len(rows), dtype=bool)
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                shown |= image.rods[rows + down, cols + right] == self._owner[ahead]
        self._looks[np.flatnonzero(ahead)[shown]] += 1

    def judge(self, capsules: Sequence[Capsule], final: bool) -> None:
        """Judge all that is told now.

        Args:
            capsules: Canes among them do not count.
            final: Whether to look for what is missing too.
        """
        own = [capsule for capsule in capsules if capsule.kind in KINDS]
        self._verdict.told += [self._told(capsule) for capsule in own]
        if not final:
            return
        for kind in KINDS:
            seen = (self._kind == kind) & (self._looks >= self._config.min_hits)
            if not seen.any():
                continue
            gaps = np.full(int(seen.sum()), np.inf)
            for capsule in own:
                if capsule.kind == kind:
                    gaps = np.minimum(gaps, _gaps(self._place[seen], *_ends(capsule)))
            self._verdict.seen[kind] = float(seen.sum()) * _STEP
            self._verdict.missing[kind] = float(np.count_nonzero(gaps > _NEAR)) * _STEP

    def verdict(self) -> Verdict:
        """All that was judged."""
        return self._verdict

    def _told(self, capsule: Capsule) -> Told:
        start, end, radius, _ = _ends(capsule)
        surface = _surface(start, end, radius)
        angle, thickness = 0.0, 1.0
        if capsule.kind in ("post", "trunk"):
            angle, thickness = self._upright(capsule.kind, start, end, radius)
        own = _p95(surface, self._rods[capsule.kind])
        return Told(
            capsule.kind,
            capsule.start,
            capsule.end,
            radius,
            own,
            own if own <= _NEAR else _p95(surface, self._every),
            angle,
            thickness,
        )

    def _upright(self, kind: WoodClass, start: Array, end: Array, radius: float) -> tuple[float, float]:
        """Angle to the nearest true one between the same heights (degrees), and the ratio of the radii."""
        middle = (start + end) / 2
        rods = self._rods[kind]
        if not rods:
            return 90.0, np.inf
        nearest = min(rods, key=lambda rod: float(_gaps(middle[None], rod.start, rod.end, 0.0, 0.0)[0]))
        whole = [rod for rod in rods if rod is nearest or kind == "trunk" and rod.vine == nearest.vine]
        points = np.array([whole[0].start, *(rod.end for rod in whole)])
        low, high = (float(np.clip(z, points[0, 2], points[-1, 2])) for z in sorted((start[2], end[2])))
        ends = np.array([[np.interp(z, points[:, 2], points[:, i]) for i in (0, 1, 2)] for z in (low, high)])
        true = ends[1] - ends[0] if high - low > 0.02 else points[-1] - points[0]
        told = end - start
        cosine = abs(float(true @ told)) / max(float(np.linalg.norm(true) * np.linalg.norm(told)), 1e-12)
        return float(np.degrees(np.arccos(min(1.0, cosine)))), radius / max(nearest.start_radius, nearest.end_radius)


def _ends(capsule: Capsule) -> tuple[Array, Array, float, float]:
    return np.array(capsule.start), np.array(capsule.end), capsule.start_radius, capsule.end_radius


def _surface(start: Array, end: Array, radius: float) -> Array:
    """Points on a capsule's side (N×3)."""
    axis = end - start
    length = max(float(np.linalg.norm(axis)), 1e-9)
    axis = axis / length
    beside = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 0.0, 1.0])
    beside /= np.linalg.norm(beside)
    around = np.linspace(0.0, 2 * np.pi, _AROUND, endpoint=False)
    ring = radius * (np.outer(np.cos(around), beside) + np.outer(np.sin(around), np.cross(axis, beside)))
    along = np.linspace(0.0, length, max(2, round(length / _STEP) + 1))
    out: Array = (start + along[:, None, None] * axis + ring).reshape(-1, 3)
    return out


def _p95(surface: Array, rods: Sequence[Rod]) -> float:
    nearest: NDArray[np.float64] = np.full(len(surface), np.inf)
    low, high = surface.min(axis=0) - 0.5, surface.max(axis=0) + 0.5
    for rod in rods:
        # Rods that are farther than half a metre cannot be the nearest where any other is.
        if (np.maximum(rod.start, rod.end) > low).all() and (np.minimum(rod.start, rod.end) < high).all():
            gaps = _gaps(surface, rod.start, rod.end, rod.start_radius, rod.end_radius)
            nearest = np.minimum(nearest, np.abs(gaps))
    return float(np.quantile(nearest, 0.95)) if np.isfinite(nearest).all() else 1.0


def _gaps(places: Array, start: Array, end: Array, first: float, last: float) -> Array:
    """Distance of places (N×3) from the surface of a rod (m); negative inside."""
    axis = end - start
    share = np.clip((places - start) @ axis / max(float(axis @ axis), 1e-12), 0.0, 1.0)
    out: Array = np.linalg.norm(places - start - share[:, None] * axis, axis=1) - first - share * (last - first)
    return out
