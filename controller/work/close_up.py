"""Close-up pictures of points, and what they decide before and after a cut.

After a cut the cutter reports whether the blades met resistance, and the camera whether the wood beyond is gone. If
both report an intact cane, it is cut once more. If they contradict each other, an operator decides. A cane that the
camera sees beside the cut, rather than in it, was severed and hangs. A cane that sways is cut where it is in the mean.
"""

import itertools
import math
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from msgspec.structs import replace

from controller.config import WorkConfig
from controller.motion.follower import Measured
from controller.motion.tool_motion import ToolMotion
from controller.work.point_queue import PointQueue, Ticket
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.perception import CloseUpResult, Finding, PruningPoint
from rolling_panda.messages.types import Outcome, PointState, Reason
from rolling_panda.model.differential_drive import Array
from rolling_panda.model.wire_values import vector3

#: A request is repeated this often until its picture has come (s).
_REPEAT_S = 0.05
#: A picture without a result after this time (s) counts as lost and is requested again.
_LOST_S = 1.5
#: A cane that pictures show within this of each other, or of where it is expected, does not sway (m).
_STILL = 0.005
#: So many pictures of a cane that sways tell where it is in the mean, taken so far apart (s): it sways at 0.5 to 2 Hz.
_SWAYING, _APART_S = 3, 0.3


@dataclass
class _Asked:
    """A close-up in progress.

    Attributes:
        expected: Finding.
        place: Where the cane is expected (3, m, odom); None counts any place as the expected one.
        number: Of the newest request.
        first: Number of the first request that counts.
        came: Pictures that came.
        seen: What those told that showed the cane.
        last: What the newest one told; None before one came.
        begun: When it was requested (s).
        since: When its newest picture was (s).
        sent_at: When that request was sent last (s).
        answer: Result; None while it is pending.
    """

    expected: Finding
    place: Array | None
    number: int
    first: int
    begun: float
    since: float
    came: int = 0
    seen: list[CloseUpResult] = field(default_factory=list)
    last: CloseUpResult | None = None
    sent_at: float = -math.inf
    answer: CloseUpResult | None = None

    def sways(self) -> bool:
        """Whether the pictures show the cane at different places, or the only one not where it is expected."""
        if self.place is None:
            return False
        places = [self.place] if len(self.seen) == 1 else []
        places += [np.array(each.position) for each in self.seen]
        return any(math.dist(one, other) > _STILL for one, other in itertools.combinations(places, 2))

    def conclusion(self, last: CloseUpResult) -> CloseUpResult:
        """What all pictures come to; `last` is the newest.

        The cane is at its mean place in them, and where it sways in the expected one too. What one picture alone shows
        elsewhere may be another cane.
        """
        if self.place is None or not self.seen or last.finding not in (self.expected, "unseen"):
            return last
        places, sways = [each.position for each in self.seen if each.position is not None], self.sways()
        if sways and len(places) == 1:
            aside = reasons.which_cane_unclear(1e3 * math.dist(places[0], self.place))
            return replace(self.seen[0], finding="unseen", reason=aside, position=None, tangent=None)
        if sways:
            places.append(vector3(self.place))
        return replace(self.seen[-1], position=vector3(np.mean(places, axis=0)))


