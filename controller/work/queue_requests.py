"""Handlers of the operators' decisions about points."""

from typing import Any

from controller.ledger.journal import EventLogger
from controller.work.point_queue import PointQueue
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.commands import Handler, Handlers
from rolling_panda.messages.types import Reason


class QueueRequests:
    """Decisions about points; each ends with the queue in order."""

    def __init__(self, queue: PointQueue, event_log: EventLogger) -> None:
        """Bind the queue and the log."""
        self._queue, self._event_log = queue, event_log

    def handlers(self) -> Handlers:
        """Handler of each decision; it returns the reason of a refusal, None if done."""
        queue = self._queue
        decide: Handlers = {
            intents.AcceptPoint: lambda asked, _: queue.accept(
                asked.point_id, asked.revision, asked.user, asked.digest
            ),
            intents.RejectPoint: lambda asked, _: queue.reject(asked.point_id, asked.user, asked.reason),
            intents.ReconsiderPoint: lambda asked, _: queue.reconsider(asked.point_id, asked.user),
            intents.RestoreAccepted: lambda asked, _: queue.undo_rule(asked.rule),
            intents.ResolvePoint: lambda asked, _: queue.decide(
                asked.point_id, asked.outcome, asked.user, asked.reason
            ),
            intents.AcceptAll: lambda asked, _: self._accept_all(asked),
            intents.MoveInQueue: lambda asked, _: queue.move(asked.point_id, asked.before, asked.revision, asked.user),
            intents.SetApproach: lambda asked, _: queue.turn(asked.point_id, asked.azimuth, asked.user),
            intents.ResetOrder: lambda asked, _: queue.order.give_back(asked.revision),
        }
        return {message: self._sorted(handler) for message, handler in decide.items()}

    def _sorted(self, handler: Handler) -> Handler:
        def handle(asked: Any, now: float) -> Reason | None:
            refused = handler(asked, now)
            self._queue.sort()
            return refused

        return handle

    def _accept_all(self, asked: intents.AcceptAll) -> Reason | None:
        if (refused := self._queue.none_acceptable(asked.confidence)) is not None:
            return refused
        points = self._queue.proposed(asked.confidence)
        answers = [self._queue.accept(point.point_id, point.revision, asked.user, point.digest) for point in points]
        self._event_log.log(reasons.points_accepted(asked.user, answers.count(None), asked.confidence))
        return None
