"""Camera checks of a point before and after its cut.

After a cut the cutter reports whether the blades met resistance, and the camera whether the wood beyond is gone. Where
both report an intact cane, it is cut once more. Where they contradict each other, an operator decides.
"""

from dataclasses import dataclass

import numpy as np

from controller.config import ControllerConfig
from controller.motion.follower import Measured
from controller.motion.tool_motion import ToolMotion
from controller.work.close_up import CloseUpClient
from controller.work.point_queue import PointQueue, Ticket
from rolling_panda.messages.perception import CloseUpResult, PruningPoint
from rolling_panda.messages.types import Outcome, PointState

#: An ended cut that no look is begun for within this time (s) ends by the cutter's word.
_LOOK_WITHIN_S = 4.0


@dataclass
class _Ended:
    """A cut that ended: the cutter's word, since when, and whether a look has begun."""

    outcome: Outcome
    word: str
    since: float
    looking: bool = False


class PostCutCheck:
    """Settles cuts whose outcome the cutter knows. Pure but for the queue: time is an argument."""

    def __init__(self, queue: PointQueue, close_ups: CloseUpClient, looks: bool) -> None:
        """Bind the parts.

        Args:
            queue: Takes the result.
            close_ups: Looks.
            looks: False takes the cutter's word for it at once.
        """
        self._queue, self._close_ups, self._looks = queue, close_ups, looks
        self._ended: dict[str, _Ended] = {}
        self._tried: dict[str, PruningPoint | None] = {}

    @property
    def pending(self) -> bool:
        """Whether a cut is still to be settled."""
        return bool(self._ended)

    def begin(self, point_id: str, outcome: Outcome, word: str, now: float) -> None:
        """The cutter has said how a cut ended: DONE or FAILED_NOT_CUT; UNKNOWN is settled with that."""
        if not self._looks or outcome == "UNKNOWN":
            self._end(point_id, outcome or "UNKNOWN", word)
            return
        self._ended[point_id] = _Ended(outcome, word, now)

    def look(self, point_id: str, now: float) -> None:
        """The camera sees the place now; begins one look."""
        ended = self._ended.get(point_id)
        if ended is not None and not ended.looking:
            ended.looking = True
            self._close_ups.ask(point_id, "severed", now)

    def step(self, now: float) -> list[str]:
        """Settle what can be settled; what became of it, in words."""
        said = []
        for point_id, ended in list(self._ended.items()):
            look = self._close_ups.answer(point_id, now) if ended.looking else None
            if look is not None:
                said.append(self._settle(point_id, ended, look.finding, look.reason))
            elif not ended.looking and now - ended.since > _LOOK_WITHIN_S:
                said.append(self._settle(point_id, ended, "unseen", "the robot left before it was looked at"))
        return said

    def _settle(self, point_id: str, ended: _Ended, finding: str, reason: str) -> str:
        del self._ended[point_id]
        self._close_ups.forget(point_id)
        done = ended.outcome == "DONE"
        if finding == "severed":
            if done:
                return self._end(point_id, "DONE", "cut, and seen to be off")
            return self._end(point_id, "UNKNOWN", f"{ended.word}, but the wood beyond is gone: look")
        if finding == "unseen":
            return self._end(point_id, ended.outcome or "UNKNOWN", f"{ended.word}; not seen afterwards: {reason}")
        ticket = self._queue.get(point_id)
        accepted = None if ticket is None else ticket.accepted
        if self._tried.get(point_id) is None or self._tried[point_id] is not accepted:
            self._tried[point_id] = accepted
            self._queue.again(point_id, f"{ended.word}, but it is seen to stand: cut once more")
            return f"{point_id}: {ended.word}, but it is seen to stand: it is cut once more"
        if done:
            return self._end(point_id, "UNKNOWN", f"{ended.word} twice, but it is seen to stand: look")
        return self._end(point_id, "FAILED_NOT_CUT", f"{ended.word} twice, and it is seen to stand")

    def _end(self, point_id: str, state: PointState, reason: str) -> str:
        self._tried.pop(point_id, None)
        self._queue.resolve(point_id, state, reason)
        return f"{point_id}: {reason}"


#: From farther away the base has to come first, before the canes are entered (m).
_BASE_NEAR = 0.1


def not_as_accepted(look: CloseUpResult, ticket: Ticket | None, tolerance: float) -> str:
    """Why a point is not cut after a closer look, in words; empty when it is.

    Args:
        look: What was seen.
        ticket: Of the point.
        tolerance: It may have moved so far since it was accepted (m).
    """
    if ticket is None or ticket.accepted is None:
        return "it is not accepted any more"
    if look.finding == "severed":
        return "on a closer look its cane is off already"
    if look.finding == "changed":
        return f"on a closer look {look.reason}: accept it again if it is right"
    if look.finding == "unseen" or look.position is None:
        return f"a closer look did not show it: {look.reason}"
    moved = float(np.linalg.norm(np.subtract(look.position, ticket.accepted.position)))
    if moved > tolerance:
        return f"moved {1e3 * moved:.0f} mm on a closer look: accept it again"
    return ""


def camera_ready(robot: Measured, motion: ToolMotion, config: ControllerConfig) -> bool:
    """Whether the camera has the point in view from near, and hardly moves.

    Args:
        robot: Measured robot.
        motion: To where the tool is clear of the canes.
        config: How near, and how slow.
    """
    away = robot.kinematics.T_odom_tool.translation - motion.goal.translation
    speed = float(np.linalg.norm(robot.kinematics.J_xi[:3] @ robot.sent))
    base = float(np.linalg.norm(robot.q[:2] - motion.q_goal[:2]))
    return float(np.linalg.norm(away)) < config.look_within and base < _BASE_NEAR and speed < config.look_speed
