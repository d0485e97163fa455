"""Control authority: lease, presence and the rights of each client. Pure: `now` is an argument."""

import math
from typing import Final

from controller.identity import Client
from controller.inputs import Sample
from controller.supervision.lease import Lease
from controller.supervision.modes import Rights, Who
from rolling_panda.messages import commands as intents
from rolling_panda.messages.supervision import NEVER_SEEN_S, ControlState, Presence
from rolling_panda.messages.types import Role

#: Intents about control itself.
ABOUT_CONTROL: Final = (intents.TakeControl, intents.RequestControl, intents.GrantControl, intents.ReturnControl)


class Authority:
    """Keeps the lease by what the server says of who is there."""

    def __init__(self, supervision_s: float) -> None:
        """Nobody is there.

        Args:
            supervision_s: Automatic work goes on for so long without anybody who sees the robot (s).
        """
        self._lease = Lease()
        self._supervision_s = supervision_s
        self._newest: Sample[Presence] | None = None
        self._seen = -math.inf

    @property
    def held(self) -> bool:
        """Whether somebody holds control, and keeps it."""
        return self._lease.holder is not None and self._lease.coming is None

    def review(self, presence: Sample[Presence] | None, at_rest: bool, now: float) -> str:
        """Take in who is there. Returns why the robot must stop; empty when nobody lost control.

        Args:
            presence: Newest word of the server.
            at_rest: Whether the robot stands still.
            now: Monotonic time (s).
        """
        last = self._newest
        if presence is not None and presence is not last:
            # A number that does not grow is a repetition, unless the server was away for longer than a lease lives.
            if last is None or presence.message.sequence > last.message.sequence or presence.at - last.at > 1.0:
                self._newest = presence
                people = presence.message.people
                self._lease.renew({person.key: presence.at - person.heard_age_s for person in people})
                for person in people:
                    self._watch(person.role, person.view_age_s, presence.at)
        lost = self._lease.review(at_rest, now)
        if self._lease.coming is not None:
            lost = lost or f"{self._lease.coming.user} takes control"
        return lost

    def saw(self, intent: intents.Intent, now: float) -> None:
        """Who asks has looked; the server's next word of who is there may come after what they ask."""
        self._watch(intent.role, intent.view_age_s, now)

    def unwatched(self, now: float) -> str:
        """Why automatic work may not go on; empty while somebody who may operate has seen the robot lately."""
        age = now - self._seen
        if age <= self._supervision_s:
            return ""
        since = "yet" if age == math.inf else f"for {age:.1f} s"
        return f"nobody who may operate has seen the robot {since}, allowed are {self._supervision_s} s"

    def rights(self, client: Client, role: Role) -> Rights:
        """What a client counts as to the machine of modes. Control that nobody holds is anybody's to have."""
        out: set[Who] = {"anyone"}
        if role != "viewer":
            out.add("operator")
            if not self._lease.refusal(client):
                out.add("holder")
        if role == "supervisor":
            out.add("supervisor")
        return frozenset(out)

    def refusal(self, client: Client, role: Role) -> str:
        """Why a client may not move the robot; empty when it may."""
        return "a viewer may look and stop, not operate" if role == "viewer" else self._lease.refusal(client)

    def claim(self, client: Client, now: float) -> None:
        """Who moves a robot that nobody controls gets control of it."""
        self._lease.claim(client, now)

    def ask(self, intent: intents.Intent, now: float) -> str:
        """Take, request, grant or return control; why not, empty when done."""
        client, lease = client_of(intent), self._lease
        if intent.role == "viewer":
            return "a viewer may look and stop, not operate"
        if isinstance(intent, intents.TakeControl):
            return lease.take(client, intent.confirmed, now)
        if isinstance(intent, intents.RequestControl):
            return lease.request(client, now)
        if isinstance(intent, intents.GrantControl):
            return lease.grant(client)
        return lease.give_back(client)

    def message(self, now: float) -> ControlState:
        """For the wire."""
        lease = self._lease
        holder, requested, coming = lease.holder, lease.requested, lease.coming
        return ControlState(
            holder="" if holder is None else holder.key,
            user="" if holder is None else holder.user,
            expires_s=lease.left(now),
            requested_by="" if requested is None else requested.user,
            requested_key="" if requested is None else requested.key,
            next_user="" if coming is None else coming.user,
            notice=lease.notice[:500],
            notice_number=lease.notice_number,
            supervised=not self.unwatched(now),
        )

    def _watch(self, role: Role, view_age_s: float, at: float) -> None:
        if role != "viewer" and view_age_s < NEVER_SEEN_S:
            self._seen = max(self._seen, at - view_age_s)


def client_of(intent: intents.Intent) -> Client:
    """Who asks; where nothing else tells clients apart, the name does."""
    return Client(intent.client or intent.user, intent.user)
