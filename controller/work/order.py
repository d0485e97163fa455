"""Joins the order that operators want with the planner's, and keeps the approach directions that they have chosen."""

import math
from collections.abc import Callable, Collection, Sequence

from controller.ledger.journal import ApproachRow, Journal, OrderRow
from rolling_panda import reasons
from rolling_panda.messages.supervision import QueueOrder
from rolling_panda.messages.types import Reason


class WorkOrder:
    """The order of work. Changes by people are numbered, so that concurrent changes do not overwrite each other."""

    def __init__(self, journal: Journal) -> None:
        """Along the row; changes by people are recorded in `journal`."""
        self._journal = journal
        self._by_hand: tuple[str, ...] = ()
        self._planned: tuple[str, ...] = ()
        self._held: tuple[str, ...] = ()
        self._state = QueueOrder()

    @property
    def state(self) -> QueueOrder:
        """For the wire."""
        return self._state

    @property
    def by_hand(self) -> tuple[str, ...]:
        """Points in the order set by people; empty for the plan's order."""
        return self._by_hand

    def restore(self, row: OrderRow) -> None:
        """Take up the order of an earlier start."""
        self._by_hand, self._state = row.order, QueueOrder(row.revision, row.user)

    def plan(self, order: tuple[str, ...]) -> None:
        """The plan works in this order; none, and it is that along the row."""
        self._planned = order

    def hold(self, order: tuple[str, ...]) -> bool:
        """Put these points first, whatever the plan; people can still change it. Returns whether it is a change."""
        changed = order != self._held
        self._held = order
        return changed

    def move(self, point_id: str, before: str, revision: int, user: str, accepted: Sequence[str]) -> Reason | None:
        """Move a point before another one, or to the end. Returns the reason of a refusal; None if done.

        Args:
            point_id: The point.
            before: The point that follows it; empty for the end.
            revision: Revision of the order that the operator saw.
            user: Who moves it.
            accepted: Accepted points in their current order.
        """
        if why := self._outdated(revision):
            return why
        for name in (point_id, before):
            if name and name not in accepted:
                return reasons.not_in_order(name)
        if point_id == before:
            return reasons.before_itself(point_id)
        order = [name for name in accepted if name != point_id]
        order.insert(order.index(before) if before else len(order), point_id)
        self._change(tuple(order), user)
        return None

    @property
    def reset_refused(self) -> Reason | None:
        """Reason why there is no order by hand to reset; None if there is one."""
        return None if self._by_hand else reasons.order_of_plan()

    def give_back(self, revision: int) -> Reason | None:
        """Return from an order by hand to the plan's. Returns the reason of a refusal; None if done."""
        if why := self._outdated(revision):
            return why
        self._change((), "")
        return None

    def arranged(self, along: Sequence[str], accepted: Callable[[str], bool], last: Collection[str] = ()) -> list[str]:
        """All points in their order.

        By hand or held, those that people have not seen in their order come after it. By plan, accepted points that it
        does not name stay in their places along the row.

        Args:
            along: All points along the row.
            accepted: Whether a point is accepted.
            last: Points that come last unless people have put them elsewhere.
        """
        places = [name for name in along if accepted(name)]
        known = set(places)
        wanted = [name for name in self._planned if name in known]
        lead = [*self._by_hand, *(name for name in self._held if name not in self._by_hand)]
        if lead or last:
            among = set(wanted)
            following = iter(wanted)
            planned = [next(following) if name in among else name for name in places]
            first = [name for name in lead if name in known]
            begun = set(first)
            planned.sort(key=lambda name: name in last)
            wanted = [*first, *(name for name in planned if name not in begun)]
        among = set(wanted)
        following = iter(wanted)
        return [next(following) if name in among else name for name in along]

    def _outdated(self, revision: int) -> Reason | None:
        state = self._state
        if revision == state.revision:
            return None
        if state.user:
            return reasons.order_changed_by(state.user, revision, state.revision)
        return reasons.order_changed(revision, state.revision)

    def _change(self, order: tuple[str, ...], user: str) -> None:
        self._by_hand, self._state = order, QueueOrder(self._state.revision + 1, user)
        self._journal.add("order", "order", OrderRow(order=order, revision=self._state.revision, user=user))


#: Largest turn of the approach (rad): beyond it the tool would approach along the row or from behind.
LARGEST = math.radians(75.0)


class Approaches:
    """Requested approach directions by point. For other points the posture search chooses."""

    def __init__(self, journal: Journal) -> None:
        """Start without requested approaches; later ones are recorded in `journal`."""
        self._journal = journal
        self._turned: dict[str, float] = {}
        self._told: tuple[tuple[str, float], ...] = ()

    @property
    def turned(self) -> tuple[tuple[str, float], ...]:
        """Points and turns (rad), by id; the same object until one changes."""
        return self._told

    def of(self, point_id: str) -> float | None:
        """Turn about the cane that is wanted for a point (rad); None leaves it to the search."""
        return self._turned.get(point_id)

    def restore(self, rows: tuple[tuple[str, ApproachRow], ...]) -> None:
        """Restore the state of an earlier start."""
        for point_id, row in rows:
            self._put(point_id, row.azimuth)

    def turn(self, point_id: str, azimuth: float | None, user: str) -> Reason | None:
        """Set the approach of a point. Returns the reason of a refusal; None if done."""
        if azimuth is not None and not abs(azimuth) <= LARGEST:
            return reasons.approach_too_far(math.degrees(azimuth), math.degrees(LARGEST))
        self._put(point_id, azimuth)
        self._journal.add("approach", point_id, ApproachRow(azimuth=azimuth, user=user))
        return None

    def _put(self, point_id: str, azimuth: float | None) -> None:
        if azimuth is None:
            self._turned.pop(point_id, None)
        else:
            self._turned[point_id] = azimuth
        self._told = tuple(sorted(self._turned.items()))
