"""Failed tries of a cut, so that the next one takes another approach."""

from msgspec import Struct

from rolling_panda.messages.types import Vector3

#: Turn about the cane, tilt out of the plane square to it, and lean of the blades about the approach (rad).
Approach = tuple[float, float, float]
#: Both ends of an axis (m).
Line = tuple[Vector3, Vector3]


class Tried(Struct, frozen=True):
    """A try that ended before the blades closed.

    Attributes:
        approach: From where it was; None where no picture came, which another approach does not help.
        cane: Axis of the cane that was met (m, map); None where the cut was not reached for another reason.
    """

    approach: Approach | None
    cane: Line | None = None


#: Points with their tries, by id.
Made = tuple[tuple[str, tuple[Tried, ...]], ...]


class Tries:
    """Failed tries of each point, of the acceptance in force."""

    def __init__(self) -> None:
        """Begin without any."""
        self._made: dict[str, tuple[Tried, ...]] = {}
        self._told: Made = ()

    @property
    def made(self) -> Made:
        """Points with their tries, by id; the same object until one changes."""
        return self._told

    def of(self, point_id: str) -> tuple[Tried, ...]:
        """Tries of a point, the first one first."""
        return self._made.get(point_id, ())

    def put(self, point_id: str, tries: tuple[Tried, ...]) -> None:
        """Replace the tries of a point; none forgets them."""
        if tries == self.of(point_id):
            return
        self._made = {name: made for name, made in self._made.items() if name != point_id}
        if tries:
            self._made[point_id] = tries
        self._told = tuple(sorted(self._made.items(), key=lambda each: each[0]))
