"""Operator requests to the queue and their log texts."""

import math

from controller.work.point_queue import PointQueue
from controller.work.survey import open_place
from rolling_panda.messages import commands as intents


class QueueRequests:
    """Decisions about points."""

    def __init__(self, queue: PointQueue) -> None:
        """Bind the queue."""
        self._queue = queue
        self._accepted = 0

    def points(self, intent: intents.Intent) -> str:
        """Decide; returns why not, empty when done."""
        return self._decide(intent) or self._queue.sort()

    def _decide(self, intent: intents.Intent) -> str:
        if isinstance(intent, intents.AcceptPoint):
            return self._queue.accept(intent.point_id, intent.revision, intent.user, intent.digest)
        if isinstance(intent, intents.RejectPoint):
            return self._queue.reject(intent.point_id, intent.user, intent.reason)
        if isinstance(intent, intents.ReconsiderPoint):
            return self._queue.reconsider(intent.point_id, intent.user)
        if isinstance(intent, intents.RestoreAccepted):
            return self._queue.undo_rule(intent.rule)
        if isinstance(intent, intents.ResolvePoint):
            return self._queue.decide(intent.point_id, intent.outcome, intent.user, intent.reason)
        if isinstance(intent, intents.AcceptAll):
            return self._accept_all(intent)
        if isinstance(intent, intents.MoveInQueue):
            return self._queue.move(intent.point_id, intent.before, intent.revision, intent.user)
        if isinstance(intent, intents.SetApproach):
            return self._queue.turn(intent.point_id, intent.azimuth, intent.user)
        if isinstance(intent, intents.ResetOrder):
            return self._queue.order.give_back(intent.revision)
        return f"{type(intent).__name__} is not something this controller does"

    def unknown_place(self, intent: intents.Survey) -> str:
        """Why the place of a survey cannot be looked at again; empty where it can, or where it has none."""
        if intent.vine == 0 or open_place(self._queue.perceived, intent.vine, intent.spur) is not None:
            return ""
        return f"nothing is left open at vine {intent.vine}, spur {intent.spur}"

    def told(self, intent: intents.Intent) -> str:
        """The log's words for what was done; empty where the change of mode that comes of it is logged."""
        if isinstance(intent, intents.AcceptPoint):
            return f"accepted {intent.point_id}, revision {intent.revision}"
        if isinstance(intent, intents.RejectPoint):
            return f"rejected {intent.point_id}{f': {intent.reason}' if intent.reason else ''}"
        if isinstance(intent, intents.ReconsiderPoint):
            return f"took back the decision about {intent.point_id}"
        if isinstance(intent, intents.RestoreAccepted):
            return "took the rule back with the acceptances that it made void"
        if isinstance(intent, intents.ResolvePoint):
            how = "is cut" if intent.outcome == "DONE" else "is not cut"
            return f"looked: {intent.point_id} {how}: {intent.reason}"
        if isinstance(intent, intents.AcceptAll):
            points = "1 point" if self._accepted == 1 else f"{self._accepted} points"
            return f"accepted {points} of confidence {intent.confidence:.2f} and more"
        if isinstance(intent, intents.MoveInQueue):
            return f"moved {intent.point_id} {f'before {intent.before}' if intent.before else 'to the end'}"
        if isinstance(intent, intents.SetApproach):
            how = "as is found" if intent.azimuth is None else f"turned by {math.degrees(intent.azimuth):.0f}°"
            return f"wants {intent.point_id} approached {how}"
        if isinstance(intent, intents.ResetOrder):
            return "gave the order of work back to the plan"
        if isinstance(intent, intents.RequestPreview):
            return f"asked for a preview of {intent.point_id or 'the work'}"
        if isinstance(intent, intents.ApprovePreview):
            return f"approved the preview {intent.preview_hash[:8]}"
        if isinstance(intent, intents.RequirePreview):
            return "requires a preview before each cut" if intent.required else "requires no previews any more"
        return "home" if isinstance(intent, intents.Home) else ""

    def _accept_all(self, intent: intents.AcceptAll) -> str:
        points = self._queue.proposed(intent.confidence)
        refusals = [self._queue.accept(point.point_id, point.revision, intent.user, point.digest) for point in points]
        self._accepted = refusals.count("")
        if self._accepted:
            return ""
        if not points:
            return f"no proposed point has a confidence of {intent.confidence:.2f} or more"
        return "; ".join(refusals)
