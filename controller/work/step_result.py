"""Result of one control period of work."""

from dataclasses import dataclass, replace

from controller.motion.follower import Tracking
from rolling_panda.model.differential_drive import Array


@dataclass(frozen=True)
class StepResult:
    """Result of one period of work.

    Attributes:
        xi: ξ̇ to send (9).
        tracking: Tracking of the motion; None at rest.
        cut: Cut to order, as (cut_id, point_id); None without one.
        finished: True at the end of the work.
        summary: Reason for the end, as text.
        pause: Reason why the work has to pause; empty to continue.
        events: Log lines.
    """

    xi: Array
    tracking: Tracking | None = None
    cut: tuple[str, str] | None = None
    finished: bool = False
    summary: str = "no accepted point is left"
    pause: str = ""
    events: tuple[str, ...] = ()

    def with_event(self, text: str) -> "StepResult":
        """The same, with one thing that happened before."""
        return replace(self, events=(text, *self.events))
