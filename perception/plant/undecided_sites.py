"""Spurs without a pruning point: the reason, and whether another look may help or only an operator."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from perception.plant.numbering import SpurNumber
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.types import CutKind

#: Kinds of cuts that are on no cane that stays.
BESIDE_CANES: tuple[CutKind, ...] = ("renewal cut", "removal")
#: Observations from the front after which another look is not expected to help.
_MAX_OBSERVATIONS = 12
#: Codes of the reasons that another look may resolve.
_LOOK_AGAIN = frozenset(
    made.code
    for made in (
        reasons.no_cane_followed(),
        reasons.cane_base_hidden(),
        reasons.nodes_lacking(0, 0),
        reasons.beyond_node_hidden(0),
        reasons.cut_place_hidden(),
        reasons.node_may_be_hidden(),
        reasons.nodes_far_apart(),
        reasons.stub_unclear(),
        reasons.spur_at_image_edge(),
        reasons.stray_cane_hidden(),
        reasons.no_cordon_in_range(0, 0),
        reasons.cut_unconfirmed(),
        reasons.old_cane_unseen(),
    )
)


def needs_of(reason: m.Reason) -> m.Need:
    """Whether another look may resolve a reason, or its cause; any other reason is for an operator."""
    causes = [value for _, value in reason.values if isinstance(value, m.Reason)]
    again = reason.code in _LOOK_AGAIN or any(needs_of(cause) == "another look" for cause in causes)
    return "another look" if again else "operator"


def undecided_site(
    reason: m.Reason, number: SpurNumber | None = None, position: m.Vector3 | None = None
) -> m.UndecidedSite:
    """The message of a reason.

    Args:
        reason: Why it is undecided.
        number: Of the spur; None where it is about no spur in particular.
        position: Of the spur (m, odom).
    """
    return m.UndecidedSite(
        reason=reason,
        needs=needs_of(reason),
        vine=0 if number is None else number.vine,
        spur=0 if number is None else number.spur,
        position=position,
    )


#: Why a spur is undecided, each with the kinds of cut that it is against; none where it is about the whole spur.
Causes = Sequence[tuple[frozenset[CutKind], m.Reason]]


@dataclass(frozen=True)
class _Site:
    has_cuts: bool
    messages: tuple[tuple[frozenset[CutKind], m.UndecidedSite], ...]
    in_front: bool


#: Code of a reason and those of its causes.
_Kind = tuple[str, ...]


def _kind(reason: m.Reason) -> _Kind:
    causes = (value for _, value in reason.values if isinstance(value, m.Reason))
    return (reason.code, *(code for cause in causes for code in _kind(cause)))


class UndecidedSites:
    """Newest reasons of each undecided spur, over all frames, and which of them an operator has left as they are."""

    def __init__(self) -> None:
        """Start without any."""
        self._sites: dict[SpurNumber, _Site] = {}
        self._observations: dict[SpurNumber, int] = {}
        self._left: dict[SpurNumber, frozenset[_Kind]] = {}

    def clear(self) -> None:
        """Drop all reasons, after a change of the rule."""
        self._sites.clear()
        self._left.clear()

    def leave(self, number: SpurNumber, left: bool) -> bool:
        """Leave a spur as it is for its present reasons, or take that back; False where nothing is undecided."""
        site = self._sites.get(number)
        if site is None:
            return False
        self._left.pop(number, None)
        if left:
            self._left[number] = frozenset(_kind(each.reason) for _, each in site.messages)
        return True

    def update(
        self,
        number: SpurNumber,
        has_cuts: bool,
        causes: Causes,
        position: m.Vector3 | None = None,
        in_front: bool = True,
    ) -> None:
        """Replace the reasons of a spur.

        Args:
            number: Of the spur.
            has_cuts: Whether cuts of canes are proposed there as well.
            causes: Why it is undecided; without any the site is closed.
            position: Of the spur (m, odom).
            in_front: Whether the camera is in front of it. Other views do not overrule one from the front.
        """
        if in_front:
            self._observations[number] = self._observations.get(number, 0) + 1
        known = self._sites.get(number)
        if not causes:
            self._sites.pop(number, None)
        elif in_front or known is None or not known.in_front:
            messages = tuple((against, undecided_site(reason, number, position)) for against, reason in causes)
            self._sites[number] = _Site(has_cuts, messages, in_front)

    def remaining(self, points: Iterable[m.PruningPoint]) -> tuple[m.UndecidedSite, ...]:
        """All reasons in order of the spurs, without those that points have settled.

        One picture may not show what others have shown: where a cut has a point, a reason against it is none. Where a
        cane has a point, reasons about a whole spur without cuts are none either.

        Args:
            points: All published ones.
        """
        settled = {(SpurNumber(point.vine, point.spur), point.kind) for point in points}
        with_points = {number for number, kind in settled if kind not in BESIDE_CANES}
        # Of two canes one has its point, and the other one may lack it.
        half_done = {number for number, kind in settled if kind in ("spur cut", "cane cut")}
        return tuple(
            self._with_need(each, number)
            for number, site in sorted(self._sites.items())
            for against, each in site.messages
            if site.has_cuts or number not in with_points or (against and number in half_done)
            if not against or any((number, kind) not in settled for kind in against)
        )

    def _with_need(self, site: m.UndecidedSite, number: SpurNumber) -> m.UndecidedSite:
        """Passed on to an operator after enough observations, and settled once one has left it."""
        if _kind(site.reason) in self._left.get(number, ()):
            return replace(site, needs="nothing")
        observations = self._observations.get(number, 0)
        if site.needs != "another look" or observations < _MAX_OBSERVATIONS:
            return site
        return replace(site, needs="operator", reason=reasons.looks_exhausted(site.reason, observations))
