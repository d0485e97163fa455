"""Tracker of pruning points: identities, running means with covariances, and withdrawal of points that are gone."""

import copy
import dataclasses
import math
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from statistics import median_high

import numpy as np
from msgspec.structs import replace
from scipy.spatial.distance import cdist

from perception.arrays import Array, Labels, distance
from perception.config import TrackerConfig
from perception.plant.numbering import SpurNumber
from perception.rules.pruning import Cut, cutting_force
from perception.segmentation.frame import View
from perception.tracking.presence import SEARCH_RADIUS, wood_presence
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import identity, point_digest
from rolling_panda.messages.types import CutKind
from rolling_panda.model.wire_values import vector3

#: Frames without support after which a contradicted point is withdrawn, and an unpublished track is deleted.
_MAX_MISSES, _MAX_MISSES_UNPUBLISHED = 5, 20
#: Offsets past the last kept node that differ by less than this are the same cut (m).
_SAME_OFFSET = 0.003
#: Newest observations in the median of the offset.
_OFFSETS = 7
#: Observations farther than this from most others are of another cane, or mix the depths of two (m).
_SAME_PLACE = 0.008
#: A cane that sways is seen within so many standard deviations of where it was seen, and at most so far away (m).
_SWAY, _MOST_SWAY = 2.0, 0.03
#: Camera positions nearer to each other than this are one viewpoint (m): what hides a cane hides it from all of them.
_SAME_VIEWPOINT = 0.05
#: Standard deviation of one observation, used as prior: depth (2.9 mm at 0.9 m, 0.08 px of a D435i) and half a pixel
#: along the cane (m); direction of a few centimetres of axis (rad).
_POSITION_NOISE, _DIRECTION_NOISE = 0.003, 0.05
#: Standard deviation of the error common to all observations: 1 mrad of hand-eye calibration, and wheel slip (m); the
#: same of directions (rad).
_POSITION_BIAS, _DIRECTION_BIAS = 0.0015, 0.01

#: A spur and the kind of a cut: there is at most one published point of each.
Site = tuple[SpurNumber, CutKind]


@dataclass(frozen=True)
class Proposal:
    """A proposed cut and its spur."""

    cut: Cut
    number: SpurNumber


@dataclass(frozen=True)
class TrackerUpdate:
    """Points withdrawn by a frame, with the reason, and the cuts that it showed made, at their mean positions."""

    withdrawn: tuple[m.Reason, ...]
    severed: tuple[Proposal, ...]


@dataclass
class _Looks:
    """Frames that have shown a spur, and their viewpoints, each a camera position (3, m, map)."""

    frames: int = 0
    viewpoints: list[Array] = field(default_factory=list)