class CloseUpClient:
    """Requests close-up pictures, several points at a time. The newest request for a point counts."""

    def __init__(self, timeout_s: float, pictures: int, blind: int = 0) -> None:
        """Start without requests.

        Args:
            timeout_s: Time limit of one close-up, retries included (s).
            pictures: Largest number of pictures of one close-up. Another one is taken if the last did not show
                what was expected.
            blind: The same while the pictures are not conclusive; 0 for as many as `pictures`.
        """
        self._timeout_s, self._pictures, self._blind = timeout_s, pictures, blind or pictures
        self._asked: dict[str, _Asked] = {}
        self._number = 0
        #: Time from the request to the result, of the last picture that came (s).
        self.took_s = 0.5

    def ask(self, point_id: str, expected: Finding, now: float, place: Array | None = None) -> None:
        """Request a close-up of a point.

        A result that is not as expected is checked with another picture, and so is a cane that is seen elsewhere than
        at its `place` (3, m, odom): where it sways, the answer has its mean place.
        """
        self._number += 1
        self._asked[point_id] = _Asked(expected, place, self._number, self._number, now, now)

    def forget(self, point_id: str) -> None:
        """Drop the close-up of this point."""
        self._asked.pop(point_id, None)

    def update(self, result: CloseUpResult, now: float) -> None:
        """Take in the result of a picture. One that was not requested changes nothing."""
        asked = self._asked.get(result.point_id)
        # A late result counts too: on a slow machine each picture is late.
        if asked is None or not asked.first <= result.number <= asked.number or asked.answer is not None:
            return
        asked.came, asked.last = asked.came + 1, result
        if result.finding == asked.expected:
            asked.seen += [result] if result.position is not None else []
            wait, most = len(asked.seen) < _SWAYING and asked.sways(), self._blind
        else:
            wait, most = True, self._blind if result.finding == "unseen" else self._pictures
        if wait and asked.came < most:
            self._again(asked, now + (_APART_S if asked.sways() else 0.0))
            asked.first = asked.number
        else:
            asked.answer, self.took_s = asked.conclusion(result), now - asked.since

    def due(self, now: float) -> tuple[int, str] | None:
        """Number and point of the request to send in this period; None when none is due."""
        for point_id, asked in self._asked.items():
            if asked.answer is None and now - asked.since > _LOST_S:
                self._again(asked, now)
            if asked.answer is None and now - asked.sent_at >= _REPEAT_S:
                asked.sent_at = now
                return asked.number, point_id
        return None

    def number(self) -> int | None:
        """Number for a picture that is no close-up; None while a close-up is pending, which it would overtake."""
        if any(asked.answer is None for asked in self._asked.values()):
            return None
        self._number += 1
        return self._number

    def answer(self, point_id: str, now: float) -> CloseUpResult | None:
        """The result for a point; None while it is pending, and where none was requested."""
        asked = self._asked.get(point_id)
        if asked is None:
            return None
        if asked.answer is None and now - asked.begun > self._timeout_s:
            asked.answer = self._in_time(point_id, asked)
        return asked.answer

    def _in_time(self, point_id: str, asked: _Asked) -> CloseUpResult:
        """The result where the time limit is over: of the pictures that came, if the newest one contradicts nothing.

        One picture that contradicts what is expected does not count: a second one has to do so too.
        """
        if asked.last is not None and asked.last.finding in (asked.expected, "unseen"):
            return asked.conclusion(asked.last)
        why = reasons.no_close_up(self._timeout_s)
        header = m.Header()
        return CloseUpResult(header=header, point_id=point_id, number=asked.number, finding="unseen", reason=why)

    def _again(self, asked: _Asked, at: float) -> None:
        self._number += 1
        asked.number, asked.since, asked.sent_at = self._number, at, at - _REPEAT_S


#: Time limit for the request of a close-up after a cut (s); after it the cutter's report counts.
_REQUEST_WITHIN_S = 4.0
#: A cane that stands is seen within this of where the blades closed (m): what camera and arm err, and what it sways.
_STANDS_WITHIN = 0.012


