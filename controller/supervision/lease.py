"""The lease of control: one holder at a time, valid while it is renewed. Pure: `now` is an argument."""

import math
from collections.abc import Mapping
from typing import Final

from controller.identity import Client
from rolling_panda import reasons
from rolling_panda.messages.types import Reason

#: The lease ends this long after the holder's last message (s).
LIFE_S: Final = 1.0
#: Lifetime of an unanswered request for control (s).
_REQUEST_S: Final = 30.0


class Lease:
    """The lease. Control changes hands only when the robot is at rest; until then the holder keeps it."""

    def __init__(self) -> None:
        """Nobody holds control."""
        self._renewed = self._asked = -math.inf
        self.holder: Client | None = None
        self.next_holder: Client | None = None
        self.requested: Client | None = None
        self.notice: Reason | None = None
        self._lost: Reason | None = None
        self.notice_number = 0

    def held_by(self, client: Client) -> bool:
        """Whether this client has control and no transfer is pending."""
        return self.next_holder is None and self.holder is not None and self.holder.key == client.key

    def refusal(self, client: Client) -> Reason | None:
        """Reason why a client may not move the robot or claim control; None if it may."""
        if self.next_holder is not None:
            return reasons.control_passes(self.next_holder.user)
        if self.holder is None or self.holder.key == client.key:
            return None
        return reasons.control_held(self.holder.user)

    def claim(self, client: Client, now: float) -> None:
        """Give control to a client that `refusal` lets through; the robot is at rest."""
        if self.holder is None:
            self._give(client, now, reasons.control_given(client.user))

    def take(self, client: Client, confirmed: bool) -> Reason | None:
        """Take control; from a holder only if confirmed. Returns the reason of a refusal; None if granted."""
        if self.held_by(client):
            return None
        if self.next_holder is not None and self.next_holder.key != client.key:
            return reasons.control_being_taken(self.next_holder.user)
        if self.holder is not None and not confirmed:
            return reasons.control_unconfirmed(self.holder.user)
        self.next_holder = client
        return None

    def request(self, client: Client, now: float) -> Reason | None:
        """Ask the holder for control. Returns the reason of a refusal; None if asked."""
        if self.holder is None:
            return reasons.control_free()
        if self.holder.key == client.key:
            return reasons.control_yours()
        if self.requested is not None and self.requested.key != client.key:
            return reasons.control_requested(self.requested.user)
        self.requested, self._asked = client, now
        self._notify(reasons.control_asked(client.user, self.holder.user))
        return None

    def grant(self, client: Client) -> Reason | None:
        """Grant control to the client that has asked. Returns the reason of a refusal; None if granted."""
        if not self.held_by(client):
            return reasons.control_not_yours()
        if self.requested is None:
            return reasons.control_not_requested()
        self.next_holder = self.requested
        return None

    def give_back(self, client: Client) -> Reason | None:
        """Give up control. Returns the reason of a refusal; None if done."""
        if self.holder is None or self.holder.key != client.key:
            return reasons.control_not_yours()
        self._lost = reasons.control_returned(client.user)
        self._drop(self._lost)
        return None

    def renew(self, heard: Mapping[str, float]) -> None:
        """When (s) each client, by its key, said something last: the holder's lease lives from then on."""
        if self.holder is not None:
            self._renewed = max(self._renewed, heard.get(self.holder.key, -math.inf))

    def review(self, at_rest: bool, now: float) -> Reason | None:
        """Update at a time. Returns the reason why the holder lost control; None without one.

        Args:
            at_rest: Whether the robot is at rest, so that control may change hands.
            now: Monotonic time (s).
        """
        if self.requested is not None and self.holder is not None and now - self._asked > _REQUEST_S:
            self._notify(reasons.control_unanswered(self.requested.user, self.holder.user))
            self.requested = None
        lost, self._lost = self._lost, None
        if self.holder is not None and self.left(now) <= 0.0:
            lost = reasons.control_lapsed(self.holder.user, LIFE_S)
            self._drop(lost)
        if self.next_holder is not None and at_rest:
            before, client = self.holder, self.next_holder
            given, over = reasons.control_given, reasons.control_given_over
            self._give(client, now, given(client.user) if before is None else over(client.user, before.user))
        return lost

    def left(self, now: float) -> float:
        """Time to the end of the lease without a message of its holder (s); 0 without a holder."""
        return 0.0 if self.holder is None else max(0.0, self._renewed + LIFE_S - now)

    def _give(self, client: Client, now: float, told: Reason) -> None:
        self.holder, self.next_holder, self._renewed = client, None, now
        if self.requested is not None and self.requested.key == client.key:
            self.requested = None
        self._notify(told)

    def _drop(self, told: Reason) -> None:
        self.holder = self.requested = None
        self._notify(told)

    def _notify(self, told: Reason) -> None:
        self.notice, self.notice_number = told, self.notice_number + 1
