"""Pruning points with their states, in the order of work."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import msgspec
import numpy as np

from controller.config import WorkConfig
from controller.ledger.journal import EventLogger, Journal, TicketRow
from controller.work.order import Approaches, WorkOrder
from controller.work.rule_history import RuleHistory
from controller.work.tries import Tried, Tries
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.commands import POINT_STATES, Handler, Handlers
from rolling_panda.messages.perception import PruningPoint, PruningPoints, PruningRule, identity, point_digest
from rolling_panda.messages.supervision import QueueEntry
from rolling_panda.messages.types import PointState, Reason, Vector3
from rolling_panda.model.differential_drive import Array

#: A cane that turned further than this after acceptance is not the one the operator saw (rad).
_TURNED_TOLERANCE = 0.35
#: After a restart, when numbers of canes mean nothing, a cut is recognised by its place: nearer than this (m).
_SAME_PLACE = 0.005
#: A point id that returns at a larger distance belongs to another cane (m).
_ELSEWHERE = 0.03
#: The operator is told of an accepted cut that is seen farther than this from where it was accepted (m).
TOLD_MOVED = 0.005
#: Times that a cut is tried before it is given up, where it is not reached.
_TRIES = 3
#: States in which a point is shown from the record if perception does not report it: a person has to decide.
_ASKED: frozenset[PointState] = frozenset({"ACCEPTED", "UNREACHABLE", "UNKNOWN"})
#: States with an acceptance and no cut yet. The acceptance is valid while the point is as the operator saw it.
BOUND: frozenset[PointState] = frozenset({"ACCEPTED", "UNREACHABLE"})


@dataclass(frozen=True)
class Ticket:
    """A point on the queue.

    Attributes:
        point: The point as last perceived.
        state: State of the point.
        reason: Reason for the state; None without one.
        user: Who accepted or rejected it.
        accepted: The point that the operator saw and accepted; it is what is cut.
        hash: Hash of the accepted point.
        cut_id: Id of the last cut at the point.
        seen: Whether perception currently reports the point.
        proposer: Segmenter that proposed it, with the hash of its network; empty for a point by hand.
        wrong_by: Who has said that its cut was wrong; empty without anyone.
        bound: Which cut was accepted, by the numbers of the present run of perception; empty before it was seen again.
    """

    point: PruningPoint
    state: PointState = "PROPOSED"
    reason: Reason | None = None
    user: str = ""
    accepted: PruningPoint | None = None
    hash: str = ""
    cut_id: str = ""
    seen: bool = True
    proposer: str = ""
    wrong_by: str = ""
    bound: tuple[str | int, ...] = ()


class PointQueue:
    """All points by id. Every change of state has a reason and is recorded."""

    def __init__(self, config: WorkConfig, journal: Journal | None = None, tries: int = _TRIES) -> None:
        """Start empty; changes are recorded in `journal`, and a cut is tried at most so many times."""
        self._config, self._most_tries = config, tries
        self._journal = journal or Journal()
        self.perceived: PruningPoints | None = None
        """What perception told last."""
        self._along = np.array([np.cos(config.row_heading), np.sin(config.row_heading), 0.0])
        self._tickets: dict[str, Ticket] = {}
        self._order: list[str] = []
        self._entries: tuple[QueueEntry, ...] | None = None
        self.approaches = Approaches(self._journal)
        """From where cuts are to be made."""
        self.order = WorkOrder(self._journal)
        """How the accepted points are ordered; `sort` after it has changed."""
        self.tries = Tries()
        """What came of earlier tries of the accepted cuts."""
        self._rules: RuleHistory[Ticket] = RuleHistory()
        self._restored: list[str] = []

    @property
    def canes(self) -> tuple[tuple[Vector3, ...], ...]:
        """Axes of all standing canes (m, map)."""
        return () if self.perceived is None else self.perceived.canes

    def update(self, points: PruningPoints, keep: str = "") -> list[Reason]:
        """Update from perception's current points; returns the voided acceptances.

        Args:
            points: Perception's message.
            keep: Point that the blades hide from the camera: its disappearance is ignored. If it is seen
                elsewhere than accepted, its acceptance is void like any other.
        """
        voided: list[Reason] = []
        # After a restart perception counts its frames from the beginning, and numbers spurs and canes anew.
        restarted = self.perceived is not None and points.frames < self.perceived.frames
        change = None if restarted else self._rule_change(points)
        rule = None if change is None else _described(change[1])
        bound = {} if change is None else {name: each for name, each in self._tickets.items() if each.state in BOUND}
        self.perceived = points
        seen = {point.point_id for point in points.points}
        for point in points.points:
            ticket = self._tickets.get(point.point_id)
            if ticket is None:
                self._put(point.point_id, Ticket(point, proposer=_proposer(point, points)))
                continue
            if not ticket.seen and ticket.state not in BOUND and _apart(ticket.point, point) > _ELSEWHERE:
                # Perception restarted and numbers from one again: this id now belongs to another cane.
                former = f"{point.point_id}:{point_digest(ticket.point)[:8]}"
                self._put(former, replace(ticket, point=msgspec.structs.replace(ticket.point, point_id=former)))
                self._put(point.point_id, Ticket(point, proposer=_proposer(point, points)))
                continue
            if not ticket.seen and ticket.state == "ACCEPTED":
                ticket = replace(ticket, reason=None)
            proposer = _proposer(point, points) if ticket.state == "PROPOSED" else ticket.proposer
            known, ticket = ticket, replace(ticket, point=point, seen=True, proposer=proposer)
            why = _by_rule(known, point, rule) if rule is not None and known.seen else None
            if restarted or not known.seen:
                ticket = replace(ticket, bound=())
            why = why or self._changed(ticket)
            if ticket.state in BOUND:
                ticket = replace(ticket, bound=ticket.bound or identity(point))
            self._put(point.point_id, self._void(ticket, why, voided) if why else _with_shift(ticket))
        for point_id, ticket in list(self._tickets.items()):
            if point_id in seen or point_id == keep or not ticket.seen:
                continue
            gone = replace(ticket, seen=False)
            if ticket.state in BOUND:
                why = reasons.no_longer_reported() if rule is None else reasons.rule_wants_no_cut(rule)
                gone = self._void(gone, why, voided)
            if gone.state == "PROPOSED" and ticket.state == "PROPOSED":
                self._drop(point_id)
            else:
                self._put(point_id, gone)
        if change is not None:
            lost = {name: each for name, each in bound.items() if self._tickets[name].state == "PROPOSED"}
            self._restore(self._rules.changed(*change, lost))
        self.sort()
        return voided

    def _rule_change(self, points: PruningPoints) -> tuple[PruningRule, PruningRule] | None:
        """The rule before these points and theirs, where somebody has changed it."""
        before = self.perceived
        if before is None or before.rule is None or points.rule is None:
            return None
        return None if points.rule == before.rule else (before.rule, points.rule)

    @property
    def _rule(self) -> PruningRule | None:
        return None if self.perceived is None else self.perceived.rule

    @property
    def guyot(self) -> bool:
        """Whether perception takes the vines for Guyot vines."""
        return self._rule is not None and self._rule.system == "guyot"

    @property
    def undo_refused(self) -> Reason | None:
        """Reason why the acceptances of no rule can be restored; None if those of one can."""
        return self._rules.undo_refused(self._rule)

    def undo_rule(self, rule: PruningRule) -> Reason | None:
        """Restore the acceptances that the change to `rule` made void, now or when perception reports the former rule.

        Returns:
            Why that cannot be; None when it is done or will be.
        """
        back = self._rules.undo(rule, self._rule)
        if isinstance(back, Reason):
            return back
        self._restore(back)
        return None

    def restored(self) -> Reason | None:
        """The acceptances that the undo of a rule has restored, once; None without any."""
        names, self._restored = self._restored, []
        return reasons.acceptances_restored(", ".join(names)) if names else None

    def _restore(self, acceptances: Mapping[str, Ticket] | None) -> None:
        for name, accepted in (acceptances or {}).items():
            ticket = self._tickets.get(name)
            if ticket is None or not ticket.seen or ticket.state != "PROPOSED":
                continue
            again = replace(accepted, point=ticket.point, seen=True)
            if not self._changed(again):
                self._put(name, again)
                self._restored.append(name)

    def get(self, point_id: str) -> Ticket | None:
        """The ticket of a point, None when there is none."""
        return self._tickets.get(point_id)

    def accept(self, point_id: str, revision: int, user: str, digest: str = "") -> Reason | None:
        """Accept a point as the operator saw it. Returns the reason of a refusal; None if accepted.

        Args:
            point_id: Of the point.
            revision: Revision that the operator saw.
            user: Who accepts.
            digest: Hash of what the operator saw; empty if not given.
        """
        if (refused := self._acceptance_refused(point_id, revision, digest)) is not None:
            return refused
        ticket = self._tickets[point_id]
        seen = ticket.point
        accepted = replace(ticket, state="ACCEPTED", reason=None, user=user, accepted=seen, hash=point_digest(seen))
        self._put(point_id, replace(accepted, bound=identity(seen)))
        return None

    def _acceptance_refused(self, point_id: str, revision: int, digest: str) -> Reason | None:
        ticket = self._tickets.get(point_id)
        if ticket is None:
            return reasons.point_unknown(point_id)
        if ticket.state == "UNKNOWN":
            return reasons.outcome_undecided(point_id)
        if ticket.state == "UNREACHABLE" and ticket.reason is not None:
            return reasons.point_unreachable(point_id, ticket.reason)
        if ticket.state not in POINT_STATES["AcceptPoint"]:
            return reasons.point_state(point_id, ticket.state)
        if not ticket.seen:
            return reasons.point_unseen(point_id)
        if ticket.point.revision != revision:
            return reasons.point_revised(point_id, revision, ticket.point.revision)
        if digest and digest != ticket.point.digest:
            return reasons.point_replaced(point_id, ticket.point.digest[:8] or "unknown", digest[:8])
        radius, old_wood = ticket.point.radius, ticket.point.kind in ("renewal cut", "removal")
        largest = self._config.largest_stub_radius if old_wood else self._config.largest_radius
        if radius > largest:
            return reasons.cane_too_thick(point_id, 2e3 * radius, 2e3 * largest)
        return None

    def none_acceptable(self, confidence: float = 0.0) -> Reason | None:
        """Reason why no proposed point that is at least this sure can be accepted; None if one can."""
        refused = []
        for point in self.proposed(confidence):
            why = self._acceptance_refused(point.point_id, point.revision, point.digest)
            if why is None:
                return None
            refused.append(why)
        if refused:
            return reasons.none_acceptable(len(refused), refused[0])
        return reasons.none_so_confident(confidence) if self.proposed(0.0) else reasons.none_proposed()

    def reject(self, point_id: str, user: str, reason: str) -> Reason | None:
        """Reject a point. Returns the reason of a refusal; None if done."""
        ticket = self._tickets.get(point_id)
        if ticket is None:
            return reasons.point_unknown(point_id)
        if ticket.state not in POINT_STATES["RejectPoint"]:
            return reasons.point_state(point_id, ticket.state)
        why = reasons.said(reason) if reason else reasons.rejected()
        self._put(point_id, replace(ticket, state="REJECTED", reason=why, user=user, accepted=None))
        return None

    def reconsider(self, point_id: str, user: str) -> Reason | None:
        """ACCEPTED, UNREACHABLE or REJECTED → PROPOSED. Returns the reason of a refusal; None if done."""
        ticket = self._tickets.get(point_id)
        if ticket is None:
            return reasons.point_unknown(point_id)
        if ticket.state not in {*BOUND, "REJECTED"}:
            return reasons.nothing_to_take_back(point_id, ticket.state)
        if not ticket.seen:
            return reasons.point_unseen(point_id)
        self._put(point_id, replace(ticket, state="PROPOSED", reason=None, user=user, accepted=None, hash="", bound=()))
        return None

    def proposed(self, confidence: float) -> list[PruningPoint]:
        """Points that wait for a decision and are at least this sure."""
        tickets = (self._tickets[i] for i in self._order)
        return [t.point for t in tickets if t.state == "PROPOSED" and t.seen and t.point.confidence >= confidence]

    def next(self, skip: Callable[[str], bool] = lambda _: False) -> Ticket | None:
        """The first accepted point in the order of work, of those that perception has seen."""
        for point_id in self._order:
            ticket = self._tickets[point_id]
            if ticket.state == "ACCEPTED" and ticket.seen and not skip(point_id):
                return ticket
        return None

    def accepted(self) -> tuple[PruningPoint, ...]:
        """Accepted points, reachable or not, each as it was accepted, by id."""
        found = (ticket.accepted for ticket in self._tickets.values() if ticket.state in BOUND and ticket.seen)
        return tuple(sorted((point for point in found if point is not None), key=lambda point: point.point_id))

    def in_order(self) -> list[Ticket]:
        """Every ticket in the order of work."""
        return [self._tickets[point_id] for point_id in self._order]

    def tickets(self) -> tuple[Ticket, ...]:
        """Every ticket."""
        return tuple(self._tickets.values())

    def count(self, state: PointState) -> int:
        """How many points that perception has seen are in a state."""
        return sum(ticket.state == state and ticket.seen for ticket in self._tickets.values())

    @property
    def waits(self) -> Reason | None:
        """Reason why no accepted point is workable; None if one is."""
        if self.next() is not None:
            return None
        beyond = self.count("UNREACHABLE")
        return reasons.none_reachable(beyond) if beyond else reasons.none_accepted()

    def arrange(self, order: tuple[str, ...]) -> None:
        """Work in this order from now on; points that it does not name stay in their places along the row.

        Args:
            order: Ids of accepted points; none for the order along the row.
        """
        self.order.plan(order)
        self.sort()

    def reach(self, planned: Iterable[PruningPoint], refused: Mapping[str, Reason], busy: str = "") -> bool:
        """Update which accepted points the current plan can reach: ACCEPTED ↔ UNREACHABLE.

        Args:
            planned: Points of the plan's request, as accepted.
            refused: Reason for each refused point, by id.
            busy: Current point of the work, whose state the work decides.

        Returns:
            Whether the state of any point has changed.
        """
        changed = False
        for point in planned:
            ticket = self._tickets.get(point.point_id)
            if ticket is None or ticket.state not in BOUND or ticket.accepted != point or point.point_id == busy:
                continue
            why = refused.get(point.point_id)
            why = why and self._after_tries(point.point_id, why)
            if why and (ticket.state, ticket.reason) != ("UNREACHABLE", why):
                self._put(point.point_id, replace(ticket, state="UNREACHABLE", reason=why))
            elif not why and ticket.state == "UNREACHABLE":
                self._put(point.point_id, replace(ticket, state="ACCEPTED", reason=None))
            else:
                continue
            changed = True
        if changed:
            self.sort()
        return changed

    def hold(self, order: tuple[str, ...]) -> None:
        """Put these accepted points first, in this order, until called with none; people can still change it."""
        if self.order.hold(order):
            self.sort()

    def begin_cut(self, point_id: str, cut_id: str) -> int:
        """ACCEPTED → CUTTING: the blades are about to move. Returns the number of its record."""
        self._put(point_id, replace(self._tickets[point_id], state="CUTTING", cut_id=cut_id, reason=reasons.cutting()))
        return self._journal.number

    def recorded(self, number: int) -> bool:
        """Is the record of this number durable?"""
        return self._journal.holds(number)

    def resolve(self, point_id: str, state: PointState, reason: Reason) -> None:
        """End of a point's work: DONE, FAILED_NOT_CUT or UNKNOWN."""
        self._put(point_id, replace(self._tickets[point_id], state=state, reason=reason))

    def again(self, point_id: str, reason: Reason) -> None:
        """Still or again ACCEPTED: it stands, and is cut as it was accepted."""
        self._put(point_id, replace(self._tickets[point_id], state="ACCEPTED", reason=reason))

    def put_off(self, point_id: str, tried: Tried, again: Reason, why: Reason) -> Reason:
        """A try has come to nothing: the cut stays accepted, for another try after the others; the last one ends it.

        Args:
            point_id: Of the point.
            tried: The try.
            again: Reason while it is to be tried again.
            why: Reason where it was the last try.

        Returns:
            What is logged.
        """
        last = self.last_try(point_id)
        self.tries.put(point_id, (*self.tries.of(point_id), tried))
        if last:
            return self.give_up(point_id, why)
        self.again(point_id, again)
        self.sort()
        return reasons.cut_ended(point_id, again)

    def last_try(self, point_id: str) -> bool:
        """Whether a cut is not tried again where the present try comes to nothing."""
        return len(self.tries.of(point_id)) + 1 >= self._most_tries

    def give_up(self, point_id: str, why: Reason) -> Reason:
        """ACCEPTED → FAILED_NOT_CUT, without another try. Returns the line of the log."""
        why = self._after_tries(point_id, why)
        self.resolve(point_id, "FAILED_NOT_CUT", why)
        return reasons.point_not_cut(point_id, why)

    def _after_tries(self, point_id: str, why: Reason) -> Reason:
        """The reason why a cut is not made, with how often it was tried."""
        tries = len(self.tries.of(point_id))
        return reasons.given_up_after(tries, why) if tries and self._most_tries > 1 else why

    def void(self, point_id: str, why: Reason) -> None:
        """ACCEPTED or UNREACHABLE → PROPOSED: the point differs from the accepted one."""
        self._put(point_id, self._void(self._tickets[point_id], why, []))

    def restore(self, rows: Iterable[TicketRow]) -> None:
        """Restore the points of an earlier start. A point is workable after perception has reported it again."""
        for row in rows:
            if row.state == "WITHDRAWN" or row.state == "PROPOSED":
                continue
            point_id = row.point.point_id
            self._tickets[point_id] = Ticket(
                row.point,
                row.state,
                row.reason,
                row.user,
                row.accepted,
                row.hash,
                row.cut_id,
                seen=False,
                proposer=row.proposer,
                wrong_by=row.wrong_by,
            )
            self._order.append(point_id)
            if row.state == "CUTTING":
                self.resolve(point_id, "UNKNOWN", reasons.interrupted())
            elif row.state in BOUND and (row.accepted is None or point_digest(row.accepted) != row.hash):
                self._put(
                    point_id,
                    replace(self._tickets[point_id], state="REJECTED", reason=reasons.record_damaged(), accepted=None),
                )
            elif row.state in BOUND:
                # A point that was unreachable from the earlier robot pose is for the next plan to decide.
                self._put(
                    point_id,
                    replace(self._tickets[point_id], state="ACCEPTED", reason=reasons.accepted_before_restart()),
                )
        self.sort()

    def decide(self, point_id: str, outcome: PointState, user: str, reason: str) -> Reason | None:
        """Set the outcome of an UNKNOWN cut after an inspection. Returns the reason of a refusal; None if done."""
        ticket = self._tickets.get(point_id)
        if ticket is None:
            return reasons.point_unknown(point_id)
        if ticket.state not in POINT_STATES["ResolvePoint"]:
            return reasons.outcome_known(point_id, ticket.state)
        self._put(point_id, replace(ticket, state=outcome, reason=reasons.inspected(user, reason)))
        return None

    def judge(self, point_id: str, wrong: bool, user: str) -> Reason | None:
        """Note that a finished cut was wrong, or right after all. Returns the reason of a refusal; None if done."""
        ticket = self._tickets.get(point_id)
        if ticket is None:
            return reasons.point_unknown(point_id)
        if ticket.state not in POINT_STATES["JudgeCut"]:
            return reasons.point_state(point_id, ticket.state)
        if wrong != bool(ticket.wrong_by):
            self._put(point_id, replace(ticket, wrong_by=user if wrong else ""))
        return None

    def entries(self) -> tuple[QueueEntry, ...]:
        """Every point in the order of work, for the wire."""
        if self._entries is None:
            self._entries = tuple(_entry(self._tickets[i], self.approaches.of(i)) for i in self._order)
        return self._entries

    @staticmethod
    def _changed(ticket: Ticket) -> Reason | None:
        """Why the acceptance of a ticket is void: its point is another cut, or cannot be told from another."""
        if ticket.state not in BOUND or ticket.accepted is None:
            return None
        if ticket.point.nodes_kept != ticket.accepted.nodes_kept:
            return reasons.other_nodes_kept(ticket.accepted.nodes_kept, ticket.point.nodes_kept)
        if not ticket.bound:
            moved = _apart(ticket.point, ticket.accepted)
            if moved > _SAME_PLACE:
                return reasons.moved_over_restart(1e3 * moved)
        elif identity(ticket.point) != ticket.bound:
            return reasons.other_cane()
        turned = float(np.clip(abs(np.dot(ticket.point.tangent, ticket.accepted.tangent)), 0.0, 1.0))
        if np.arccos(turned) > _TURNED_TOLERANCE:
            return reasons.turned_after_acceptance(float(np.degrees(np.arccos(turned))))
        return None

    def _void(self, ticket: Ticket, why: Reason, voided: list[Reason]) -> Ticket:
        void = reasons.acceptance_void(why)
        voided.append(reasons.acceptance_lost(ticket.point.point_id, void))
        return replace(ticket, state="PROPOSED", reason=void, accepted=None, hash="", bound=())

    def move(self, point_id: str, before: str, revision: int, user: str) -> Reason | None:
        """Move an accepted point in the order of work. Returns the reason of a refusal; None if done.

        Args:
            point_id: What is moved.
            before: The point that follows it; empty for the end.
            revision: Revision of the order that the operator saw.
            user: Who moves it.
        """
        for name in (point_id, before):
            ticket = self._tickets.get(name)
            if ticket is not None and ticket.state == "UNREACHABLE" and ticket.reason is not None:
                return reasons.unreachable_in_order(name, ticket.reason)
        accepted = [name for name in self._order if self._tickets[name].state == "ACCEPTED"]
        if why := self.order.move(point_id, before, revision, user, accepted):
            return why
        self.sort()
        return None

    def turn(self, point_id: str, azimuth: float | None, user: str) -> Reason | None:
        """Set the turn of the approach (rad); None leaves it to the search. Returns the reason of a refusal."""
        ticket = self._tickets.get(point_id)
        if ticket is None:
            return reasons.point_unknown(point_id)
        if ticket.state not in POINT_STATES["SetApproach"]:
            return reasons.point_state(point_id, ticket.state)
        self._entries = None
        why = self.approaches.turn(point_id, azimuth, user)
        if not why:
            self.tries.put(point_id, ())
        if not why and ticket.state == "UNREACHABLE":
            # Another approach may reach it; the next plan decides.
            self._put(point_id, replace(ticket, state="ACCEPTED", reason=None))
        return why

    def sort(self) -> None:
        """Sort all points into the order of work."""
        along = sorted(self._order, key=self._place)
        put_off = {name for name, _ in self.tries.made}
        order = self.order.arranged(along, lambda name: self._tickets[name].state == "ACCEPTED", put_off)
        if order != self._order:
            self._order, self._entries = order, None

    def _place(self, point_id: str) -> tuple[float, str]:
        ticket = self._tickets[point_id]
        at: Array = np.array((ticket.accepted or ticket.point).position)
        return float(at @ self._along), point_id

    def _put(self, point_id: str, ticket: Ticket) -> None:
        if point_id not in self._tickets:
            self._order.append(point_id)
        before = self._tickets.get(point_id)
        if before != ticket:
            self._entries = None
        if ticket.state not in {*BOUND, "CUTTING"}:
            self.tries.put(point_id, ())
        if before is None or _recorded(before) != _recorded(ticket):
            self._record(point_id, ticket, ticket.state)
        self._tickets[point_id] = ticket

    def _record(self, point_id: str, ticket: Ticket, state: PointState | Literal["WITHDRAWN"]) -> None:
        row = TicketRow(
            point=ticket.point,
            state=state,
            reason=ticket.reason,
            user=ticket.user,
            accepted=ticket.accepted,
            hash=ticket.hash,
            cut_id=ticket.cut_id,
            proposer=ticket.proposer,
            wrong_by=ticket.wrong_by,
        )
        self._journal.add("ticket", point_id, row)

    def _drop(self, point_id: str) -> None:
        self._record(point_id, self._tickets.pop(point_id), "WITHDRAWN")
        self._order.remove(point_id)
        self._entries = None


