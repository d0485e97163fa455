"""The lease of control: one holder at a time, valid while it is renewed. Pure: `now` is an argument."""

import math
from collections.abc import Mapping
from typing import Final

from controller.identity import Client

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
        self.notice = self._lost = ""
        self.notice_number = 0

    def held_by(self, client: Client) -> bool:
        """Whether this client has control and no transfer is pending."""
        return self.next_holder is None and self.holder is not None and self.holder.key == client.key

    def refusal(self, client: Client) -> str:
        """Reason why a client may not move the robot or claim control; empty if it may."""
        if self.next_holder is not None:
            return f"control passes to {self.next_holder.user}; wait until the robot is at rest"
        if self.holder is None or self.holder.key == client.key:
            return ""
        return f"{self.holder.user} holds control of this robot; ask for it, or take it"

    def claim(self, client: Client, now: float) -> None:
        """Give control to a client that `refusal` lets through; the robot is at rest."""
        if self.holder is None:
            self._give(client, now, f"{client.user} holds control")

    def take(self, client: Client, confirmed: bool) -> str:
        """Take control; from a holder only if confirmed. Returns the reason of a refusal; empty if granted."""
        if self.held_by(client):
            return ""
        if self.next_holder is not None and self.next_holder.key != client.key:
            return f"{self.next_holder.user} is taking control already"
        if self.holder is not None and not confirmed:
            return f"{self.holder.user} holds control; confirm to take it from them: the robot stops first"
        self.next_holder = client
        return ""

    def request(self, client: Client, now: float) -> str:
        """Ask the holder for control. Returns the reason of a refusal; empty if asked."""
        if self.holder is None:
            return "nobody holds control: take it"
        if self.holder.key == client.key:
            return "you hold control already"
        if self.requested is not None and self.requested.key != client.key:
            return f"{self.requested.user} has asked already"
        self.requested, self._asked = client, now
        self._notify(f"{client.user} asks {self.holder.user} for control")
        return ""

    def grant(self, client: Client) -> str:
        """Grant control to the client that has asked. Returns the reason of a refusal; empty if granted."""
        if not self.held_by(client):
            return "only the person in control can grant it"
        if self.requested is None:
            return "nobody asks for control"
        self.next_holder = self.requested
        return ""

    def give_back(self, client: Client) -> str:
        """Give up control. Returns the reason of a refusal; empty if done."""
        if self.holder is None or self.holder.key != client.key:
            return "you do not hold control"
        self._lost = f"{client.user} gave control back"
        self._drop(self._lost)
        return ""

    def renew(self, heard: Mapping[str, float]) -> None:
        """When (s) each client, by its key, said something last: the holder's lease lives from then on."""
        if self.holder is not None:
            self._renewed = max(self._renewed, heard.get(self.holder.key, -math.inf))

    def review(self, at_rest: bool, now: float) -> str:
        """Update at a time. Returns the reason why the holder lost control; empty without one.

        Args:
            at_rest: Whether the robot is at rest, so that control may change hands.
            now: Monotonic time (s).
        """
        if self.requested is not None and now - self._asked > _REQUEST_S:
            self.requested = None
        lost, self._lost = self._lost, ""
        if self.holder is not None and self.left(now) <= 0.0:
            lost = f"control by {self.holder.user} has ended: nothing was heard from them for {LIFE_S:.0f} s"
            self._drop(lost)
        if self.next_holder is not None and at_rest:
            before, client = self.holder, self.next_holder
            self._give(client, now, f"{client.user} holds control{f', before {before.user}' if before else ''}")
        return lost

    def left(self, now: float) -> float:
        """Time to the end of the lease without a message of its holder (s); 0 without a holder."""
        return 0.0 if self.holder is None else max(0.0, self._renewed + LIFE_S - now)

    def _give(self, client: Client, now: float, told: str) -> None:
        self.holder, self.next_holder, self._renewed = client, None, now
        if self.requested is not None and self.requested.key == client.key:
            self.requested = None
        self._notify(told)

    def _drop(self, told: str) -> None:
        self.holder = self.requested = None
        self._notify(told)

    def _notify(self, told: str) -> None:
        self.notice, self.notice_number = told, self.notice_number + 1
