"""Close-up check of one point, from the stand-off.

Before a cut it finds the point's cane, however far the picture is shifted against the plant map. It measures the
position on the cane from half the distance of the survey and confirms the last kept node.
After a cut it tells whether the wood beyond is gone. It never proposes a cut.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from perception.arrays import Array, interpolate
from perception.config import CloseUpConfig, PerceptionConfig
from perception.plant.map import NOTHING_KNOWN, Surroundings
from perception.segmentation.frame import View
from perception.segmentation.segmenter import Segmenter
from perception.skeleton.centreline import Centreline
from perception.skeleton.topology import trace_canes, wood_of_cut
from perception.tracking.picture_shift import UNSHIFTED, PictureShift, picture_shift
from perception.tracking.presence import wood_presence
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CloseUpResult, Finding
from rolling_panda.messages.robot import CameraFrame
from rolling_panda.messages.types import Reason
from rolling_panda.model.wire_values import vector3

#: Spacing of axis samples (m), and samples to either side in a tangent.
_STEP, _TANGENT_SAMPLES = 0.001, 10
#: Wood of the map within this distance of a point tells how far its picture is shifted (m): inside the window.
AROUND = 0.07
#: An axis of the map nearer to the point than this may be its own cane (m).
_OWN = 0.02
#: Farthest that a cane sways aside (m), and how near to a place along it a line must come to pass it (m).
_SWAYS, _PAST = 0.03, 0.005
#: A cane is taken for the point's by itself where any other is farther away by this (m).
_ALONE = 0.01


class CloseUp(NamedTuple):
    """Result of a close-up, and by how much its picture is shifted against the plant map (3, m, odom)."""

    result: CloseUpResult
    shift: Array


@dataclass(frozen=True)
class _Cane:
    """The cane of a point, by arc length from the foot of the point, positive away from the cordon.

    Attributes:
        foot: Projection of the point on the axis (3, m, odom).
        tangent: Unit vector along the axis (3, odom).
        end: Arc length at its outer end (m).
        end_reason: Why it ends there.
        nodes: Arc lengths of its nodes (m).
        distance: From the point to the axis (m).
    """

    foot: Array
    tangent: Array
    end: float
    end_reason: str
    nodes: Array
    distance: float

    def at(self, shift: float) -> Array:
        """Point on the axis, shifted from the foot (3, m, odom)."""
        out: Array = self.foot + shift * self.tangent
        return out


def check_close_up(
    view: View,
    segmenter: Segmenter,
    point: m.PruningPoint,
    number: int,
    config: PerceptionConfig,
    known: Surroundings = NOTHING_KNOWN,
    expected: Array = UNSHIFTED,
) -> CloseUp:
    """Check one point in a close-up frame.

    A cane is confirmed where the last node that the cut leaves is seen. It is taken to be off only where no other one
    passes that may be it, swaying.

    Args:
        view: The frame.
        segmenter: Segments the window around the point only.
        point: The published point.
        number: Of the request.
        config: Section `[perception]`.
        known: Canes and nodes that the map has around the point; without any, the picture is shifted as expected.
        expected: Shift of the last picture that showed this cane (3, m, odom).

    Raises:
        UnusablePictureError: The image is blank.
        CorruptFrameError: The image is corrupt.
    """
    limits, accepted, along = config.close_up, np.array(point.position), np.array(point.tangent)
    position = accepted + expected
    u, v, z = view.pixels(position)[0]
    height, width = view.depth.shape

    def result(
        finding: Finding, reason: Reason | None = None, cane: _Cane | None = None, moved: float = 0.0
    ) -> CloseUp:
        confirmed = cane if finding == "seen" else None
        told = CloseUpResult(
            header=m.Header(view.stamp, "odom"),
            point_id=point.point_id,
            number=number,
            finding=finding,
            reason=reason,
            position=None if confirmed is None else vector3(confirmed.at(moved)),
            tangent=None if confirmed is None else vector3(confirmed.tangent),
            distance=max(0.0, float(z)),
            nodes=() if cane is None else tuple(float(arc - moved) for arc in cane.nodes),
        )
        return CloseUp(told, expected if shift is None else shift.by)

    shift: PictureShift | None = None
    if not limits.min_distance <= z <= limits.max_distance:
        away = reasons.camera_not_at_standoff(float(z), limits.min_distance, limits.max_distance)
        return result("unseen", away)
    half = round(view.intrinsics.fx * limits.half_window / z)
    if not (half / 2 <= u < width - half / 2 and half / 2 <= v < height - half / 2):
        return result("unseen", reasons.place_outside_picture())
    part = view.part(slice(round(v) - half, round(v) + half), slice(round(u) - half, round(u) + half))
    labels = segmenter.segment(part)
    lines = trace_canes(part, labels, config.skeleton)
    shift = picture_shift(known, lines, accepted, along, expected)
    # What the cane's last kept node cannot confirm is not looked for aside.
    if point.offset is not None and (shift is None or _cane_at(accepted + shift.by, along, lines, limits) is None):
        aside = _lone_cane(position, along, lines, known, expected, limits)
        shift = shift if aside is None else PictureShift(expected + aside)
    by = expected if shift is None else shift.by
    position = accepted + by
    probe = position + limits.probe_distance * along
    beyond = wood_presence(part, labels, probe, kind=point.kind)[0]
    cane = None if point.kind == "removal" else _cane_at(position, along, lines, limits)
    if cane is None:
        # A renewal cut is on a stub, and a removal on last year's cane.
        wood = wood_of_cut(labels, "removal" if point.kind == "removal" else "renewal cut")
        cane = _cane_at(position, along, trace_canes(part, wood, config.skeleton), limits)
    gone = beyond == "gone" and not _may_stand_aside(probe, along, lines, known, shift, limits)
    if cane is None:
        if gone:
            return result("severed")
        return result("unseen", reasons.cane_hidden() if beyond == "not visible" else reasons.no_cane_at_place())
    if cane.end < limits.probe_distance:
        # Wood beyond may lack depth alone, as in low sun.
        if cane.end_reason == "free" and gone:
            return result("severed")
        return result("unseen", reasons.beyond_cut_hidden(), cane)
    if shift is None and cane.distance > limits.sure_offset:
        return result("unseen", reasons.which_cane_unclear(1e3 * cane.distance), cane)
    if shift is not None and not shift.agreed:
        return result("unseen", reasons.which_internode_unclear(), cane)
    if beyond == "gone":
        return result("unseen", reasons.cane_end_unclear(), cane)
    if point.offset is None:
        return result("seen", None, cane)
    last = -point.offset
    kept = [arc for arc in cane.nodes if abs(arc - last) < limits.max_node_shift]
    if kept:
        return result("seen", None, cane, min(kept, key=lambda arc: abs(arc - last)) - last)
    crowding = [arc for arc in cane.nodes if abs(arc) < limits.node_clearance]
    if crowding:
        return result("changed", reasons.node_near_cut(1e3 * abs(float(crowding[0]))), cane)
    return result("unseen", reasons.node_before_cut_unseen(), cane)


def _may_stand_aside(
    probe: Array,
    along: Array,
    lines: list[Centreline],
    known: Surroundings,
    shift: PictureShift | None,
    limits: CloseUpConfig,
) -> bool:
    """Whether a line past a place beyond the cut, as far aside as a cane sways, is none of the known neighbours.

    Args:
        probe: The place, as the picture is shifted (3, m, odom).
        along: Unit vector along the cane (3, odom).
        lines: Canes that the picture shows.
        known: Canes around the point, its own among them.
        shift: Of the picture; None where nobody knows it, so that any line may be the cane.
        limits: Which lines count.
    """
    axes = [] if shift is None else [axis + shift.by for axis in known.axes]
    neighbours = [axis for axis in axes if _away(axis, probe) > _OWN]
    return any(
        math.dist(at, probe) < _SWAYS and all(_away(axis, at) > _OWN / 2 for axis in neighbours)
        for at in _passing(lines, probe, along, limits)
    )


def _lone_cane(
    place: Array, along: Array, lines: list[Centreline], known: Surroundings, expected: Array, limits: CloseUpConfig
) -> Array | None:
    """How far aside of its place (3, m) the picture shows a cane, where no other one can be it; None otherwise.

    Canes sway one by one, and depth is lost in patches, so that the surroundings of a point may not fit the map.

    Args:
        place: Where the cane is expected (3, m, odom).
        along: Unit vector along the cane (3, odom).
        lines: Canes that the picture shows.
        known: Canes around the point, its own among them.
        expected: Shift of the picture against the map (3, m, odom).
        limits: Which lines count.
    """
    passing = _passing(lines, place, along, limits)
    away = [math.dist(at, place) for at in passing]
    axes = sorted((axis + expected for axis in known.axes), key=lambda axis: _away(axis, place))
    if not axes or not passing or max(_away(axes[0], place), away[0]) > _SWAYS:
        return None
    # The map may have a cane that sways more than once.
    own = [axis for axis in axes if _away(axis, place) <= _OWN] or axes[:1]
    nearest = min(_away(axis, passing[0]) for axis in own)
    other_line = any(each < away[0] + _ALONE for each in away[1:])
    if other_line or any(_away(axis, passing[0]) < nearest + _ALONE for axis in axes[len(own) :]):
        return None
    off = passing[0] - place
    aside: Array = off - along * float(off @ along)
    return aside


def _passing(lines: list[Centreline], place: Array, along: Array, limits: CloseUpConfig) -> list[Array]:
    """Where lines in the direction of a cane pass a place on it (3, m, odom), the nearest first."""
    found = []
    for line in lines:
        away = np.linalg.norm(line.axis - place, axis=1)
        k = int(np.argmin(away))
        chord = line.axis[min(k + 1, len(away) - 1)] - line.axis[max(k - 1, 0)]
        aligned = abs(float(chord @ along)) >= limits.min_alignment * float(np.linalg.norm(chord))
        if aligned and abs(float((line.axis[k] - place) @ along)) < _PAST:
            found.append((float(away[k]), line.axis[k]))
    return [at for _, at in sorted(found, key=lambda each: each[0])]


def _away(axis: Array, place: Array) -> float:
    return float(np.min(np.linalg.norm(axis - place, axis=1)))


def failed_check(frame: CameraFrame, reason: Reason) -> CloseUpResult:
    """The result of a check that was not possible."""
    return CloseUpResult(
        header=m.Header(frame.header.stamp, "odom"),
        point_id=frame.point_id,
        number=frame.number,
        finding="unseen",
        reason=reason,
    )


def _cane_at(position: Array, along: Array, lines: list[Centreline], limits: CloseUpConfig) -> _Cane | None:
    """The line nearest to a position, among those in the direction of the cane."""
    best: _Cane | None = None
    for line in lines:
        fine = np.arange(0.0, float(line.arc[-1]) + _STEP, _STEP)
        axis = interpolate(fine, line.arc, line.axis)
        foot = int(np.argmin(np.linalg.norm(axis - position, axis=1)))
        first, last = max(0, foot - _TANGENT_SAMPLES), min(len(axis) - 1, foot + _TANGENT_SAMPLES)
        chord = axis[last] - axis[first]
        tangent = chord / max(float(np.linalg.norm(chord)), 1e-9)
        sense = 1.0 if float(tangent @ along) >= 0.0 else -1.0
        off = axis[foot] - position
        lateral = off - along * float(off @ along)
        offset, end_gap = float(np.linalg.norm(lateral)), abs(float(off @ along))
        if offset > limits.max_lateral_offset or end_gap > limits.max_end_gap:
            continue
        if abs(float(tangent @ along)) < limits.min_alignment or (best is not None and best.distance <= offset):
            continue
        nodes = np.array(sorted(sense * (node.arc - fine[foot]) for node in line.nodes))
        # Where depth was lost up to the end, the line may go on along other wood.
        begins = next((span.end for span in line.hidden if span.start <= _STEP), 0.0)
        ends = next((span.start for span in line.hidden if span.end >= fine[-1] - _STEP), float(fine[-1]))
        end = ends - float(fine[foot]) if sense > 0.0 else float(fine[foot]) - begins
        best = _Cane(position + lateral, sense * tangent, end, line.ends[int(sense > 0.0)], nodes, offset)
    return best
