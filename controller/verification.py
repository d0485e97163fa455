"""How a cut ended: what the cutter reports and what a look afterwards shows, put together honestly.

The cutter knows whether the blades met something, the camera whether the wood beyond is gone. Where both say that the
point stands, it is cut once more; where they contradict each other, a person decides.
"""

from dataclasses import dataclass

from controller.eye import Eye
from controller.queue import PointQueue
from rolling_panda.messages import Outcome, PointState, PruningPoint

#: An ended cut that no look is begun for within this time (s) ends by the cutter's word.
_LOOK_WITHIN_S = 4.0


@dataclass
class _Ended:
    """A cut that ended: the cutter's word, since when, and whether a look has begun."""

    outcome: Outcome
    word: str
    since: float
    looking: bool = False


class Verification:
    """Settles cuts whose outcome the cutter knows. Pure but for the queue: time is an argument."""

    def __init__(self, queue: PointQueue, eye: Eye, looks: bool) -> None:
        """Bind the parts.

        Args:
            queue: Takes the result.
            eye: Looks.
            looks: False takes the cutter's word for it at once.
        """
        self._queue, self._eye, self._looks = queue, eye, looks
        self._ended: dict[str, _Ended] = {}
        self._tried: dict[str, PruningPoint | None] = {}

    @property
    def pending(self) -> bool:
        """Whether a cut is still to be settled."""
        return bool(self._ended)

    def begin(self, point_id: str, outcome: Outcome, word: str, now: float) -> None:
        """The cutter has said how a cut ended: DONE or FAILED_NOT_CUT; UNKNOWN is settled with that."""
        if not self._looks or outcome == "UNKNOWN":
            self._end(point_id, outcome or "UNKNOWN", word)
            return
        self._ended[point_id] = _Ended(outcome, word, now)

    def look(self, point_id: str, now: float) -> None:
        """The camera sees the place now; begins one look."""
        ended = self._ended.get(point_id)
        if ended is not None and not ended.looking:
            ended.looking = True
            self._eye.ask(point_id, "severed", now)

    def step(self, now: float) -> list[str]:
        """Settle what can be settled; what became of it, in words."""
        said = []
        for point_id, ended in list(self._ended.items()):
            look = self._eye.answer(point_id, now) if ended.looking else None
            if look is not None:
                said.append(self._settle(point_id, ended, look.finding, look.reason))
            elif not ended.looking and now - ended.since > _LOOK_WITHIN_S:
                said.append(self._settle(point_id, ended, "unseen", "the robot left before it was looked at"))
        return said

    def _settle(self, point_id: str, ended: _Ended, finding: str, reason: str) -> str:
        del self._ended[point_id]
        self._eye.forget(point_id)
        done = ended.outcome == "DONE"
        if finding == "severed":
            if done:
                return self._end(point_id, "DONE", "cut, and seen to be off")
            return self._end(point_id, "UNKNOWN", f"{ended.word}, but the wood beyond is gone: look")
        if finding == "unseen":
            return self._end(point_id, ended.outcome or "UNKNOWN", f"{ended.word}; not seen afterwards: {reason}")
        ticket = self._queue.get(point_id)
        accepted = None if ticket is None else ticket.accepted
        if self._tried.get(point_id) is None or self._tried[point_id] is not accepted:
            self._tried[point_id] = accepted
            self._queue.again(point_id, f"{ended.word}, but it is seen to stand: cut once more")
            return f"{point_id}: {ended.word}, but it is seen to stand: it is cut once more"
        if done:
            return self._end(point_id, "UNKNOWN", f"{ended.word} twice, but it is seen to stand: look")
        return self._end(point_id, "FAILED_NOT_CUT", f"{ended.word} twice, and it is seen to stand")

    def _end(self, point_id: str, state: PointState, reason: str) -> str:
        self._tried.pop(point_id, None)
        self._queue.resolve(point_id, state, reason)
        return f"{point_id}: {reason}"
