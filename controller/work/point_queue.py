"""Pruning points with their states, in the order of work."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import msgspec
import numpy as np

from controller.config import WorkConfig
from controller.ledger.journal import Journal, TicketRow
from controller.work.order import Approaches, WorkOrder
from controller.work.rule_history import RuleHistory
from rolling_panda.messages.perception import PruningPoint, PruningPoints, PruningRule, point_digest
from rolling_panda.messages.supervision import QueueEntry
from rolling_panda.messages.types import PointState
from rolling_panda.model.differential_drive import Array

#: A cane that turned further than this after acceptance is not the one the operator saw (rad).
_TURNED_TOLERANCE = 0.35
#: A point id that returns at a larger distance belongs to another cane (m).
_ELSEWHERE = 0.03
_INTERRUPTED = "the controller ended before it knew whether this was cut; look, and report the outcome"
#: States in which a point is shown from the record if perception does not report it: a person has to decide.
_ASKED: frozenset[PointState] = frozenset({"ACCEPTED", "UNREACHABLE", "UNKNOWN"})
_WAITS = "accepted before a restart; waits until perception reports it again"
_UNSEEN = "perception no longer reports it"
_UNBOUND = "its record does not match its hash; accept it again"
#: States with an acceptance and no cut yet. The acceptance is valid while the point is as the operator saw it.
BOUND: frozenset[PointState] = frozenset({"ACCEPTED", "UNREACHABLE"})
_ACCEPTABLE: frozenset[PointState] = frozenset({"PROPOSED", "REJECTED", "FAILED_NOT_CUT"})


@dataclass(frozen=True)
class Ticket:
    """A point on the queue.

    Attributes:
        point: The point as last perceived.
        state: State of the point.
        reason: Reason for the state, as text.
        user: Who accepted or rejected it.
        accepted: The point that the operator saw and accepted; it is what is cut.
        hash: Hash of the accepted point.
        cut_id: Id of the last cut at the point.
        seen: Whether perception currently reports the point.
    """

    point: PruningPoint
    state: PointState = "PROPOSED"
    reason: str = ""
    user: str = ""
    accepted: PruningPoint | None = None
    hash: str = ""
    cut_id: str = ""
    seen: bool = True


class PointQueue:
    """All points by id. Every change of state has a reason and is recorded."""

    def __init__(self, config: WorkConfig, journal: Journal | None = None) -> None:
        """Start empty; changes are recorded in `journal`."""
        self._config = config
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
        self._rules: RuleHistory[Ticket] = RuleHistory()
        self._restored: list[str] = []

    def update(self, points: PruningPoints, keep: str = "") -> list[str]:
        """Update from perception's current points; returns texts of the voided acceptances.

        Args:
            points: Perception's message.
            keep: Point that the blades hide from the camera: its disappearance is ignored. If it is seen
                elsewhere than accepted, its acceptance is void like any other.
        """
        voided: list[str] = []
        change = self._rule_change(points)
        rule = "" if change is None else _rule_words(change[1])
        bound = {} if change is None else {name: each for name, each in self._tickets.items() if each.state in BOUND}
        self.perceived = points
        seen = {point.point_id for point in points.points}
        for point in points.points:
            ticket = self._tickets.get(point.point_id)
            if ticket is None:
                self._put(point.point_id, Ticket(point))
                continue
            if not ticket.seen and ticket.state not in BOUND and _apart(ticket.point, point) > _ELSEWHERE:
                # Perception restarted and numbers from one again: this id now belongs to another cane.
                former = f"{point.point_id}:{point_digest(ticket.point)[:8]}"
                self._put(former, replace(ticket, point=msgspec.structs.replace(ticket.point, point_id=former)))
                self._put(point.point_id, Ticket(point))
                continue
            if not ticket.seen and ticket.state == "ACCEPTED":
                ticket = replace(ticket, reason="")
            known, ticket = ticket, replace(ticket, point=point, seen=True)
            why = _by_rule(known, point, rule) if rule and known.seen else ""
            why = why or self._changed(ticket)
            self._put(point.point_id, self._void(ticket, why, voided) if why else ticket)
        for point_id, ticket in list(self._tickets.items()):
            if point_id in seen or point_id == keep or not ticket.seen:
                continue
            gone = replace(ticket, seen=False)
            if ticket.state in BOUND:
                why = f"the rule is {rule} now, which asks for no such cut" if rule else _UNSEEN
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
        # After a restart perception counts its frames from the beginning. Its rule is then no change by a person.
        if before is None or before.rule is None or points.rule is None or points.frames < before.frames:
            return None
        return None if points.rule == before.rule else (before.rule, points.rule)

    def undo_rule(self, rule: PruningRule) -> str:
        """Restore the acceptances that the change to `rule` made void, now or when perception reports the former rule.

        Returns:
            Why that cannot be; empty when it is done or will be.
        """
        back = self._rules.undo(rule, None if self.perceived is None else self.perceived.rule)
        if isinstance(back, str):
            return back
        self._restore(back)
        return ""

    def restored(self) -> str:
        """Text of the acceptances that the undo of a rule has restored, once; empty without any."""
        told, self._restored = ", ".join(self._restored), []
        return told

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

    def accept(self, point_id: str, revision: int, user: str, digest: str = "") -> str:
        """Accept a point as the operator saw it. Returns the reason of a refusal; empty if accepted.

        Args:
            point_id: Of the point.
            revision: Revision that the operator saw.
            user: Who accepts.
            digest: Hash of what the operator saw; empty if not given.
        """
        ticket = self._tickets.get(point_id)
        if ticket is None:
            return f"there is no point {point_id!r}"
        if ticket.state == "UNKNOWN":
            return f"it is unknown whether {point_id} is cut; look, and report the outcome first"
        if ticket.state == "UNREACHABLE":
            return f"{point_id} is accepted, and cannot be reached: {ticket.reason}"[:500]
        if ticket.state not in _ACCEPTABLE:
            return f"{point_id} is {ticket.state}"
        if not ticket.seen:
            return f"perception does not see {point_id} any more"
        if ticket.point.revision != revision:
            return f"{point_id} has changed since: revision {revision} was seen, it is {ticket.point.revision} now"
        if digest and digest != ticket.point.digest:
            return (
                f"{point_id} is not what was seen: its hash is {ticket.point.digest[:8] or 'unknown'}, not {digest[:8]}"
            )
        radius = ticket.point.radius
        if radius > self._config.largest_radius:
            limit = 2e3 * self._config.largest_radius
            return f"{point_id}: the cane is {2e3 * radius:.0f} mm thick, the limit is {limit:.0f} mm"
        self._put(
            point_id,
            replace(
                ticket, state="ACCEPTED", reason="", user=user, accepted=ticket.point, hash=point_digest(ticket.point)
            ),
        )
        return ""

    def reject(self, point_id: str, user: str, reason: str) -> str:
        """Reject a point. Returns the reason of a refusal; empty if done."""
        ticket = self._tickets.get(point_id)
        if ticket is None:
            return f"there is no point {point_id!r}"
        if ticket.state in ("CUTTING", "DONE", "UNKNOWN"):
            return f"{point_id} is {ticket.state}"
        self._put(point_id, replace(ticket, state="REJECTED", reason=reason or "rejected", user=user, accepted=None))
        return ""

    def reconsider(self, point_id: str, user: str) -> str:
        """ACCEPTED, UNREACHABLE or REJECTED → PROPOSED. Returns the reason of a refusal; empty if done."""
        ticket = self._tickets.get(point_id)
        if ticket is None:
            return f"there is no point {point_id!r}"
        if ticket.state not in {*BOUND, "REJECTED"}:
            return f"{point_id} is {ticket.state}: there is nothing to take back"
        if not ticket.seen:
            return f"perception does not see {point_id} any more"
        self._put(point_id, replace(ticket, state="PROPOSED", reason="", user=user, accepted=None, hash=""))
        return ""

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
    def waits(self) -> str:
        """Reason why no accepted point is workable; empty if one is."""
        if self.next() is not None:
            return ""
        beyond = self.count("UNREACHABLE")
        if not beyond:
            return "no point is accepted"
        return (
            "the accepted point cannot be reached"
            if beyond == 1
            else f"none of {beyond} accepted points can be reached"
        )

    def arrange(self, order: tuple[str, ...]) -> None:
        """Work in this order from now on; points that it does not name stay in their places along the row.

        Args:
            order: Ids of accepted points; none for the order along the row.
        """
        self.order.plan(order)
        self.sort()

    def reach(self, planned: Iterable[PruningPoint], refused: Mapping[str, str], busy: str = "") -> bool:
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
            why = refused.get(point.point_id, "")
            if why and (ticket.state, ticket.reason) != ("UNREACHABLE", why):
                self._put(point.point_id, replace(ticket, state="UNREACHABLE", reason=why))
            elif not why and ticket.state == "UNREACHABLE":
                self._put(point.point_id, replace(ticket, state="ACCEPTED", reason=""))
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
        self._put(point_id, replace(self._tickets[point_id], state="CUTTING", cut_id=cut_id, reason="cutting"))
        return self._journal.number

    def recorded(self, number: int) -> bool:
        """Is the record of this number durable?"""
        return self._journal.holds(number)

    def resolve(self, point_id: str, state: PointState, reason: str) -> None:
        """End of a point's work: DONE, FAILED_NOT_CUT or UNKNOWN."""
        self._put(point_id, replace(self._tickets[point_id], state=state, reason=reason))

    def again(self, point_id: str, reason: str) -> None:
        """CUTTING → ACCEPTED: it stands after a cut, and is cut once more as it was accepted."""
        self._put(point_id, replace(self._tickets[point_id], state="ACCEPTED", reason=reason))

    def void(self, point_id: str, why: str) -> None:
        """ACCEPTED or UNREACHABLE → PROPOSED: the point differs from the accepted one."""
        self._put(point_id, self._void(self._tickets[point_id], why, []))

    def restore(self, rows: Iterable[TicketRow]) -> None:
        """Restore the points of an earlier start. A point is workable after perception has reported it again."""
        for row in rows:
            if row.state == "WITHDRAWN" or row.state == "PROPOSED":
                continue
            point_id = row.point.point_id
            self._tickets[point_id] = Ticket(
                row.point, row.state, row.reason, row.user, row.accepted, row.hash, row.cut_id, seen=False
            )
            self._order.append(point_id)
            if row.state == "CUTTING":
                self.resolve(point_id, "UNKNOWN", _INTERRUPTED)
            elif row.state in BOUND and (row.accepted is None or point_digest(row.accepted) != row.hash):
                self._put(point_id, replace(self._tickets[point_id], state="REJECTED", reason=_UNBOUND, accepted=None))
            elif row.state in BOUND:
                # A point that was unreachable from the earlier robot pose is for the next plan to decide.
                self._put(point_id, replace(self._tickets[point_id], state="ACCEPTED", reason=_WAITS))
        self.sort()

    def decide(self, point_id: str, outcome: PointState, user: str, reason: str) -> str:
        """Set the outcome of an UNKNOWN cut after an inspection. Returns the reason of a refusal; empty if done."""
        ticket = self._tickets.get(point_id)
        if ticket is None:
            return f"there is no point {point_id!r}"
        if ticket.state != "UNKNOWN":
            return f"how {point_id} ended is not in question: it is {ticket.state}"
        self._put(point_id, replace(ticket, state=outcome, reason=f"{user} looked: {reason}"[:500]))
        return ""

    def entries(self) -> tuple[QueueEntry, ...]:
        """Every point in the order of work, for the wire."""
        if self._entries is None:
            self._entries = tuple(_entry(self._tickets[i], self.approaches.of(i)) for i in self._order)
        return self._entries

    def _changed(self, ticket: Ticket) -> str:
        if ticket.state not in BOUND or ticket.accepted is None:
            return ""
        moved = _apart(ticket.point, ticket.accepted)
        if moved > self._config.moved_tolerance:
            return f"it moved by {1e3 * moved:.0f} mm after it was accepted"
        turned = float(np.clip(abs(np.dot(ticket.point.tangent, ticket.accepted.tangent)), 0.0, 1.0))
        if np.arccos(turned) > _TURNED_TOLERANCE:
            return f"its cane turned by {np.degrees(np.arccos(turned)):.0f}° after it was accepted"
        return ""

    def _void(self, ticket: Ticket, why: str, voided: list[str]) -> Ticket:
        text = f"acceptance void: {why}"
        voided.append(f"{ticket.point.point_id}: {text}")
        return replace(ticket, state="PROPOSED", reason=text, accepted=None, hash="")

    def move(self, point_id: str, before: str, revision: int, user: str) -> str:
        """Move an accepted point in the order of work. Returns the reason of a refusal; empty if done.

        Args:
            point_id: What is moved.
            before: The point that follows it; empty for the end.
            revision: Revision of the order that the operator saw.
            user: Who moves it.
        """
        for name in (point_id, before):
            ticket = self._tickets.get(name)
            if ticket is not None and ticket.state == "UNREACHABLE":
                return f"{name} cannot be reached, so it has no place in the order of work: {ticket.reason}"[:500]
        accepted = [name for name in self._order if self._tickets[name].state == "ACCEPTED"]
        return self.order.move(point_id, before, revision, user, accepted) or self.sort()

    def turn(self, point_id: str, azimuth: float | None, user: str) -> str:
        """Set the turn of the approach (rad); None leaves it to the search. Returns the reason of a refusal."""
        ticket = self._tickets.get(point_id)
        if ticket is None:
            return f"there is no point {point_id!r}"
        if ticket.state in ("CUTTING", "DONE", "UNKNOWN"):
            return f"{point_id} is {ticket.state}"
        self._entries = None
        why = self.approaches.turn(point_id, azimuth, user)
        if not why and ticket.state == "UNREACHABLE":
            # Another approach may reach it; the next plan decides.
            self._put(point_id, replace(ticket, state="ACCEPTED", reason=""))
        return why

    def sort(self) -> str:
        """Sort all points into the order of work. It never fails."""
        along = sorted(self._order, key=self._place)
        order = self.order.arranged(along, lambda name: self._tickets[name].state == "ACCEPTED")
        if order != self._order:
            self._order, self._entries = order, None
        return ""

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
        )
        self._journal.add("ticket", point_id, row)

    def _drop(self, point_id: str) -> None:
        self._record(point_id, self._tickets.pop(point_id), "WITHDRAWN")
        self._order.remove(point_id)
        self._entries = None


