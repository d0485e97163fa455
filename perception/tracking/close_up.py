"""A closer look at one point, from the stand-off: where exactly its cane is, whether it still fits, whether it is off.

Before a cut it says where the cut belongs as seen from half the distance of the survey, and whether what was counted
there is still what is seen; after a cut it says whether the wood beyond is gone. It never proposes a cut of its own.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.config import LookConfig, PerceptionConfig, SkeletonConfig
from perception.plant.model import Array
from perception.segmentation.frame import View
from perception.segmentation.mending import mended
from perception.segmentation.segmenter import Segmenter
from perception.skeleton.centreline import Centreline, centrelines
from perception.skeleton.fragments import CANE, find_fragments, find_wood
from perception.skeleton.linking import link
from perception.tracking.wood_check import glance
from rolling_panda import messages as m
from rolling_panda.messages.perception import CloseLook, Finding
from rolling_panda.messages.robot import CameraFrame

#: Places at which an axis is compared are so far apart (m).
_STEP = 0.001
_SPUR = m.WOOD_CLASSES.index("spur")


@dataclass(frozen=True)
class _Cane:
    """The cane of a point: nodes and ends by arc length from the foot of the point, positive away from the cordon."""

    foot: Array
    tangent: Array
    end: float
    ends: str
    nodes: Array
    distance: float

    def at(self, shift: float) -> Array:
        """Point on the axis so far beyond the foot of the point (3, m, odom)."""
        out: Array = self.foot + shift * self.tangent
        return out


def look_closely(
    view: View, segmenter: Segmenter, point: m.PruningPoint, number: int, config: PerceptionConfig
) -> CloseLook:
    """What one near frame shows of a point.

    Args:
        view: The frame.
        segmenter: Says which pixel shows what; it is given the part around the point only.
        point: As it was proposed.
        number: Of the request.
        config: Section `[perception]`.

    Raises:
        InputError: The picture shows nothing.
        MessageError: It is corrupt.
    """
    look, place, along = config.look, np.array(point.position), np.array(point.tangent)
    u, v, z = view.pixels(place)[0]
    height, width = view.depth.shape

    def told(finding: Finding, reason: str = "", cane: _Cane | None = None, shift: float = 0.0) -> CloseLook:
        seen = cane is not None and finding == "seen"
        return CloseLook(
            header=m.Header(view.stamp, "odom"),
            point_id=point.point_id,
            number=number,
            finding=finding,
            reason=reason,
            position=_vector(cane.at(shift)) if seen and cane is not None else None,
            tangent=_vector(cane.tangent) if seen and cane is not None else None,
            distance=max(0.0, float(z)),
            nodes=() if cane is None else tuple(float(arc - shift) for arc in cane.nodes),
        )

    if not look.nearest <= z <= look.farthest:
        return told("unseen", f"the camera was {z:.2f} m away; it has to be {look.nearest:g} to {look.farthest:g} m")
    reach = round(view.intrinsics.fx * look.window / z)
    if not (reach / 2 <= u < width - reach / 2 and reach / 2 <= v < height - reach / 2):
        return told("unseen", "the place was not inside the picture")
    part = view.part(slice(round(v) - reach, round(v) + reach), slice(round(u) - reach, round(u) + reach))
    labels = segmenter.segment(part)
    beyond = glance(part, labels, place + look.beyond * along)
    cane = _cane_of(place, along, _lines(part, labels, config.skeleton), look)
    if cane is None:
        # A stub is cut like a cane.
        wood = np.where(labels == _SPUR, np.uint8(CANE), labels)
        cane = _cane_of(place, along, _lines(part, wood, config.skeleton), look)
    if cane is None:
        if beyond == "gone":
            return told("severed")
        return told("unseen", "its cane is hidden" if beyond == "unseen" else "no cane runs through the place")
    if cane.end < look.beyond:
        # What else is seen there is another cane: this one ends, and nothing is in front of its end.
        if cane.ends == "free":
            return told("severed")
        return told("unseen", "what lies beyond the cut is hidden", cane)
    if beyond == "gone":
        return told("unseen", "whether the cane goes on is not clear", cane)
    if point.offset is None:
        return told("seen", "", cane)
    expected = -point.offset
    kept = [arc for arc in cane.nodes if abs(arc - expected) < look.node_shift]
    if kept:
        return told("seen", "", cane, min(kept, key=lambda arc: abs(arc - expected)) - expected)
    crowding = [arc for arc in cane.nodes if -look.node_room < arc < look.node_room]
    if crowding:
        return told("changed", f"a node is seen {1e3 * abs(crowding[0]):.0f} mm from the cut", cane)
    return told("seen", "the node before the cut was not seen", cane)


def no_look(frame: CameraFrame, reason: str) -> CloseLook:
    """Nothing can be said of the point that a picture was asked for."""
    return CloseLook(
        header=m.Header(frame.header.stamp, "odom"),
        point_id=frame.point_id,
        number=frame.number,
        finding="unseen",
        reason=reason[:500],
    )


def _lines(view: View, labels: NDArray[np.uint8], skeleton: SkeletonConfig) -> list[Centreline]:
    view = mended(view, labels, skeleton)
    wood = find_wood(view, labels, skeleton)
    fragments = find_fragments(wood, view.depth.shape, skeleton)
    seen = np.zeros(view.depth.shape, dtype=bool)
    seen[wood.rows, wood.cols] = True
    return centrelines(view, wood, link(view, fragments, seen, skeleton), skeleton)


def _cane_of(place: Array, along: Array, lines: list[Centreline], look: LookConfig) -> _Cane | None:
    """The line that runs through the place of the cut in the cane's direction."""
    best: _Cane | None = None
    for line in lines:
        fine = np.arange(0.0, float(line.arc[-1]) + _STEP, _STEP)
        axis = np.stack([np.interp(fine, line.arc, line.axis[:, i]) for i in range(3)], axis=1)
        foot = int(np.argmin(np.linalg.norm(axis - place, axis=1)))
        first, last = max(0, foot - 10), min(len(axis) - 1, foot + 10)
        chord = axis[last] - axis[first]
        tangent = chord / max(float(np.linalg.norm(chord)), 1e-9)
        sense = 1.0 if float(tangent @ along) >= 0.0 else -1.0
        # Square to the cane: where the line ends short of the place the rest is missing length, not distance.
        off = axis[foot] - place
        beside = off - along * float(off @ along)
        distance, short = float(np.linalg.norm(beside)), abs(float(off @ along))
        if distance > look.aside or short > look.short or abs(float(tangent @ along)) < look.aligned:
            continue
        if best is not None and best.distance <= distance:
            continue
        nodes = np.array(sorted(sense * (node.arc - fine[foot]) for node in line.nodes))
        end = float(fine[-1] - fine[foot]) if sense > 0.0 else float(fine[foot])
        best = _Cane(place + beside, sense * tangent, end, line.ends[int(sense > 0.0)], nodes, distance)
    return best


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
