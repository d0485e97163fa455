"""Result of one control period of work."""

from dataclasses import dataclass, replace

from controller.motion.follower import Tracking
from rolling_panda import reasons
from rolling_panda.messages.types import Reason
from rolling_panda.model.differential_drive import Array


@dataclass(frozen=True)
class StepResult:
    """Result of one period of work.

    Attributes:
        xi: ξ̇ to send (9).
        tracking: Tracking of the motion; None at rest.
        cut: Cut to order, as (cut_id, point_id); None without one.
        finished: True at the end of the work.
        summary: Reason for the end.
        pause: Reason why the work has to pause; None to continue.
        events: What is logged.
    """

    xi: Array
    tracking: Tracking | None = None
    cut: tuple[str, str] | None = None
    finished: bool = False
    summary: Reason = reasons.work_done()
    pause: Reason | None = None
    events: tuple[Reason, ...] = ()

    def with_event(self, event: Reason) -> "StepResult":
        """The same, with one thing that happened before."""
        return replace(self, events=(event, *self.events))
