"""Places without a point: why, and whether another look may help or only a person."""

from dataclasses import dataclass

from msgspec.structs import replace

from perception.plant.numbering import SpurNumber
from rolling_panda import messages as m

#: After so many looks from before a place another one would show no more.
_ENOUGH = 12


class MoreToSee(str):
    """A reason for leaving a place alone that another look may take away. Any other reason is for a person."""

    __slots__ = ()


def abstention(reason: str, number: SpurNumber | None = None, position: m.Vector3 | None = None) -> m.Abstention:
    """The wire form of a reason.

    Args:
        reason: In words; a `MoreToSee` asks for another look.
        number: Of the spur, None where it is about no spur in particular.
        position: Of the spur (m, odom).
    """
    return m.Abstention(
        reason=reason[:500],
        needs="another look" if isinstance(reason, MoreToSee) else "operator",
        vine=0 if number is None else number.vine,
        spur=0 if number is None else number.spur,
        position=position,
    )


@dataclass(frozen=True)
class _Open:
    """What was said of a spur: whether it has a cut all the same, what is open, and whether that was from before it."""

    cuts: bool
    said: tuple[m.Abstention, ...]
    before: bool


class OpenPlaces:
    """What was said last of each spur that something was left open at, over all frames."""

    def __init__(self) -> None:
        """Nothing is open."""
        self._open: dict[SpurNumber, _Open] = {}
        self._looks: dict[SpurNumber, int] = {}

    def clear(self) -> None:
        """Forget everything: the rule has changed."""
        self._open.clear()

    def note(
        self,
        number: SpurNumber,
        cuts: bool,
        reasons: list[str],
        position: m.Vector3 | None = None,
        before: bool = True,
    ) -> None:
        """Say what is open at a spur from now on.

        Args:
            number: Of the spur.
            cuts: Whether a cut is proposed there all the same.
            reasons: None closes it.
            position: Of the spur (m, odom).
            before: Whether the camera was before it. What was seen from there is not taken back from aside.
        """
        if before:
            self._looks[number] = self._looks.get(number, 0) + 1
        if not reasons:
            self._open.pop(number, None)
            return
        known = self._open.get(number)
        if before or known is None or not known.before:
            said = tuple(abstention(reason, number, position) for reason in reasons)
            self._open[number] = _Open(cuts, said, before)

    def told(self, shown: set[SpurNumber]) -> tuple[m.Abstention, ...]:
        """Everything open, vine by vine; a look that saw too little takes nothing back at a spur that has a point."""
        places = sorted(self._open.items(), key=lambda place: (place[0].vine, place[0].spur))
        return tuple(
            self._decided(each, self._looks.get(number, 0))
            for number, place in places
            if place.cuts or number not in shown
            for each in place.said
        )

    def _decided(self, place: m.Abstention, looks: int) -> m.Abstention:
        """Where looks enough have not helped, it is for a person."""
        if place.needs != "another look" or looks < _ENOUGH:
            return place
        reason = f"{place.reason}; {looks} looks from before it have not shown more: look yourself"
        return replace(place, needs="operator", reason=reason[:500])
