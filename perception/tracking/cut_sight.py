"""The cut on the robot's last way in: where its cane is now, square to it, in a crop of each picture.

The close-up before has decided which cane is cut, and where along it. These pictures tell alone how far the cane has
moved aside since, by the wind or because a picture from nearer errs less. A picture tells nothing where a cane has
moved farther than canes do, where two canes could be the one, and nearer than the camera measures depth.
"""

from dataclasses import dataclass

import numpy as np

from perception.arrays import Array
from perception.config import PerceptionConfig, SightConfig
from perception.segmentation.frame import View
from perception.segmentation.segmenter import Segmenter
from perception.skeleton.centreline import Centreline
from perception.skeleton.topology import trace_canes, wood_of_cut
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CloseUpResult, CutSight
from rolling_panda.messages.types import Covariance, CutKind, Reason
from rolling_panda.model.wire_values import vector3

#: SD of a cane's place in a picture: across the view (px) and in depth (m), as measured on rendered pictures.
_ACROSS, _DEPTH = 0.5, 0.0015


@dataclass
class _Followed:
    """The cane of a cut: where it crosses the plane of the blades, and when that was seen (s, sender's clock)."""

    point_id: str
    number: int
    position: Array
    tangent: Array
    kind: CutKind
    stamp: float


class CutFollower:
    """Finds the cane of one cut again in every picture. Pure: the pictures have the time."""

    def __init__(self, config: PerceptionConfig) -> None:
        """Nothing is followed yet."""
        self._config, self._limits = config, config.sight
        self._followed: _Followed | None = None

    def begin(self, check: CloseUpResult, kind: CutKind) -> None:
        """Follow a cut of a kind where a close-up has seen it; one that has not ends it."""
        self._followed = None
        if check.finding == "seen" and check.position is not None and check.tangent is not None:
            place, along = np.array(check.position), np.array(check.tangent)
            self._followed = _Followed(check.point_id, check.number, place, along, kind, check.header.stamp)

    def forget(self) -> None:
        """Follow nothing."""
        self._followed = None

    def look(self, view: View, segmenter: Segmenter, point_id: str, number: int) -> CutSight:
        """Find the cane in one picture.

        Args:
            view: The frame, in the frame of the close-up's position.
            segmenter: Segments the crop around the cut only.
            point_id: The point.
            number: Of the request.

        Raises:
            UnusablePictureError: The image is blank.
            CorruptFrameError: The image is corrupt.
        """
        known = self._followed
        if known is None or known.point_id != point_id:
            return unseen(view.stamp, point_id, number, reasons.cut_not_followed())
        found = self._find(view, segmenter, known)
        if not isinstance(found, _Crossing):
            return unseen(view.stamp, point_id, number, found)
        known.position, known.stamp = found.position, view.stamp
        return CutSight(
            header=m.Header(view.stamp, "odom"),
            point_id=point_id,
            number=number,
            position=vector3(found.position),
            covariance=_covariance(view, found.depth),
        )

    def _find(self, view: View, segmenter: Segmenter, known: _Followed) -> "_Crossing | Reason":
        limits = self._limits
        u, v, z = view.pixels(known.position)[0]
        if not limits.min_distance <= z <= limits.max_distance:
            return reasons.camera_not_at_standoff(float(z), limits.min_distance, limits.max_distance)
        half = round(view.intrinsics.fx * limits.half_window / z)
        height, width = view.depth.shape
        if not (half <= u < width - half and half <= v < height - half):
            return reasons.place_outside_picture()
        part = view.part(slice(round(v) - half, round(v) + half), slice(round(u) - half, round(u) + half))
        labels = wood_of_cut(segmenter.segment(part), known.kind)
        lines = trace_canes(part, labels, self._config.skeleton)
        crossings = _crossings(view, known, lines, limits)
        if not crossings:
            return reasons.no_cane_at_place()
        moved = min(limits.max_shift, limits.sure_shift + limits.max_speed * max(0.0, view.stamp - known.stamp))
        nearest = crossings[0]
        if nearest.aside > moved:
            return reasons.cane_jumped(1e3 * nearest.aside, 1e3 * moved)
        if len(crossings) > 1 and crossings[1].aside < nearest.aside + limits.separation:
            return reasons.which_cane_unclear(1e3 * nearest.aside)
        return nearest


@dataclass(frozen=True)
class _Crossing:
    """Where a cane crosses the plane of the blades (3, m), how far from where it is expected, and its depth (m)."""

    position: Array
    aside: float
    depth: float


def _crossings(view: View, known: _Followed, lines: list[Centreline], limits: SightConfig) -> list[_Crossing]:
    """Canes in the direction of the followed one where they cross the plane of the blades, the nearest first."""
    found = []
    for line in lines:
        away = line.axis - known.position
        along = away @ known.tangent
        crosses = np.flatnonzero(np.signbit(along[1:]) != np.signbit(along[:-1]))
        if not len(crosses):
            continue
        k = int(crosses[np.argmin(np.linalg.norm(away[crosses], axis=1))])
        chord = line.axis[k + 1] - line.axis[k]
        if abs(float(chord @ known.tangent)) < limits.min_alignment * float(np.linalg.norm(chord)):
            continue
        place = line.axis[k] + chord * (along[k] / (along[k] - along[k + 1]))
        depth = float(view.pixels(place)[0, 2])
        found.append(_Crossing(place, float(np.linalg.norm(place - known.position)), depth))
    return sorted(found, key=lambda each: each.aside)


def _covariance(view: View, depth: float) -> Covariance:
    across = (_ACROSS * depth / view.intrinsics.fx) ** 2
    a, b, c, d, e, f = (view.R * [across, across, _DEPTH**2] @ view.R.T)[np.triu_indices(3)].tolist()
    return a, b, c, d, e, f


def unseen(stamp: float, point_id: str, number: int, reason: Reason) -> CutSight:
    """What a picture tells that does not show the cut."""
    return CutSight(header=m.Header(stamp, "odom"), point_id=point_id, number=number, reason=reason)
