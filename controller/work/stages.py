"""Stages of the cut sequence and the result of one control period."""

from dataclasses import dataclass, replace
from enum import Enum

from controller.motion.follower import Tracking
from rolling_panda import messages as m
from rolling_panda.model.differential_drive import Array


class Stage(Enum):
    """Step of the sequence."""

    REST = "rest"
    ESCAPE = "getting clear of the canes"
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
    """What one period of work gave.

    Attributes:
        xi: ξ̇ to send (9).
        tracking: Of the motion, None while standing.
        cut: The cut to command now: (cut_id, point_id) as a message without its epoch, else None.
        finished: True when there is nothing more to do.
        summary: Why, in words.
        pause: Why work must pause, empty when it goes on.
        events: What happened, in words.
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
