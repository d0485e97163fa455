"""Places without a point: why, and whether another look may help or only a person."""

from perception.numbering import SpurNumber
from rolling_panda import messages as m


class MoreToSee(str):
    """A reason for leaving a place alone that another look may take away. Any other reason is for a person."""

    __slots__ = ()


def abstention(reason: str, number: SpurNumber | None = None) -> m.Abstention:
    """The wire form of a reason.

    Args:
        reason: In words; a `MoreToSee` asks for another look.
        number: Of the spur, None where it is about no spur in particular.
    """
    return m.Abstention(
        reason=reason[:500],
        needs="another look" if isinstance(reason, MoreToSee) else "operator",
        vine=0 if number is None else number.vine,
        spur=0 if number is None else number.spur,
    )


class OpenPlaces:
    """What was said last of each spur that something was left open at, over all frames."""

    def __init__(self) -> None:
        """Nothing is open."""
        self._open: dict[SpurNumber, tuple[bool, tuple[m.Abstention, ...]]] = {}

    def clear(self) -> None:
        """Forget everything: the rule has changed."""
        self._open.clear()

    def note(self, number: SpurNumber, cuts: bool, reasons: list[str]) -> None:
        """Say what is open at a spur from now on.

        Args:
            number: Of the spur.
            cuts: Whether a cut is proposed there all the same.
            reasons: None closes it.
        """
        if reasons:
            self._open[number] = cuts, tuple(abstention(reason, number) for reason in reasons)
        else:
            self._open.pop(number, None)

    def told(self, shown: set[SpurNumber]) -> tuple[m.Abstention, ...]:
        """Everything open, vine by vine; a look that saw too little takes nothing back at a spur that has a point."""
        places = sorted(self._open.items(), key=lambda place: (place[0].vine, place[0].spur))
        return tuple(each for number, (cuts, said) in places if cuts or number not in shown for each in said)
