"""Selection of the next cut and its posture search, a few iterations a period."""

from collections.abc import Callable, Generator

import numpy as np

from controller.work.point_queue import PointQueue, Ticket
from controller.work.posture_search import CutPlan, PostureSearch, Unreachable
from rolling_panda.messages.perception import PruningPoint
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import Array

Found = CutPlan | Unreachable | None
Known = Callable[[Ticket], Found]
Permit = Callable[[Ticket], Reason | None]


class NextCut:
    """Posture search for the next point. Call `search` for a point and `step` in each period; `found` is the result."""

    def __init__(
        self,
        search: PostureSearch,
        queue: PointQueue,
        iterations: int,
        known: Known = lambda _: None,
        permit: Permit = lambda _: None,
    ) -> None:
        """Start without a point.

        Args:
            search: Posture search.
            queue: The queue, which chooses the next point.
            iterations: Iterations of the search in one period.
            known: Gives the planned cut of a point, which is then used without a search.
            permit: Gives the reason why the robot may not approach a point; None if it may.
        """
        self._search, self._queue, self._iterations, self._known = search, queue, iterations, known
        self.permit = permit
        #: Reason why the robot may not approach the next point; None without one.
        self.refused: Reason | None = None
        self.forget()

    def forget(self) -> None:
        """Drop the point and its search."""
        self._ticket: Ticket | None = None
        self._finding: Generator[None, None, CutPlan | Unreachable] | None = None
        self.found: CutPlan | Unreachable | None = None

    @property
    def point_id(self) -> str:
        """Id of the point; empty without one."""
        return "" if self._ticket is None else self._ticket.point.point_id

    @property
    def accepted(self) -> PruningPoint | None:
        """The point as accepted, which the plan is for; None without one."""
        return None if self._ticket is None else self._ticket.accepted

    def search(self, q: Array) -> bool:
        """Search for the next accepted point from configuration q (12), unless its search is under way.

        Returns:
            False when no point is accepted, or the next one may not be gone to.
        """
        ticket = self._queue.next()
        self.refused = None if ticket is None else self.permit(ticket)
        if ticket is None or ticket.accepted is None or self.refused:
            self.forget()
            return False
        if not self.stands:
            self._ticket, self.found, self._finding = ticket, self._known(ticket), None
            if self.found is not None:
                return True
            at, along = np.array(ticket.accepted.position), np.array(ticket.accepted.tangent)
            azimuth = self._queue.approaches.of(ticket.point.point_id)
            self._finding = self._search.find(at, along, q, azimuth)
        return True

    @property
    def stands(self) -> bool:
        """Whether the point is still the next one, with the same acceptance."""
        ticket, following = self._ticket, self._queue.next()
        return ticket is not None and following is not None and following.accepted is ticket.accepted

    def step(self) -> None:
        """Search for one period."""
        for _ in range(self._iterations):
            if self._finding is None:
                return
            try:
                next(self._finding)
            except StopIteration as end:
                self.found, self._finding = end.value, None
