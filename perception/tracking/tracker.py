"""Points over time: identities that last, averages that beat the noise, and withdrawal of what has gone."""

import copy
import dataclasses
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from statistics import median_high
from types import MappingProxyType

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from perception.config import TrackerConfig
from perception.plant.model import Array
from perception.plant.numbering import SpurNumber
from perception.rules.cutting_force import cutting_force
from perception.rules.spur import Cut
from perception.segmentation.frame import View
from perception.tracking import uncertainty
from perception.tracking.wood_check import glance
from rolling_panda import messages as m
from rolling_panda.messages.perception import point_digest
from rolling_panda.messages.types import CutKind

#: Frames without support after which a contradicted point is withdrawn, and one that was never shown is forgotten.
_PATIENCE, _MEMORY_OF_UNSHOWN = 5, 20
#: Cuts of single looks are taken for the same one on an internode where they differ by less than this (m).
_SAME_OFFSET = 0.003
#: What most of so many newest looks say of it counts.
_OFFSETS = 7


@dataclass(frozen=True)
class Proposal:
    """A cut that one frame proposes, and the spur it belongs to."""

    cut: Cut
    number: SpurNumber


@dataclass(frozen=True)
class Tracked:
    """What the tracker holds true.

    Attributes:
        points: To show.
        withdrawn: What it withdrew in this frame, with the reason.
        severed: Where wood was found cut in this frame (3, m, odom).
    """

    points: tuple[m.PruningPoint, ...]
    withdrawn: tuple[str, ...]
    severed: tuple[Array, ...] = ()


@dataclass
class _Track:
    point_id: str
    number: SpurNumber
    cut: Cut
    position: Array
    tangent: Array
    radius: float
    hits: int = 1
    misses: int = 0
    gone: int = 0
    shown: m.PruningPoint | None = None
    instead_of: CutKind | None = None
    """Kind of the cut that a person has moved to become this one."""
    scatter: Array = field(default_factory=lambda: np.zeros((3, 3)))
    turns: Array = field(default_factory=lambda: np.zeros((3, 3)))
    """Scatter of single looks around the means: of places (m²) and of tangents."""
    offsets: deque[float] = field(default_factory=lambda: deque(maxlen=_OFFSETS))
    """Of the newest looks, past the last node that stays (m): a look may see what the blades have to give way to."""

    def __post_init__(self) -> None:
        """The first look counts."""
        if self.cut.offset is not None:
            self.offsets.append(self.cut.offset)

    def add(self, cut: Cut, memory: int) -> None:
        self.hits += 1
        self.misses = self.gone = 0
        share = 1.0 / min(self.hits, memory)
        # What is averaged is where the cane's nodes are, not where single looks would cut between them.
        at = self._offset
        place = cut.position if at is None or cut.offset is None else cut.position + (at - cut.offset) * cut.tangent
        off, turn = place - self.position, cut.tangent - self.tangent
        self.scatter = (1.0 - share) * (self.scatter + share * np.outer(off, off))
        self.turns = (1.0 - share) * (self.turns + share * np.outer(turn, turn))
        self.position = self.position + share * off
        tangent = self.tangent + share * turn
        self.tangent = tangent / np.linalg.norm(tangent)
        self.radius += share * (cut.radius - self.radius)
        if cut.offset is None:
            self.cut = cut
            return
        self.offsets.append(cut.offset)
        most = median_high(self.offsets)
        if at is not None:
            self.position = self.position + (most - at) * self.tangent
        if abs(cut.offset - most) < _SAME_OFFSET:
            self.cut = cut

    @property
    def _offset(self) -> float | None:
        return median_high(self.offsets) if self.offsets else None


