"""Handlers of the operators' decisions about points."""

from controller.ledger.journal import EventLogger
from controller.work.point_queue import PointQueue
from rolling_panda import commands as intents
from rolling_panda.commands import Handler, Handlers


class QueueRequests:
    """Decisions about points; each ends with the queue in order."""

    def __init__(self, queue: PointQueue, event_log: EventLogger) -> None:
        """Bind the queue and the log."""
        self._queue, self._event_log = queue, event_log

    def handlers(self) -> Handlers:
        """Handler of each decision; it returns the reason of a refusal, empty if done."""
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
        return lambda asked, now: handler(asked, now) or self._queue.sort()

    def _accept_all(self, asked: intents.AcceptAll) -> str:
        points = self._queue.proposed(asked.confidence)
        refusals = [self._queue.accept(point.point_id, point.revision, asked.user, point.digest) for point in points]
        accepted = refusals.count("")
        if accepted:
            counted = "1 point" if accepted == 1 else f"{accepted} points"
            self._event_log.say(
                "info", f"{asked.user}: accepted {counted} of confidence {asked.confidence:.2f} and more"
            )
            return ""
        if not points:
            return f"no proposed point has a confidence of {asked.confidence:.2f} or more"
        return "; ".join(refusals)
