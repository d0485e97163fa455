"""From where people want cuts to be made: the turn of the approach about the cane, where somebody has said one."""

import math

from controller.journal import ApproachRow, Journal

#: Beyond this the tool would come along the row or from behind it (rad).
LARGEST = math.radians(75.0)


class Approaches:
    """Kept by point; without a word about a point the search chooses."""

    def __init__(self, journal: Journal) -> None:
        """Nobody has said anything; what they will is recorded in `journal`."""
        self._journal = journal
        self._turned: dict[str, float] = {}
        self._told: tuple[tuple[str, float], ...] = ()

    @property
    def turned(self) -> tuple[tuple[str, float], ...]:
        """Points and turns (rad), by id; the same object until one changes."""
        return self._told

    def of(self, point_id: str) -> float | None:
        """Turn about the cane that is wanted for a point (rad); None leaves it to the search."""
        return self._turned.get(point_id)

    def restore(self, rows: tuple[tuple[str, ApproachRow], ...]) -> None:
        """Take up what was said before a restart."""
        for point_id, row in rows:
            self._put(point_id, row.azimuth)

    def turn(self, point_id: str, azimuth: float | None, user: str) -> str:
        """Approach a point so from now on; returns why not, empty when done."""
        if azimuth is not None and not abs(azimuth) <= LARGEST:
            return (
                f"the approach cannot be turned by {math.degrees(azimuth):.0f}°; at most {math.degrees(LARGEST):.0f}°"
            )
        self._put(point_id, azimuth)
        self._journal.add("approach", point_id, ApproachRow(azimuth=azimuth, user=user))
        return ""

    def _put(self, point_id: str, azimuth: float | None) -> None:
        if azimuth is None:
            self._turned.pop(point_id, None)
        else:
            self._turned[point_id] = azimuth
        self._told = tuple(sorted(self._turned.items()))
