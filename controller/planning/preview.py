"""Previews of the work: requests, validity and approval.

If required, no cut begins without an approval. An approval is for one motion: from the robot's pose, over these points
in this order, among these obstacles. The work then uses the postures of the preview.
"""

from collections.abc import Sequence

import numpy as np

from controller.config import HierarchyConfig
from controller.ledger.journal import Journal, PreviewRequiredRow
from controller.planning.path_watch import PathWatch
from controller.planning.plan_manager import approaches_changed, away_from, tried_since
from controller.planning.preview_plan import Preview, PreviewRequest, motion_message, state_message
from controller.work.point_queue import PointQueue, Ticket
from controller.work.posture_search import CutPlan
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.commands import Handlers
from rolling_panda.messages.perception import Capsule, PruningPoint
from rolling_panda.messages.supervision import PreviewMotion, PreviewPhase, PreviewState
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import Array

#: Largest number of points in a preview.
MOST = 10
#: Period of the repeated message for late joiners (s).
_STATE_S, _MOTION_S = 0.5, 5.0
#: Time limit for the plan (s); after it each posture is searched, as in work without a plan.
_PLAN_S = 15.0


class PreviewManager:
    """Manages one preview. Call `review` regularly; in between `permit` and `known` answer for single points."""

    def __init__(self, queue: PointQueue, journal: Journal, settings: HierarchyConfig) -> None:
        """Start without a request; previews are not required.

        Args:
            queue: The queue of points.
            journal: Records the decisions of people.
            settings: Distances of the collision guard.
        """
        self._queue, self._journal, self._settings = queue, journal, settings
        self.required = False
        self._preview: Preview | None = None
        self._asked: PreviewRequest | None = None
        self._wanted: str | None = None
        self._wanted_at = -np.inf
        self._number = 0
        self._phase: PreviewPhase = "none"
        self._reason: Reason | None = None
        self._approved_by = ""
        self._begun = False
        self._order: tuple[str, ...] = ()
        self._watch: PathWatch | None = None
        self._compared: object = None
        self._in_the_way: Reason | None = None
        self._fresh = self._fresh_motion = True
        self._said_at = self._moved_at = -np.inf

    def restore(self, row: PreviewRequiredRow) -> None:
        """Restore the requirement of an earlier start."""
        self.required = row.required

    def handlers(self) -> Handlers:
        """Handlers of the commands about previews; each returns the reason of a refusal, None if done."""
        return {
            intents.RequirePreview: lambda asked, now: self._require(asked.required, asked.user),
            intents.RequestPreview: lambda asked, now: self._want(asked.point_id, now),
            intents.ApprovePreview: lambda asked, now: self._approve(asked.preview_hash, asked.user),
        }

    def start_refused(self) -> Reason | None:
        """Reason why the start lacks an approval; None if it does not."""
        if not self.required or self._phase == "approved":
            return None
        if self._phase == "ready":
            return reasons.preview_not_approved()
        return self._expired or reasons.preview_needed()

    @property
    def approval_refused(self) -> Reason | None:
        """Reason why no preview can be approved; None if the current one can."""
        preview = self._preview
        if preview is None or self._phase not in ("ready", "approved", "expired"):
            return reasons.preview_missing()
        if expired := self._expired:
            return expired
        following, first = self._queue.next(), preview.request.points[0].point_id
        if following is not None and following.point.point_id != first:
            return reasons.another_comes_first(following.point.point_id, first)
        return None

    @property
    def _expired(self) -> Reason | None:
        if self._phase != "expired" or self._reason is None:
            return None
        return reasons.preview_expired(self._reason)

    @property
    def binds(self) -> bool:
        """Whether the work may take no other way than the one that was shown."""
        return self.required or self._begun

    def start(self) -> None:
        """Work begins."""
        self._begun = self._phase == "approved"

    def permit(self, ticket: Ticket) -> Reason | None:
        """Reason why the motion to a cut lacks an approval; None if it does not."""
        if not self.required:
            return None
        name, preview = ticket.point.point_id, self._preview
        if preview is None or not self._approved_by:
            return reasons.preview_awaited(name)
        if expired := self._expired:
            return expired
        names = [cut.point_id for cut in preview.cuts]
        points = {point.point_id: point for point in preview.request.points}
        if name not in names or points[name] != ticket.accepted:
            return reasons.not_in_preview(name)
        shown = preview.cuts[names.index(name)]
        if shown.reason is not None:
            return reasons.not_cut_in_preview(name, shown.reason)
        for before in names[: names.index(name)]:
            earlier = self._queue.get(before)
            if earlier is None or earlier.state not in ("CUTTING", "DONE"):
                return reasons.skipped_before(name, before)
        return None

    def known(self, ticket: Ticket) -> CutPlan | None:
        """The posture that the preview has shown for a cut, where work follows an approved one; else None."""
        preview, point_id = self._preview, ticket.point.point_id
        if preview is None or not self._begun or ticket.accepted not in preview.request.points:
            return None
        if tried_since(preview.request.tries, self._queue.tries.made, (point_id,)):
            return None
        return preview.plans.get(point_id)

    def review(
        self,
        made: Preview | None,
        q: Array | None,
        obstacles: Sequence[Capsule],
        cuts: dict[str, CutPlan] | None,
        at_rest: bool,
        working: bool,
        close_up_s: float,
        now: float,
    ) -> PreviewRequest | None:
        """Accept a new preview, check the current one, and make the due request.

        Args:
            made: Newest result; the same object until the next one.
            q: Configuration (12) now, None before the first measurement.
            obstacles: Current obstacles.
            cuts: Planned cuts by point id; None while a plan is computed.
            at_rest: Whether the robot is at rest.
            working: Whether it executes the queue.
            close_up_s: Time from the request of the last close-up to its result (s).
            now: Monotonic time (s).

        Returns:
            The request to compute; None without one.
        """
        if made is not None and self._asked is not None and made.request.number == self._asked.number:
            self._accept(made)
        if self._phase in ("ready", "approved") and q is not None:
            if why := self._changed(q, obstacles, at_rest, working):
                self._set_phase("expired", why)
        if self._begun and not working:
            self._begun = False
            # The robot has moved, and some of the points are cut.
            self._set_phase("expired", reasons.previewed_work_ended())
        if self._wanted is None or working or self._asked is not None:
            return None
        if not at_rest or q is None:
            self._set_phase("waiting", reasons.robot_moves())
            return None
        if cuts is None and now - self._wanted_at < _PLAN_S:
            self._set_phase("waiting", reasons.plan_being_made())
            return None
        points = self._points(self._wanted)
        self._wanted = None
        if not points:
            self._set_phase("none", self._queue.waits or reasons.none_accepted())
            return None
        self._number += 1
        following, names = self._queue.next(), tuple(point.point_id for point in points)
        # While it is valid, only people change its order.
        self._order = names if following is not None and following.point.point_id == names[0] else ()
        turned, tries, canes = self._queue.approaches.turned, self._queue.tries.made, self._queue.canes
        self._asked = PreviewRequest(
            self._number, q.copy(), points, tuple(obstacles), dict(cuts or {}), close_up_s, turned, tries, canes
        )
        self._set_phase("rolling")
        return self._asked

    def message(self, now: float) -> PreviewState | None:
        """The state for the wire where it is due."""
        if not self._fresh and now - self._said_at < _STATE_S:
            return None
        self._fresh, self._said_at = False, now
        shown = self._preview if self._phase in ("ready", "approved", "expired") else None
        left = 0 if shown is None else max(0, self._queue.count("ACCEPTED") - len(shown.cuts))
        return state_message(shown, self.required, self._phase, self._reason, self._approved_by, left, now)

    def motion(self, now: float) -> PreviewMotion | None:
        """The motion for the wire where it is due."""
        if self._preview is None or (not self._fresh_motion and now - self._moved_at < _MOTION_S):
            return None
        self._fresh_motion, self._moved_at = False, now
        return motion_message(self._preview, now)

    def _require(self, required: bool, user: str) -> None:
        self.required, self._fresh = required, True
        self._journal.add("preview", "preview", PreviewRequiredRow(required=required, user=user))

    def _want(self, point_id: str, now: float) -> Reason | None:
        ticket = self._queue.get(point_id) if point_id else self._queue.next()
        if ticket is None:
            return reasons.point_unknown(point_id)
        if ticket.state == "UNREACHABLE" and ticket.reason is not None:
            return reasons.point_unreachable(point_id, ticket.reason)
        if not ticket.seen:
            return reasons.point_unseen(point_id)
        if ticket.state != "ACCEPTED":
            return reasons.point_to_accept(point_id, ticket.state)
        self._wanted, self._wanted_at, self._asked = point_id, now, None
        self._approved_by = ""
        self._set_phase("waiting")
        return None

    def _approve(self, digest: str, user: str) -> Reason | None:
        shown = "" if self._preview is None else self._preview.digest
        if digest != shown:
            return reasons.preview_replaced(shown[:8], digest[:8])
        self._approved_by = user
        self._set_phase("approved")
        return None

    def _accept(self, made: Preview) -> None:
        self._asked, self._approved_by = None, ""
        if made.failure is not None:
            self._preview = None
            self._set_phase("none", reasons.preview_failed(made.failure))
            return
        self._preview, self._fresh_motion = made, True
        self._watch = None if made.swept is None else PathWatch(made, made.swept, self._settings)
        self._compared, self._in_the_way = None, None
        self._set_phase("ready")

    def _changed(self, q: Array, obstacles: Sequence[Capsule], at_rest: bool, working: bool) -> Reason | None:
        """The change that expires the preview; None without one."""
        preview, watch = self._preview, self._watch
        if preview is None or watch is None:
            return None
        if not working and at_rest and (why := away_from(preview.request.q, q)):
            return why
        if why := self._points_changed(preview, working):
            return why
        if why := approaches_changed(preview.request.turned, self._queue.approaches.turned):
            return why
        names = {point.point_id for point in preview.request.points}
        if why := tried_since(preview.request.tries, self._queue.tries.made, names):
            return why
        if self._compared is not obstacles:
            self._compared = obstacles
            self._in_the_way = watch.changed(obstacles, self._come_to(preview))
        return self._in_the_way

    def _come_to(self, preview: Preview) -> str:
        """The point that is worked on now, or next."""
        for cut in preview.cuts:
            ticket = self._queue.get(cut.point_id)
            if ticket is not None and ticket.state in ("ACCEPTED", "CUTTING"):
                return cut.point_id
        return preview.cuts[-1].point_id if preview.cuts else ""

    def _points_changed(self, preview: Preview, working: bool) -> Reason | None:
        for point in preview.request.points:
            ticket = self._queue.get(point.point_id)
            if ticket is not None and ticket.state == "UNREACHABLE":
                return reasons.no_longer_reachable(point.point_id)
            if ticket is None or ticket.state not in ("ACCEPTED", "CUTTING", "DONE", "FAILED_NOT_CUT", "UNKNOWN"):
                return reasons.no_longer_accepted(point.point_id)
            if ticket.state == "ACCEPTED" and ticket.accepted != point:
                return reasons.revised(point.point_id)
        following = self._queue.next()
        first = preview.request.points[0].point_id
        if self._phase == "approved" and not working and following is not None and following.point.point_id != first:
            return reasons.another_comes_first(following.point.point_id, first)
        return None

    def _points(self, point_id: str) -> tuple[PruningPoint, ...]:
        """Points of the preview in the order of work: the requested one, which then comes first, or the next few."""
        tickets = [ticket for ticket in self._queue.in_order() if ticket.state == "ACCEPTED" and ticket.seen]
        if point_id:
            tickets = [ticket for ticket in tickets if ticket.point.point_id == point_id]
        return tuple(ticket.accepted for ticket in tickets[:MOST] if ticket.accepted is not None)

    def _set_phase(self, phase: PreviewPhase, reason: Reason | None = None) -> None:
        if (phase, reason) == (self._phase, self._reason):
            return
        self._phase, self._reason, self._fresh = phase, reason, True
        self._queue.hold(self._order if phase in ("rolling", "ready", "approved") else ())