def _apart(one: PruningPoint, other: PruningPoint) -> float:
    """Distance of two points (m)."""
    return float(np.linalg.norm(np.subtract(one.position, other.position)))


def _rule_words(rule: PruningRule) -> str:
    """A rule's numbers for people."""
    count = f"{rule.nodes_kept} + {rule.fruiting_nodes}" if rule.system == "guyot" else f"{rule.nodes_kept}"
    nodes = "1 node" if count == "1" else f"{count} nodes"
    thick, past = 1e3 * rule.preferred_diameter, 1e3 * rule.offset
    return f"{rule.system.capitalize()}, {nodes}, from {thick:g} mm, {past:.0f} mm past"


def _by_rule(known: Ticket, point: PruningPoint, rule: str) -> str:
    """Why an acceptance is void where another rule has come into force; empty where it asks for the same cut."""
    if known.state not in BOUND or (point.revision, point.digest) == (known.point.revision, known.point.digest):
        return ""
    moved = 1e3 * _apart(known.point, point)
    return f"the rule is {rule} now, which cuts {f'{moved:.0f} mm away' if moved >= 1.0 else 'otherwise here'}"


def _recorded(ticket: Ticket) -> tuple[object, ...]:
    """The fields of a ticket whose changes are recorded."""
    return ticket.state, ticket.user, ticket.accepted, ticket.cut_id, ticket.point.revision


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