@dataclass(eq=False)
class _Track:
    point_id: str
    number: SpurNumber
    cut: Cut
    position: Array
    tangent: Array
    radius: float
    hits: int = 1
    against: int = 0
    """Frames that told a reason against a cut of its kind on its spur."""
    misses: int = 0
    gone: int = 0
    published: m.PruningPoint | None = None
    replaces: CutKind | None = None
    """Kind of the cut before an operator moved it."""
    position_scatter: Array = field(default_factory=lambda: np.zeros((3, 3)))
    """Covariance of single observations (m²)."""
    tangent_scatter: Array = field(default_factory=lambda: np.zeros((3, 3)))
    """Covariance of single observations."""
    offsets: deque[float] = field(default_factory=lambda: deque(maxlen=_OFFSETS))
    """Newest offsets past the last kept node (m)."""
    observed: Array = field(default_factory=lambda: np.zeros((0, 3)))
    """Newest observed positions, each at the median offset (N×3, m, map)."""
    viewpoints: list[Array] = field(default_factory=list)
    """Those of the frames that have proposed it (3, m, map)."""

    @classmethod
    def of(cls, point_id: str, proposal: Proposal) -> "_Track":
        """From a single observation."""
        cut = proposal.cut
        track = cls(point_id, proposal.number, cut, cut.position, cut.tangent, cut.radius)
        track.observed = cut.position[None]
        if cut.offset is not None:
            track.offsets.append(cut.offset)
        return track

    @property
    def sway(self) -> float:
        """How far aside of its position it may be seen (m), by how far aside it was seen so far."""
        spread = float(np.linalg.eigvalsh(self.position_scatter)[-1])
        return min(max(SEARCH_RADIUS, _SWAY * math.sqrt(max(spread, 0.0))), _MOST_SWAY)

    @property
    def site(self) -> Site:
        return self.number, self.cut.kind

    @property
    def is_contradicted(self) -> bool:
        """Whether more frames speak against it than for it."""
        return self.against > self.hits

    def is_for(self, cut: Cut) -> bool:
        """Whether a cut near it may be its own: of the same kind, and on the same cane as far as both are known."""
        same_cane = cut.cane == self.cut.cane or -1 in (cut.cane, self.cut.cane)
        return cut.kind == self.cut.kind and same_cane

    def add(self, cut: Cut, window: int) -> None:
        self.hits += 1
        self.misses = self.gone = 0
        gain = 1.0 / min(self.hits, window)
        # The nodes of the cane are averaged; single frames may cut elsewhere between them.
        old = median_high(self.offsets) if self.offsets else None
        position = cut.position
        if old is not None and cut.offset is not None:
            position = position + (old - cut.offset) * cut.tangent
        off, turn = position - self.position, cut.tangent - self.tangent
        self.position_scatter = (1.0 - gain) * (self.position_scatter + gain * np.outer(off, off))
        self.tangent_scatter = (1.0 - gain) * (self.tangent_scatter + gain * np.outer(turn, turn))
        self.observed = np.concatenate([self.observed, position[None]])[-window:]
        self.position = _agreed(self.observed)
        tangent = self.tangent + gain * turn
        self.tangent = tangent / np.linalg.norm(tangent)
        self.radius += gain * (cut.radius - self.radius)
        if cut.offset is None:
            self.cut = cut
            return
        self.offsets.append(cut.offset)
        new = median_high(self.offsets)
        if old is not None:
            self.observed = self.observed + (new - old) * self.tangent
            self.position = _agreed(self.observed)
        if abs(cut.offset - new) < _SAME_OFFSET:
            self.cut = cut


