"""Stages of the cut sequence and the result of one control period."""

from dataclasses import dataclass, replace
from enum import Enum

from controller.motion.follower import Tracking
from rolling_panda import messages as m
from rolling_panda.model.differential_drive import Array


class Stage(Enum):
    """Step of the sequence."""

    REST = "rest"
    ESCAPE = "moving clear of the canes"
    SEARCH = "looking for a posture"
    TRAVEL = "on the way to the stand-off"
    CLOSE_UP = "looking closely"
    ADVANCE = "straight in"
    CUT = "cutting"
    RETREAT = "straight back"
    SURVEY = "driving along the row"


PHASES: dict[Stage, m.Phase] = {
    Stage.REST: "",
    Stage.ESCAPE: "RETREAT",
    Stage.SEARCH: "APPROACH",
    Stage.TRAVEL: "APPROACH",
    Stage.CLOSE_UP: "CLOSE_UP",
    Stage.ADVANCE: "ADVANCE",
    Stage.CUT: "CUT",
    Stage.RETREAT: "RETREAT",
    Stage.SURVEY: "SURVEY",
}


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

    def with_events(self, events: tuple[str, ...]) -> "StepResult":
        """The same, with more that happened."""
        return replace(self, events=self.events + events)
