"""One cut from its first command to its outcome, in every mode."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from controller.config import WorkConfig
from controller.work.point_queue import PointQueue
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.types import Reason

#: A cut command is repeated this often until the bridge has seen it (s).
_REPEAT_S = 0.05
_OUTCOMES: dict[str, Reason] = {
    "DONE": reasons.cutter_cut(),
    "FAILED_NOT_CUT": reasons.cutter_missed(),
    "UNKNOWN": reasons.cutter_unsure(),
}


Ended = Callable[[str, m.Outcome, Reason, float], None]


@dataclass
class _Cut:
    """A cut in progress: the blades may have moved."""

    point_id: str
    cut_id: str
    deadline: float
    record: int
    asked_at: float = -math.inf


class Blades:
    """Orders cuts, one at a time, and passes the outcome of each to the queue."""

    def __init__(self, config: WorkConfig, queue: PointQueue, run_id: str, ended: Ended | None = None) -> None:
        """Bind the parts.

        Args:
            config: Section `[controller.work]`.
            queue: The queue, which gets the outcomes.
            run_id: Prefix that makes the cut ids of this start unique.
            ended: Called with the cutter's report in place of the queue: point, outcome, reason, time.
        """
        self._ended = ended
        self._timeout_s, self._queue, self._run_id = config.cut_timeout_s, queue, run_id
        self._cuts = 0
        self._cut: _Cut | None = None

    @property
    def busy(self) -> bool:
        """Whether a cut has been asked for and how it ends is not known yet: the blades may be closing."""
        return self._cut is not None

    def start(self, point_id: str, now: float) -> None:
        """Intend a cut at a point; no command is sent before that intent is durable."""
        self._cuts += 1
        cut_id = f"{self._run_id}-{self._cuts}"
        self._cut = _Cut(point_id, cut_id, now + self._timeout_s, self._queue.begin_cut(point_id, cut_id))

    def command(self, now: float) -> tuple[str, str] | None:
        """(cut_id, point_id) to command in this period; None between repetitions and before the intent is durable."""
        cut = self._cut
        if cut is None or now - cut.asked_at < _REPEAT_S or not self._queue.recorded(cut.record):
            return None
        cut.asked_at = now
        return cut.cut_id, cut.point_id

    def watch(self, bridge: m.BridgeState, now: float) -> tuple[Reason, ...]:
        """Update the cut from the bridge's state; returns what is logged."""
        cut = self._cut
        if cut is None:
            return ()
        if bridge.cut_id == cut.cut_id and bridge.outcome:
            self._cut = None
            why = _OUTCOMES[bridge.outcome]
            if self._ended is not None:
                self._ended(cut.point_id, bridge.outcome, why, now)
            else:
                self._queue.resolve(cut.point_id, bridge.outcome, why)
            told = reasons.cut_done if bridge.outcome == "DONE" else reasons.cut_ended
            return (told(cut.point_id, why),)
        if now > cut.deadline and cut.asked_at == -math.inf:
            self._cut = None
            why = reasons.no_order_given(self._timeout_s)
            self._queue.resolve(cut.point_id, "FAILED_NOT_CUT", why)
            return (reasons.point_not_cut(cut.point_id, why),)
        if now > cut.deadline:
            self._cut = None
            why = reasons.no_cutter_report(self._timeout_s)
            self._queue.resolve(cut.point_id, "UNKNOWN", why)
            return (reasons.outcome_unknown(cut.point_id, why),)
        return ()