def _proposer(point: PruningPoint, told: PruningPoints) -> str:
    return "" if point.kind == "by hand" else told.segmenter


def _apart(one: PruningPoint, other: PruningPoint) -> float:
    """Distance of two points (m)."""
    return float(np.linalg.norm(np.subtract(one.position, other.position)))


def _described(rule: PruningRule) -> Reason:
    thick, past = 1e3 * rule.preferred_diameter, 1e3 * rule.offset
    if rule.system == "guyot":
        return reasons.guyot_rule(rule.nodes_kept, rule.fruiting_nodes, thick, past)
    return reasons.spur_rule(rule.nodes_kept, thick, past)


def _with_shift(ticket: Ticket) -> Ticket:
    """The ticket with a remark on how far from the accepted place its cut is seen now, where that is far."""
    if ticket.state != "ACCEPTED" or ticket.accepted is None:
        return ticket
    if ticket.reason is not None and ticket.reason.code != reasons.seen_elsewhere(0.0).code:
        return ticket
    moved = _apart(ticket.point, ticket.accepted)
    return replace(ticket, reason=reasons.seen_elsewhere(1.0 * round(1e3 * moved)) if moved > TOLD_MOVED else None)


def _by_rule(known: Ticket, point: PruningPoint, rule: Reason) -> Reason | None:
    """Why an acceptance is void where another rule has come into force; None where it asks for the same cut."""
    if known.state not in BOUND or (point.revision, point.digest) == (known.point.revision, known.point.digest):
        return None
    moved = 1e3 * _apart(known.point, point)
    return reasons.rule_cuts_elsewhere(rule, moved) if moved >= 1.0 else reasons.rule_cuts_otherwise(rule)


