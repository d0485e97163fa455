"""What has been decided is told once the ledger holds it."""

from collections import deque

from controller.ledger.journal import LedgerState
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.transport.inbox import Reply

#: Time limit of a record; after it the answer is "not recorded" (s).
_PATIENCE_S = 0.6


class CommitBarrier:
    """Queue of messages that wait for their records to be durable, in the order of the records. No clock."""

    def __init__(self) -> None:
        """Start with nothing to say."""
        self._waiting: deque[tuple[int, float, object]] = deque()

    def hold(self, number: int, now: float, message: object) -> None:
        """Keep a message until all records up to `number` are durable."""
        self._waiting.append((number, now, message))

    def settle(self, ledger: LedgerState, now: float) -> list[object]:
        """The messages whose records are durable. A reply without a record becomes a refusal with the cause."""
        out = []
        while self._waiting:
            number, since, message = self._waiting[0]
            why = None
            if number > ledger.durable:
                if ledger.failure is not None:
                    why = ledger.failure
                elif now - since > _PATIENCE_S:
                    why = reasons.ledger_silent(now - since)
                else:
                    break
            self._waiting.popleft()
            out.append(message if why is None else _unrecorded(message, reasons.decision_unrecorded(why)))
        return out


def _unrecorded(message: object, why: m.Reason) -> object:
    if not isinstance(message, Reply) or message.answer is None or not message.answer.ok:
        return message
    return Reply(message.request, m.Answer(ok=False, reason=why))
