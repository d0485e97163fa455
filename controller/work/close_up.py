"""Requests for close-up pictures of points, and their results."""

import math
from dataclasses import dataclass

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CloseUpResult, Finding

#: A request is repeated this often until its picture has come (s).
_REPEAT_S = 0.05
#: A picture without a result after this time (s) counts as lost and is requested again.
_LOST_S = 1.5


@dataclass
class _Asked:
    """A close-up in progress: expected finding, newest request, first request that counts, retries left."""

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
        """Start without requests.

        Args:
            timeout_s: Time limit of one close-up, retries included (s).
            pictures: Largest number of pictures of one close-up. Another one is taken if the last did not show
                what was expected.
        """
        self._timeout_s, self._pictures = timeout_s, pictures
        self._asked: dict[str, _Asked] = {}
        self._number = 0
        #: Time from the request to the result, of the last picture that came (s).
        self.took_s = 0.5

    def ask(self, point_id: str, expected: Finding, now: float) -> None:
        """Request a close-up of a point. A result that is not as expected is checked with another picture."""
        self._number += 1
        self._asked[point_id] = _Asked(expected, self._number, self._number, self._pictures - 1, now, now)

    def forget(self, point_id: str) -> None:
        """Drop the close-up of this point."""
        self._asked.pop(point_id, None)

    def update(self, result: CloseUpResult, now: float) -> None:
        """Take in the result of a picture. One that was not requested changes nothing."""
        asked = self._asked.get(result.point_id)
        # A late result counts too: on a slow machine each picture is late.
        if asked is None or not asked.first <= result.number <= asked.number or asked.answer is not None:
            return
        if result.finding != asked.expected and asked.more > 0:
            asked.more -= 1
            self._again(asked, now)
            asked.first = asked.number
        else:
            asked.answer, self.took_s = result, now - asked.since

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
        """The result for a point; None while it is pending, and where none was requested."""
        asked = self._asked.get(point_id)
        if asked is None:
            return None
        if asked.answer is None and now - asked.begun > self._timeout_s:
            asked.answer = CloseUpResult(
                header=m.Header(),
                point_id=point_id,
                number=asked.number,
                finding="unseen",
                reason=reasons.no_close_up(self._timeout_s),
            )
        return asked.answer

    def _again(self, asked: _Asked, now: float) -> None:
        self._number += 1
        asked.number, asked.since, asked.sent_at = self._number, now, -math.inf
