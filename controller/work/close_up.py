"""Requests for close-up pictures of points, and their results."""

import math
from dataclasses import dataclass

from rolling_panda import messages as m
from rolling_panda.messages.perception import CloseUpResult, Finding

#: A request is repeated this often until its picture has come (s).
_REPEAT_S = 0.05
#: A picture without a result after this time (s) counts as lost and is requested again.
_LOST_S = 1.5


@dataclass
class _Asked:
    """A look under way: what it should show, the newest request and the first that counts, how many more may follow."""

    expected: Finding
    number: int
    first: int
    more: int
    begun: float
    since: float
    sent_at: float = -math.inf
    answer: CloseUpResult | None = None


class CloseUpClient:
    """Requests close-up pictures, several points at a time. The newest request for a point counts."""

    def __init__(self, timeout_s: float, pictures: int) -> None:
        """Look at nothing.

        Args:
            timeout_s: A look ends after this time, whatever has come (s).
            pictures: Of one look at most that come; another one is taken where the last
                did not show what was expected.
        """
        self._timeout_s, self._pictures = timeout_s, pictures
        self._asked: dict[str, _Asked] = {}
        self._number = 0
        #: From asking for the last picture that came to knowing what it showed (s).
        self.took_s = 0.5

    def ask(self, point_id: str, expected: Finding, now: float) -> None:
        """Look at a point from now on; what is not as expected is looked at once more before it is believed."""
        self._number += 1
        self._asked[point_id] = _Asked(expected, self._number, self._number, self._pictures - 1, now, now)

    def forget(self, point_id: str) -> None:
        """What a look at this point shows is not wanted any more."""
        self._asked.pop(point_id, None)

    def take(self, look: CloseUpResult, now: float) -> None:
        """What a picture shows; one that nobody waits for changes nothing."""
        asked = self._asked.get(look.point_id)
        # One that was taken for lost may be late: on a slow machine each of them is.
        if asked is None or not asked.first <= look.number <= asked.number or asked.answer is not None:
            return
        if look.finding != asked.expected and asked.more > 0:
            asked.more -= 1
            self._again(asked, now)
            asked.first = asked.number
        else:
            asked.answer, self.took_s = look, now - asked.since

    def due(self, now: float) -> tuple[int, str] | None:
        """Number and point of the request to send in this period; None when none is due."""
        for point_id, asked in self._asked.items():
            if asked.answer is None and now - asked.since > _LOST_S:
                self._again(asked, now)
            if asked.answer is None and now - asked.sent_at >= _REPEAT_S:
                asked.sent_at = now
                return asked.number, point_id
        return None

    def answer(self, point_id: str, now: float) -> CloseUpResult | None:
        """What the look at a point came to; None while it goes on or where there is none."""
        asked = self._asked.get(point_id)
        if asked is None:
            return None
        if asked.answer is None and now - asked.begun > self._timeout_s:
            reason = f"no picture of it came within {self._timeout_s:g} s"
            asked.answer = CloseUpResult(
                header=m.Header(), point_id=point_id, number=asked.number, finding="unseen", reason=reason
            )
        return asked.answer

    def _again(self, asked: _Asked, now: float) -> None:
        self._number += 1
        asked.number, asked.since, asked.sent_at = self._number, now, -math.inf