class Tracker:
    """Holds the pruning points of a row. It has no clock: the same frames give the same points."""

    def __init__(self, config: TrackerConfig) -> None:
        """Start without points."""
        self._config = config
        self._tracks: list[_Track] = []
        self._withdrawn: dict[str, m.PruningPoint] = {}
        self._last_id = 0
        self._looks: defaultdict[SpurNumber, _Looks] = defaultdict(_Looks)
        self._last_revision: dict[str, int] = {}
        """Newest revision of points that were restored to an older one, or withdrawn for now."""

    def copy(self) -> "Tracker":
        """An independent copy."""
        return copy.deepcopy(self)

    def restore(self, before: "Tracker", stands: Callable[[SpurNumber, Array], bool]) -> None:
        """Restore the points of an earlier copy; points placed or moved by an operator since then stay.

        Args:
            before: The copy.
            stands: Whether the wood of a spur is still there at a position (3, m, odom).
        """
        now = {track.point_id: track for track in self._tracks}
        by_hand = {name: track for name, track in now.items() if track.cut.kind == "by hand"}
        moved = self._moved()
        restored: list[_Track] = []
        for track in before.copy()._tracks:
            if track.cut.kind == "by hand" or track.point_id in by_hand:
                if track.point_id in by_hand:
                    restored.append(by_hand.pop(track.point_id))
            elif track.site not in moved and stands(track.number, track.position):
                self._credit_all_viewpoints(track)
                restored.append(track)
        self._tracks = [*restored, *by_hand.values()]
        published = {point.point_id: point for point in self.points()}
        for name, track in now.items():
            if track.published is None:
                continue
            if name not in published:
                self._withdrawn[name] = track.published
            elif published[name].revision < track.published.revision:
                self._last_revision[name] = max(track.published.revision, self._last_revision.get(name, 0))

    def update(
        self,
        view: View,
        labels: Labels,
        proposals: list[Proposal],
        shown: Sequence[SpurNumber] = (),
        contradicted: Collection[Site] = (),
    ) -> TrackerUpdate:
        """Add one frame.

        Args:
            view: The frame.
            labels: H×W class indices.
            proposals: Its proposed cuts.
            shown: The spurs that it shows, with a proposal or without.
            contradicted: Spurs and kinds of cuts that it speaks against.
        """
        for track in self._tracks:
            track.against += track.site in contradicted
        supported = self._associate(proposals)
        for track in supported:
            _add_viewpoint(track.viewpoints, view.t)
        for number in shown:
            looks = self._looks[number]
            looks.frames += 1
            _add_viewpoint(looks.viewpoints, view.t)
        competing: dict[Site, int] = {}
        for track in supported:
            competing[track.site] = max(competing.get(track.site, 0), track.hits)
        withdrawn, severed, kept = [], [], []
        for track in self._tracks:
            reason = None if track in supported else self._withdrawal(track, view, labels, competing)
            if reason is None:
                kept.append(track)
                if track.published is not None and not self._confirmed(track):
                    withdrawn.append(self._withdraw_for_now(track, track.published))
                continue
            # Of last year's cane a single picture may have been wrong.
            seen_often = track.published is not None or track.cut.kind != "removal"
            if track.gone >= self._config.gone_frames and seen_often:
                severed.append(Proposal(dataclasses.replace(track.cut, position=track.position), track.number))
            if track.published is not None:
                self._withdrawn[track.point_id] = track.published
                withdrawn.append(reason)
        self._tracks = kept
        self._publish(supported)
        return TrackerUpdate(tuple(withdrawn), tuple(severed))

    def add(self, proposal: Proposal) -> m.PruningPoint:
        """Publish a cut at once, as one that all viewpoints of its spur have shown."""
        track = self._start(proposal)
        self._credit_all_viewpoints(track)
        track.published = self._message(track)
        return track.published

    def move(self, point_id: str, cut: Cut) -> m.PruningPoint:
        """Move a published point. Its spur gets no other cut of the kind that it had.

        Args:
            point_id: Of a published point.
            cut: By hand.
        """
        old = next(track for track in self._tracks if track.point_id == point_id)
        track = _Track.of(point_id, Proposal(cut, old.number))
        track.replaces = old.replaces or old.cut.kind
        last = 0 if old.published is None else old.published.revision
        point = replace(self._message(track), revision=1 + max(last, self._last_revision.get(point_id, 0)))
        track.published = replace(point, digest=point_digest(point))
        self._tracks[self._tracks.index(old)] = track
        return track.published

    def reset(self, proposals: list[Proposal]) -> None:
        """Replace all points but those by hand, after a change of the rule.

        The cut of a spur keeps its identity; where it changes, it has a new revision.
        """
        old = [track for track in self._tracks if track.cut.kind != "by hand"]
        self._tracks = [track for track in self._tracks if track.cut.kind == "by hand"]
        for proposal in proposals:
            cut, site = proposal.cut, (proposal.number, proposal.cut.kind)
            if site in self._moved():
                continue
            same = [track for track in old if track.published is not None and track.site == site]
            if not same:
                self.add(proposal)
                continue
            track = min(same, key=lambda each: distance(each.position, cut.position))
            old.remove(track)
            if distance(track.position, cut.position) < self._config.position_tolerance:
                track.cut, track.against = cut, 0
            else:
                published, track = track.published, _Track.of(track.point_id, proposal)
                track.published = published
            self._credit_all_viewpoints(track)
            track.published = self._message(track)
            self._tracks.append(track)

    def withdraw_all(self) -> tuple[m.Reason, ...]:
        """Withdraw all points, since the camera has another calibration; returns the reason of each."""
        gone = [track.published for track in self._tracks if track.published is not None]
        self._withdrawn |= {point.point_id: point for point in gone}
        self._tracks = []
        self._looks.clear()
        return tuple(reasons.withdrawn_for_calibration(point.point_id) for point in gone)

    def find(self, point_id: str) -> m.PruningPoint | None:
        """The newest message of a point that is or was published; None if there was none."""
        return next((p for p in self.points() if p.point_id == point_id), None) or self._withdrawn.get(point_id)

    def refine(self, point_id: str, position: Array) -> None:
        """Replace the mean place of a published point by that of a close-up, with the weight of the whole window.

        Its direction stays: the mean of many pictures is better than that of one, of a short stub above all.

        Args:
            point_id: Of the point; others are ignored.
            position: On the axis (3, m, odom).
        """
        for track in self._tracks:
            if track.point_id == point_id and track.published is not None:
                track.position = position
                track.observed = np.repeat(position[None], self._config.averaging_window, axis=0)
                track.hits, track.misses, track.gone = max(track.hits, self._config.averaging_window), 0, 0
                track.published = self._message(track)

    def points(self) -> tuple[m.PruningPoint, ...]:
        """The published points, in the order of their first observation."""
        return tuple(track.published for track in self._tracks if track.published is not None)

    def published_cuts(self) -> tuple[Proposal, ...]:
        """The cuts of the published points, at their published positions."""
        return tuple(
            Proposal(dataclasses.replace(t.cut, position=np.array(t.published.position)), t.number)
            for t in self._tracks
            if t.published is not None
        )

    @property
    def settled(self) -> set[Site]:
        """Spurs and kinds of cuts that have a point, or had one that an operator moved."""
        return {track.site for track in self._tracks if track.published is not None} | self._moved()

    def _start(self, proposal: Proposal) -> _Track:
        self._last_id += 1
        self._tracks.append(_Track.of(f"p{self._last_id}", proposal))
        return self._tracks[-1]

    def _associate(self, proposals: list[Proposal]) -> list[_Track]:
        """Greedy nearest-neighbour association; other proposals start tracks. Returns the supported tracks."""
        known = list(self._tracks)
        positions = np.array([track.position for track in known]).reshape(-1, 3)
        cuts = np.array([proposal.cut.position for proposal in proposals]).reshape(-1, 3)
        close = np.argwhere(cdist(positions, cuts) <= self._config.association_distance)
        pairs = sorted(
            (distance(known[t].position, proposals[p].cut.position), t, p)
            for t, p in close.tolist()
            if known[t].is_for(proposals[p].cut)
        )
        supported: list[_Track] = []
        used: set[int] = set()
        for _, t, p in pairs:
            if p not in used and known[t] not in supported:
                used.add(p)
                known[t].add(proposals[p].cut, self._config.averaging_window)
                supported.append(known[t])
        return supported + [self._start(proposal) for p, proposal in enumerate(proposals) if p not in used]

    def _withdrawal(self, track: _Track, view: View, labels: Labels, competing: dict[Site, int]) -> m.Reason | None:
        """Why a track without support is withdrawn; None to keep it.

        `competing` has the hits of the supported track of each site.
        """
        probe = track.position + self._config.probe_distance * track.tangent
        presence = wood_presence(view, labels, probe, track.sway, track.cut.kind)[0]
        if presence == "not visible":
            return None
        track.gone = track.gone + 1 if presence == "gone" else 0
        if track.gone >= self._config.gone_frames:
            return reasons.withdrawn_as_cut(track.point_id, track.number.vine, track.number.spur, track.gone)
        against = competing.get(track.site, 0)
        if track.published is not None and not against:
            return None
        track.misses += 1
        outvoted = track.published is not None and against > max(track.hits, self._config.min_hits - 1)
        if outvoted or track.misses >= (_MAX_MISSES_UNPUBLISHED if track.published is None else _MAX_MISSES):
            return reasons.withdrawn_as_elsewhere(track.point_id, track.number.vine, track.number.spur)
        return None

    def _credit_all_viewpoints(self, track: _Track) -> None:
        """Count every viewpoint of its spur for a cut that was not proposed frame by frame under the present rule."""
        track.viewpoints = list(self._looks[track.number].viewpoints)

    def _confirmed(self, track: _Track) -> bool:
        """Whether as many frames speak for it as against, from enough viewpoints; one by hand needs none."""
        needed = min(self._config.min_viewpoints, math.ceil(len(self._looks[track.number].viewpoints) / 2))
        return track.cut.kind == "by hand" or (len(track.viewpoints) >= needed and not track.is_contradicted)

    def _withdraw_for_now(self, track: _Track, point: m.PruningPoint) -> m.Reason:
        """Withdraw a point until more frames or other viewpoints confirm it; then it has a new revision."""
        self._withdrawn[track.point_id] = point
        self._last_revision[track.point_id] = max(point.revision, self._last_revision.get(track.point_id, 0))
        track.published = None
        withdrawn = reasons.withdrawn_as_contradicted if track.is_contradicted else reasons.withdrawn_as_unconfirmed
        return withdrawn(track.point_id, track.number.vine, track.number.spur)

    def _publish(self, supported: list[_Track]) -> None:
        tracks = Counter(track.site for track in self._tracks)
        published = self.settled
        for track in self._tracks:
            if track.published is None:
                sparse = self._looks[track.number].frames >= self._config.sparse_observations
                needed = self._config.sparse_hits if sparse and tracks[track.site] == 1 else self._config.min_hits
                if track.site in published or track.hits < needed or not self._confirmed(track):
                    continue
            elif track not in supported:
                continue
            published.add(track.site)
            track.published = self._message(track)

    def unconfirmed(self) -> set[Site]:
        """Spurs and kinds of cuts that were proposed, but not by enough frames and viewpoints for a point."""
        return {track.site for track in self._tracks} - self.settled

    def _moved(self) -> set[Site]:
        """Sites whose cut an operator has moved."""
        return {(track.number, track.replaces) for track in self._tracks if track.replaces is not None}

    def _message(self, track: _Track) -> m.PruningPoint:
        """The message of a point; kind and pose of the cut change only together with the revision."""
        old, cut = track.published, track.cut
        count = min(track.hits, self._config.averaging_window)
        last_revision = self._last_revision.get(track.point_id, 0)
        point = m.PruningPoint(
            point_id=track.point_id,
            revision=1 + last_revision,
            position=vector3(track.position),
            tangent=vector3(track.tangent),
            radius=float(track.radius),
            confidence=cut.confidence,
            nodes_seen=min(cut.nodes_seen, 100),
            nodes_kept=min(cut.nodes_kept, 100),
            vine=track.number.vine,
            spur=track.number.spur,
            reason=cut.reason,
            kind=cut.kind,
            position_covariance=_symmetric(position_covariance(track.position_scatter, count)),
            tangent_covariance=_symmetric(direction_covariance(track.tangent_scatter, count, track.tangent)),
            offset=cut.offset,
            force=cutting_force(float(track.radius)),
            node_distance=cut.node_distance,
            cane=cut.cane,
            inward=cut.inward,
            outward=cut.outward,
        )
        if old is not None:
            same = self._same_cut(old, point)
            point = replace(
                point,
                # A revision is never used twice.
                revision=old.revision if same else 1 + max(old.revision, last_revision),
                position=old.position if same else point.position,
                tangent=old.tangent if same else point.tangent,
            )
        return replace(point, digest=point_digest(point))

    def _same_cut(self, old: m.PruningPoint, new: m.PruningPoint) -> bool:
        moved = float(np.linalg.norm(np.subtract(new.position, old.position)))
        turned = float(np.arccos(np.clip(np.dot(new.tangent, old.tangent), -1.0, 1.0)))
        shifted = abs((new.offset or 0.0) - (old.offset or 0.0))
        same_pose = moved <= self._config.position_tolerance and turned <= self._config.tangent_tolerance
        return identity(new) == identity(old) and same_pose and shifted < _SAME_OFFSET