@dataclass
class _Ended:
    """A cut that ended: the cutter's report, its time, and where the blades were, once a close-up is requested."""

    outcome: Outcome
    report: Reason
    since: float
    place: Array | None = None


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
        #: Points that a first bite seemed to leave: as accepted, and whether the cutter told of a cut.
        self._tried: dict[str, tuple[PruningPoint | None, bool]] = {}

    @property
    def pending(self) -> bool:
        """Whether a cut is still to be settled."""
        return bool(self._ended)

    def start(self, point_id: str, outcome: Outcome, report: Reason, now: float) -> None:
        """The cutter has said how a cut ended: DONE or FAILED_NOT_CUT; UNKNOWN is settled with that."""
        if not self._check or outcome == "UNKNOWN":
            self._end(point_id, outcome or "UNKNOWN", report)
            return
        self._ended[point_id] = _Ended(outcome, report, now)

    def request_close_up(self, point_id: str, place: Array, now: float) -> None:
        """The camera sees now where the blades closed (`place`, 3, m, odom); requests one close-up."""
        ended = self._ended.get(point_id)
        if ended is not None and ended.place is None:
            ended.place = place
            self._close_ups.ask(point_id, "severed", now)

    def step(self, now: float) -> list[Reason]:
        """Decide the cuts that can be decided; returns what is logged."""
        said = []
        for point_id, ended in list(self._ended.items()):
            if ended.place is None:
                if now - ended.since > _REQUEST_WITHIN_S:
                    said.append(self._settle(point_id, ended, "unseen", reasons.robot_left()))
                continue
            close_up = self._close_ups.answer(point_id, now)
            if close_up is not None:
                aside = _aside(close_up, ended.place)
                said.append(self._settle(point_id, ended, close_up.finding, _why(close_up), aside))
        return said

    def is_off(self, point_id: str) -> Reason | None:
        """A close-up before a second bite shows the cane off: it is cut, if the cutter said so after the first one.

        Returns:
            What is logged; None where there was no such bite.
        """
        ticket, (accepted, cut) = self._queue.get(point_id), self._tried.get(point_id, (None, False))
        if not cut or ticket is None or accepted is None or ticket.accepted is not accepted:
            return None
        return self._end(point_id, "DONE", reasons.cut_and_gone())

    def _settle(self, point_id: str, ended: _Ended, finding: Finding, why: Reason, aside: float = 0.0) -> Reason:
        del self._ended[point_id]
        self._close_ups.forget(point_id)
        done = ended.outcome == "DONE"
        if finding == "severed":
            if done:
                return self._end(point_id, "DONE", reasons.cut_and_gone())
            return self._end(point_id, "UNKNOWN", reasons.gone_but(ended.report))
        if finding == "unseen":
            return self._end(point_id, ended.outcome or "UNKNOWN", reasons.unseen_after(ended.report, why))
        if aside > _STANDS_WITHIN and done:
            return self._end(point_id, "DONE", reasons.cut_and_hangs(1e3 * aside))
        ticket = self._queue.get(point_id)
        accepted = None if ticket is None else ticket.accepted
        if self._tried.get(point_id, (None, False))[0] is not accepted or accepted is None:
            self._tried[point_id] = accepted, done
            again = reasons.stands_cut_again(ended.report)
            self._queue.again(point_id, again)
            return reasons.cut_ended(point_id, again)
        if done:
            return self._end(point_id, "UNKNOWN", reasons.stands_unknown(ended.report))
        if aside > _STANDS_WITHIN:
            # It sways, or hangs by its bark.
            return self._end(point_id, "UNKNOWN", reasons.beside_but(ended.report, 1e3 * aside))
        return self._end(point_id, "FAILED_NOT_CUT", reasons.stands_not_cut(ended.report))

    def _end(self, point_id: str, state: PointState, reason: Reason) -> Reason:
        self._tried.pop(point_id, None)
        self._queue.resolve(point_id, state, reason)
        told = reasons.cut_done if state == "DONE" else reasons.cut_ended
        return told(point_id, reason)


#: From a larger distance the base has to move before the tool enters the canes (m).
_BASE_NEAR = 0.1
#: A picture from another side than the last one is taken within this of the tool's orientation there (rad).
_TURNED = 0.05


def not_as_accepted(close_up: CloseUpResult, ticket: Ticket | None) -> Reason | None:
    """Reason why a point is not cut after its close-up; None if it is, wherever the close-up has found its cane.

    Args:
        close_up: Result of the close-up.
        ticket: Ticket of the point.
    """
    if ticket is None or ticket.accepted is None:
        return reasons.not_accepted_any_more()
    if close_up.finding == "severed":
        return reasons.gone_already()
    if close_up.finding == "changed":
        return reasons.changed_in_close_up(_why(close_up))
    if close_up.finding == "unseen" or close_up.position is None:
        return reasons.unseen_in_close_up(_why(close_up))
    return None


def no_picture(close_up: CloseUpResult) -> bool:
    """Whether no picture came in time."""
    return close_up.reason is not None and close_up.reason.code == "no_close_up"


def _why(close_up: CloseUpResult) -> Reason:
    return close_up.reason or reasons.unexplained()


def _aside(close_up: CloseUpResult, place: Array) -> float:
    """How far beside a place the cane is seen, across it (m); 0 where it is not seen."""
    if close_up.position is None or close_up.tangent is None:
        return 0.0
    off, along = np.subtract(close_up.position, place), np.array(close_up.tangent)
    return float(np.linalg.norm(off - along * (off @ along)))


def camera_ready(robot: Measured, motion: ToolMotion, config: WorkConfig, other_side: bool) -> bool:
    """Whether the camera has the point in view from near, and hardly moves.

    Args:
        robot: Measured robot.
        motion: To where the tool is clear of the canes.
        config: How near, and how slow.
        other_side: Whether a picture from elsewhere has not told enough, or the way in had no room there.
    """
    tool = robot.kinematics.T_odom_tool
    away = math.dist(tool.translation, motion.goal.translation)
    if away >= config.close_up_within or math.dist(robot.q[:2], motion.q_goal[:2]) >= _BASE_NEAR:
        return False
    if other_side and np.linalg.norm(pin.log3(tool.rotation.T @ motion.goal.rotation)) >= _TURNED:
        return False
    return math.hypot(*(robot.kinematics.J_xi[:3] @ robot.sent)) < config.close_up_speed