class Tracker:
    """Holds the pruning points of a row. One frame at a time, no clock: the same frames give the same points."""

    def __init__(self, config: TrackerConfig) -> None:
        """Start with no points."""
        self._config = config
        self._tracks: list[_Track] = []
        self._former: dict[str, m.PruningPoint] = {}
        """Points withdrawn: whether their wood is off may still be asked."""
        self._named = 0
        self._spent: dict[str, int] = {}
        """Newest revision of points that have gone back to an older one."""

    def copy(self) -> "Tracker":
        """What is held true now, which nothing changes that happens later."""
        other = Tracker(self._config)
        other._tracks, other._former = copy.deepcopy(self._tracks), dict(self._former)
        other._named, other._spent = self._named, dict(self._spent)
        return other

    def return_to(self, before: "Tracker", stands: Callable[[SpurNumber, Array], bool]) -> None:
        """Show the points of an earlier moment again; what persons have placed or moved since stays.

        Args:
            before: A copy of then.
            stands: Whether the wood of a spur is still there at a place (3, m, odom).
        """
        now = {track.point_id: track for track in self._tracks}
        by_hand = {name: track for name, track in now.items() if track.cut.kind == "by hand"}
        moved = self._moved()
        back: list[_Track] = []
        for track in before.copy()._tracks:
            if track.cut.kind == "by hand" or track.point_id in by_hand:
                if track.point_id in by_hand:
                    back.append(by_hand.pop(track.point_id))
            elif (track.number, track.cut.kind) not in moved and stands(track.number, track.position):
                back.append(track)
        self._tracks = [*back, *by_hand.values()]
        shown = {track.point_id: track.shown for track in self._tracks if track.shown is not None}
        for name, track in now.items():
            if track.shown is None:
                continue
            kept = shown.get(name)
            if kept is None:
                self._former[name] = track.shown
            elif kept.revision < track.shown.revision:
                self._spent[name] = max(track.shown.revision, self._spent.get(name, 0))

    def update(
        self,
        view: View,
        labels: NDArray[np.uint8],
        proposals: list[Proposal],
        looks: Mapping[SpurNumber, int] = MappingProxyType({}),
    ) -> Tracked:
        """Take one frame in.

        Args:
            view: The frame.
            labels: Its classes.
            proposals: Cuts that it proposes.
            looks: At each spur so far.
        """
        supported = self._associate(proposals)
        contradicted: dict[tuple[SpurNumber, CutKind], int] = {}
        for track in supported:
            place = track.number, track.cut.kind
            contradicted[place] = max(contradicted.get(place, 0), track.hits)
        withdrawn: list[str] = []
        keep = []
        known = {id(track) for track in supported}
        for track in self._tracks:
            reason = None if id(track) in known else self._doubt(track, view, labels, contradicted)
            if reason is None:
                keep.append(track)
                continue
            if track.shown is not None:
                self._former[track.point_id] = track.shown
                if reason:
                    withdrawn.append(f"{track.point_id} (vine {track.number.vine}, spur {track.number.spur}) {reason}")
        before, self._tracks = self._tracks, keep
        self._show(supported, looks)
        kept = {id(track) for track in keep}
        severed = tuple(t.position for t in before if id(t) not in kept and t.gone >= self._config.gone)
        return Tracked(self.points(), tuple(withdrawn), severed)

    def add(self, proposal: Proposal) -> m.PruningPoint:
        """Show a cut at once that needs no second look, since a person placed it."""
        cut = proposal.cut
        self._named += 1
        track = _Track(f"p{self._named}", proposal.number, cut, cut.position, cut.tangent, cut.radius)
        track.shown = self._message(track)
        self._tracks.append(track)
        return track.shown

    def move(self, point_id: str, cut: Cut) -> m.PruningPoint:
        """Put a shown point where a person wants it. Its spur gets no other cut of the kind that it was.

        Args:
            point_id: Of the point; it must be shown.
            cut: By hand.
        """
        old = next(track for track in self._tracks if track.point_id == point_id)
        track = _Track(point_id, old.number, cut, cut.position, cut.tangent, cut.radius)
        track.instead_of = old.instead_of or old.cut.kind
        shown = self._message(track)
        last = 0 if old.shown is None else old.shown.revision
        revised = replace(shown, revision=1 + max(last, self._spent.get(point_id, 0)))
        track.shown = replace(revised, digest=point_digest(revised))
        self._tracks[self._tracks.index(old)] = track
        return track.shown

    def restart(self, proposals: list[Proposal]) -> None:
        """Show these, and what persons placed, instead of all else: the rule has changed, the vines have not.

        The cut of a spur keeps its name; where it changes, it has a new revision.
        """
        old = [track for track in self._tracks if track.cut.kind != "by hand"]
        self._tracks = [track for track in self._tracks if track.cut.kind == "by hand"]
        for proposal in proposals:
            cut = proposal.cut
            place = (proposal.number, cut.kind)
            if place in self._moved():
                continue
            same = [track for track in old if track.shown is not None and (track.number, track.cut.kind) == place]
            if not same:
                self.add(proposal)
                continue
            track = min(same, key=lambda each: float(np.linalg.norm(each.position - cut.position)))
            old.remove(track)
            if float(np.linalg.norm(track.position - cut.position)) < self._config.moved:
                # Where it was: what its looks have told stays.
                track.cut = cut
            else:
                shown = track.shown
                track = _Track(track.point_id, proposal.number, cut, cut.position, cut.tangent, cut.radius, shown=shown)
            track.shown = self._message(track)
            self._tracks.append(track)

    def ever(self, point_id: str) -> m.PruningPoint | None:
        """A point that is shown or was, as it was shown last; None when there was none of this name."""
        shown = (track.shown for track in self._tracks if track.point_id == point_id)
        return next(shown, None) or self._former.get(point_id)

    def refine(self, point_id: str, position: Array, tangent: Array) -> None:
        """A close look has shown better where a point is; it counts like all looks that are remembered.

        Args:
            point_id: Of a point shown; of any other nothing is known better.
            position: On the axis (3, m, odom).
            tangent: Unit vector along the cane (3, odom).
        """
        for track in self._tracks:
            if track.point_id == point_id and track.shown is not None:
                track.position, track.tangent = position, tangent
                track.hits, track.misses, track.gone = max(track.hits, self._config.memory), 0, 0
                track.shown = self._message(track)

    def points(self) -> tuple[m.PruningPoint, ...]:
        """The points shown, in the order in which they were first seen."""
        return tuple(track.shown for track in self._tracks if track.shown is not None)

    def shown(self) -> tuple[Proposal, ...]:
        """The cuts behind these points, each where the point is."""
        return tuple(
            Proposal(dataclasses.replace(t.cut, position=np.array(t.shown.position)), t.number)
            for t in self._tracks
            if t.shown is not None
        )

    def _associate(self, proposals: list[Proposal]) -> list[_Track]:
        """Each proposal joins the nearest track of its kind, or starts one; returns the tracks supported."""
        known = list(self._tracks)
        places = np.array([track.position for track in known]).reshape(-1, 3)
        cuts = np.array([proposal.cut.position for proposal in proposals]).reshape(-1, 3)
        # Most points are far from everything that a frame shows.
        close = np.argwhere(np.linalg.norm(places[:, None] - cuts, axis=2) <= self._config.association)
        pairs = sorted(
            (float(np.linalg.norm(known[t].position - proposals[p].cut.position)), t, p)
            for t, p in close.tolist()
            if known[t].cut.kind == proposals[p].cut.kind
        )
        supported: list[_Track] = []
        used: set[int] = set()
        for distance, t, p in pairs:
            if distance > self._config.association:
                break
            if p not in used and known[t] not in supported:
                used.add(p)
                known[t].add(proposals[p].cut, self._config.memory)
                supported.append(known[t])
        for p, proposal in enumerate(proposals):
            if p not in used:
                cut = proposal.cut
                self._named += 1
                track = _Track(f"p{self._named}", proposal.number, cut, cut.position, cut.tangent, cut.radius)
                self._tracks.append(track)
                supported.append(track)
        return supported

    def _doubt(
        self, track: _Track, view: View, labels: NDArray[np.uint8], contradicted: dict[tuple[SpurNumber, CutKind], int]
    ) -> str | None:
        """Why a point that this frame did not propose is withdrawn; None to keep it, empty to drop it in silence.

        `contradicted` says how many frames have proposed what this one proposes, by spur and kind.
        """
        # Whether the wood just beyond the cut is still there.
        look = glance(view, labels, track.position + self._config.probe * track.tangent)
        if look == "unseen":
            return None
        track.gone = track.gone + 1 if look == "gone" else 0
        if track.gone >= self._config.gone:
            return f"withdrawn: the wood beyond it was gone in {track.gone} frames, so it has been cut"
        against = contradicted.get((track.number, track.cut.kind), 0)
        if track.shown is None or against:
            track.misses += 1
            outvoted = track.shown is not None and against > max(track.hits, self._config.hits - 1)
            if outvoted or track.misses >= (_PATIENCE if track.shown is not None else _MEMORY_OF_UNSHOWN):
                return "withdrawn: closer looks put the cut elsewhere on this spur" if track.shown is not None else ""
        return None

    def _show(self, supported: list[_Track], looks: Mapping[SpurNumber, int]) -> None:
        places = Counter((track.number, track.cut.kind) for track in self._tracks)
        taken = {(track.number, track.cut.kind) for track in self._tracks if track.shown is not None} | self._moved()
        for track in self._tracks:
            place = (track.number, track.cut.kind)
            if track.shown is None:
                often = looks.get(track.number, 0) >= self._config.sparse_looks and places[place] == 1
                if place in taken or track.hits < (self._config.sparse_hits if often else self._config.hits):
                    continue
            elif track not in supported:
                continue
            taken.add(place)
            track.shown = self._message(track)

    def _moved(self) -> set[tuple[SpurNumber, CutKind]]:
        """Spurs' cuts that a person has moved: the rule gives no others in their place."""
        return {(track.number, track.instead_of) for track in self._tracks if track.instead_of is not None}

    def _message(self, track: _Track) -> m.PruningPoint:
        """The wire form; what is cut and where changes only together with the revision."""
        old, cut = track.shown, track.cut
        looks = min(track.hits, self._config.memory)
        point = m.PruningPoint(
            point_id=track.point_id,
            revision=1,
            position=_vector(track.position),
            tangent=_vector(track.tangent),
            radius=float(track.radius),
            confidence=cut.confidence,
            nodes_seen=min(cut.nodes_seen, 100),
            nodes_kept=min(cut.nodes_kept, 100),
            vine=track.number.vine,
            spur=track.number.spur,
            reason=cut.reason[:500],
            kind=cut.kind,
            position_covariance=_symmetric(uncertainty.of_place(track.scatter, looks)),
            tangent_covariance=_symmetric(uncertainty.of_direction(track.turns, looks, track.tangent)),
            offset=cut.offset,
            force=cutting_force(float(track.radius)),
            node_distance=cut.node_distance,
        )
        if old is not None:
            same = self._same_cut(old, point)
            point = replace(
                point,
                # No revision comes twice, so that one has one content.
                revision=old.revision if same else 1 + max(old.revision, self._spent.get(track.point_id, 0)),
                position=old.position if same else point.position,
                tangent=old.tangent if same else point.tangent,
            )
        return replace(point, digest=point_digest(point))

    def _same_cut(self, old: m.PruningPoint, new: m.PruningPoint) -> bool:
        moved = float(np.linalg.norm(np.subtract(new.position, old.position)))
        turned = float(np.arccos(np.clip(np.dot(new.tangent, old.tangent), -1.0, 1.0)))
        counts = (new.kind, new.nodes_kept, new.vine, new.spur) == (old.kind, old.nodes_kept, old.vine, old.spur)
        # What it says of its place along the cane holds for where it is.
        slid = abs((new.offset or 0.0) - (old.offset or 0.0))
        return counts and moved <= self._config.moved and turned <= self._config.turned and slid < _SAME_OFFSET


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _symmetric(matrix: Array) -> m.Covariance:
    """The upper triangle of a symmetric 3×3, to four digits."""
    a, b, c, d, e, f = (float(f"{value:.4g}") for value in matrix[np.triu_indices(3)])
    return a, b, c, d, e, f