def _recorded(ticket: Ticket) -> tuple[object, ...]:
    """The fields of a ticket whose changes are recorded."""
    return ticket.state, ticket.user, ticket.accepted, ticket.cut_id, ticket.point.revision, ticket.wrong_by


def _entry(ticket: Ticket, azimuth: float | None) -> QueueEntry:
    return QueueEntry(
        point_id=ticket.point.point_id,
        state=ticket.state,
        reason=ticket.reason,
        user=ticket.user,
        cut_id=ticket.cut_id,
        accepted_position=None if ticket.accepted is None else ticket.accepted.position,
        digest="" if ticket.accepted is None else ticket.accepted.digest,
        azimuth=azimuth,
        recorded=ticket.point if not ticket.seen and ticket.state in _ASKED else None,
    )


class QueueRequests:
    """Decisions about points; each ends with the queue in order."""

    def __init__(self, queue: PointQueue, event_log: EventLogger) -> None:
        """Bind the queue and the log."""
        self._queue, self._event_log = queue, event_log

    def handlers(self) -> Handlers:
        """Handler of each decision; it returns the reason of a refusal, None if done."""
        queue = self._queue
        decide: Handlers = {
            intents.AcceptPoint: lambda asked, _: queue.accept(
                asked.point_id, asked.revision, asked.user, asked.digest
            ),
            intents.RejectPoint: lambda asked, _: queue.reject(asked.point_id, asked.user, asked.reason),
            intents.ReconsiderPoint: lambda asked, _: queue.reconsider(asked.point_id, asked.user),
            intents.RestoreAccepted: lambda asked, _: queue.undo_rule(asked.rule),
            intents.ResolvePoint: lambda asked, _: queue.decide(
                asked.point_id, asked.outcome, asked.user, asked.reason
            ),
            intents.JudgeCut: lambda asked, _: queue.judge(asked.point_id, asked.wrong, asked.user),
            intents.AcceptAll: lambda asked, _: self._accept_all(asked),
            intents.MoveInQueue: lambda asked, _: queue.move(asked.point_id, asked.before, asked.revision, asked.user),
            intents.SetApproach: lambda asked, _: queue.turn(asked.point_id, asked.azimuth, asked.user),
            intents.ResetOrder: lambda asked, _: queue.order.give_back(asked.revision),
        }
        return {message: self._sorted(handler) for message, handler in decide.items()}

    def _sorted(self, handler: Handler) -> Handler:
        def handle(asked: Any, now: float) -> Reason | None:
            refused = handler(asked, now)
            self._queue.sort()
            return refused

        return handle

    def _accept_all(self, asked: intents.AcceptAll) -> Reason | None:
        if (refused := self._queue.none_acceptable(asked.confidence)) is not None:
            return refused
        points = self._queue.proposed(asked.confidence)
        answers = [self._queue.accept(point.point_id, point.revision, asked.user, point.digest) for point in points]
        self._event_log.log(reasons.points_accepted(asked.user, answers.count(None), asked.confidence))
        return None