def _add_viewpoint(viewpoints: list[Array], position: Array) -> None:
    """Add a camera position (3, m, map), unless it is one of these viewpoints."""
    if all(distance(position, other) >= _SAME_VIEWPOINT for other in viewpoints):
        viewpoints.append(position)


def _agreed(positions: Array) -> Array:
    """Mean of the positions (N×3) near the one that most others are nearest to: along the way of a cane that sways."""
    distances = cdist(positions, positions)
    near = max(_SAME_PLACE, float(np.median(distances)))
    middle = distances[np.argmin(np.minimum(distances, 2 * near).sum(axis=0))]
    mean: Array = positions[middle < near].mean(axis=0)
    return mean


def position_covariance(scatter: Array, count: int) -> Array:
    """Covariance (3×3, m²) of a mean position.

    Args:
        scatter: Covariance of single observations (3×3, m²).
        count: Observations in the mean.
    """
    return _of_mean(scatter, count, _POSITION_NOISE**2 * np.eye(3)) + _POSITION_BIAS**2 * np.eye(3)


def direction_covariance(scatter: Array, count: int, direction: Array) -> Array:
    """Covariance (3×3) of a mean unit vector, in its tangent plane.

    Args:
        scatter: Covariance of single observations (3×3).
        count: Observations in the mean.
        direction: The unit vector (3).
    """
    across = np.eye(3) - np.outer(direction, direction)
    mean = _of_mean(scatter, count, _DIRECTION_NOISE**2 * np.eye(3))
    out: Array = across @ mean @ across + _DIRECTION_BIAS**2 * across
    return out


def _of_mean(scatter: Array, count: int, prior: Array) -> Array:
    """Covariance of a mean; the prior has the weight of one observation."""
    single = (prior + count * scatter) / (1.0 + count)
    out: Array = single / count
    return out


def _symmetric(matrix: Array) -> m.Covariance:
    """The upper triangle of a symmetric 3×3, to four digits."""
    a, b, c, d, e, f = (float(f"{value:.4g}") for value in matrix[np.triu_indices(3)])
    return a, b, c, d, e, f
