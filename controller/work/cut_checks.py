"""Camera checks of a point before and after its cut.

After a cut the cutter reports whether the blades met resistance, and the camera whether the wood beyond is gone. If
both report an intact cane, it is cut once more. If they contradict each other, an operator decides.
"""

import math
from dataclasses import dataclass

import numpy as np

from controller.config import WorkConfig
from controller.motion.follower import Measured
from controller.motion.tool_motion import ToolMotion
from controller.work.close_up import CloseUpClient
from controller.work.point_queue import PointQueue, Ticket
from rolling_panda.messages.perception import CloseUpResult, PruningPoint
from rolling_panda.messages.types import Outcome, PointState

#: Time limit for the request of a close-up after a cut (s); after it the cutter's report counts.
_REQUEST_WITHIN_S = 4.0


@dataclass
class _Ended:
    """A cut that ended: the cutter's report, its time, and whether a close-up was requested."""

    outcome: Outcome
    word: str
    since: float
    requested: bool = False


class PostCutCheck:
    """Decides the outcome of cuts that the cutter has reported. Pure apart from the queue: time is an argument."""

    def __init__(self, queue: PointQueue, close_ups: CloseUpClient, check: bool) -> None:
        """Bind the parts.

        Args:
            queue: The queue, which gets the result.
            close_ups: Client for the pictures.
            check: False accepts the cutter's report at once.
        """
        self._queue, self._close_ups, self._check = queue, close_ups, check
        self._ended: dict[str, _Ended] = {}
        self._tried: dict[str, PruningPoint | None] = {}

    @property
    def pending(self) -> bool:
        """Whether a cut is still to be settled."""
        return bool(self._ended)

    def start(self, point_id: str, outcome: Outcome, word: str, now: float) -> None:
        """The cutter has said how a cut ended: DONE or FAILED_NOT_CUT; UNKNOWN is settled with that."""
        if not self._check or outcome == "UNKNOWN":
            self._end(point_id, outcome or "UNKNOWN", word)
            return
        self._ended[point_id] = _Ended(outcome, word, now)

    def request_close_up(self, point_id: str, now: float) -> None:
        """The camera sees the place now; requests one close-up."""
        ended = self._ended.get(point_id)
        if ended is not None and not ended.requested:
            ended.requested = True
            self._close_ups.ask(point_id, "severed", now)

    def step(self, now: float) -> list[str]:
        """Decide the cuts that can be decided; returns log texts."""
        said = []
        for point_id, ended in list(self._ended.items()):
            close_up = self._close_ups.answer(point_id, now) if ended.requested else None
            if close_up is not None:
                said.append(self._settle(point_id, ended, close_up.finding, close_up.reason))
            elif not ended.requested and now - ended.since > _REQUEST_WITHIN_S:
                said.append(self._settle(point_id, ended, "unseen", "the robot left before the close-up"))
        return said

    def _settle(self, point_id: str, ended: _Ended, finding: str, reason: str) -> str:
        del self._ended[point_id]
        self._close_ups.forget(point_id)
        done = ended.outcome == "DONE"
        if finding == "severed":
            if done:
                return self._end(point_id, "DONE", "cut, and the wood is off")
            return self._end(point_id, "UNKNOWN", f"{ended.word}, but the wood beyond is gone: look")
        if finding == "unseen":
            return self._end(point_id, ended.outcome or "UNKNOWN", f"{ended.word}; not seen afterwards: {reason}")
        ticket = self._queue.get(point_id)
        accepted = None if ticket is None else ticket.accepted
        if self._tried.get(point_id) is None or self._tried[point_id] is not accepted:
            self._tried[point_id] = accepted
            self._queue.again(point_id, f"{ended.word}, but it still stands: cut once more")
            return f"{point_id}: {ended.word}, but it still stands: it is cut once more"
        if done:
            return self._end(point_id, "UNKNOWN", f"{ended.word} twice, but it still stands: look")
        return self._end(point_id, "FAILED_NOT_CUT", f"{ended.word} twice, and it still stands")

    def _end(self, point_id: str, state: PointState, reason: str) -> str:
        self._tried.pop(point_id, None)
        self._queue.resolve(point_id, state, reason)
        return f"{point_id}: {reason}"


#: From a larger distance the base has to move before the tool enters the canes (m).
_BASE_NEAR = 0.1


def not_as_accepted(close_up: CloseUpResult, ticket: Ticket | None, tolerance: float) -> str:
    """Reason why a point is not cut after its close-up; empty if it is.

    Args:
        close_up: Result of the close-up.
        ticket: Ticket of the point.
        tolerance: Largest displacement since the acceptance (m).
    """
    if ticket is None or ticket.accepted is None:
        return "it is not accepted any more"
    if close_up.finding == "severed":
        return "its cane is off already, as the close-up shows"
    if close_up.finding == "changed":
        return f"in the close-up {close_up.reason}: accept it again if it is right"
    if close_up.finding == "unseen" or close_up.position is None:
        return f"the close-up did not show it: {close_up.reason}"
    moved = float(np.linalg.norm(np.subtract(close_up.position, ticket.accepted.position)))
    if moved > tolerance:
        return f"moved {1e3 * moved:.0f} mm in the close-up: accept it again"
    return ""


def camera_ready(robot: Measured, motion: ToolMotion, config: WorkConfig) -> bool:
    """Whether the camera has the point in view from near, and hardly moves.

    Args:
        robot: Measured robot.
        motion: To where the tool is clear of the canes.
        config: How near, and how slow.
    """
    away = math.dist(robot.kinematics.T_odom_tool.translation, motion.goal.translation)
    if away >= config.close_up_within or math.dist(robot.q[:2], motion.q_goal[:2]) >= _BASE_NEAR:
        return False
    return math.hypot(*(robot.kinematics.J_xi[:3] @ robot.sent)) < config.close_up_speed
