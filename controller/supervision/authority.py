"""Control authority: lease, presence and the rights of each client. Pure: `now` is an argument."""

import math

from controller.identity import Client
from controller.supervision.lease import Lease
from controller.supervision.modes import Rights, Who
from rolling_panda import commands as intents
from rolling_panda import reasons
from rolling_panda.commands import Handlers
from rolling_panda.messages.supervision import NEVER_SEEN_S, ControlState, Presence
from rolling_panda.messages.types import Reason, Role
from rolling_panda.transport.inbox import Received


class Authority:
    """Renews the lease from the presence messages of the server."""

    def __init__(self, supervision_s: float) -> None:
        """Start without a holder.

        Args:
            supervision_s: Time for which automatic work continues without a person who sees the robot (s).
        """
        self._lease = Lease()
        self._supervision_s = supervision_s
        self._newest: Received[Presence] | None = None
        self._seen = -math.inf

    @property
    def held(self) -> bool:
        """Whether a person has control and no transfer is pending."""
        return self._lease.holder is not None and self._lease.next_holder is None

    def review(self, presence: Received[Presence] | None, at_rest: bool, now: float) -> Reason | None:
        """Update the lease. Returns the reason why the robot must stop; None without one.

        Args:
            presence: Newest presence message.
            at_rest: Whether the robot is at rest.
            now: Monotonic time (s).
        """
        last = self._newest
        if presence is not None and presence is not last:
            # A sequence that does not increase is a repetition, unless the server restarted: a silence longer than the
            # lease.
            if last is None or presence.message.sequence > last.message.sequence or presence.at - last.at > 1.0:
                self._newest = presence
                people = presence.message.people
                self._lease.renew({person.key: presence.at - person.heard_age_s for person in people})
                for person in people:
                    self._watch(person.role, person.view_age_s, presence.at)
        lost = self._lease.review(at_rest, now)
        if self._lease.next_holder is not None:
            lost = lost or reasons.control_taken(self._lease.next_holder.user)
        return lost

    def saw(self, intent: intents.Intent, now: float) -> None:
        """Count the view age of an intent; the next presence message may arrive after the intent."""
        self._watch(intent.role, intent.view_age_s, now)

    def unwatched(self, now: float) -> Reason | None:
        """Why automatic work must pause; None while an operator has seen the robot recently."""
        age = now - self._seen
        if age <= self._supervision_s:
            return None
        if age == math.inf:
            return reasons.never_watched(self._supervision_s)
        return reasons.unwatched(age, self._supervision_s)

    def rights(self, client: Client, role: Role) -> Rights:
        """Rights of a client in the mode table. Without a holder every operator counts as the holder."""
        out: set[Who] = {"anyone"}
        if role != "viewer":
            out.add("operator")
            if not self._lease.refusal(client):
                out.add("holder")
        if role == "supervisor":
            out.add("supervisor")
        return frozenset(out)

    def refusal(self, client: Client, role: Role) -> Reason | None:
        """Reason why a client may not move the robot; None if it may."""
        return reasons.viewer_only() if role == "viewer" else self._lease.refusal(client)

    def claim(self, client: Client, now: float) -> None:
        """Give control to a client that moves a robot without a holder."""
        self._lease.claim(client, now)

    def handlers(self) -> Handlers:
        """Handlers of the commands about control itself; each returns the reason of a refusal, None if done."""
        return {
            intents.TakeControl: lambda asked, now: self._lease.take(client_of(asked), asked.confirm),
            intents.RequestControl: lambda asked, now: self._lease.request(client_of(asked), now),
            intents.GrantControl: lambda asked, now: self._lease.grant(client_of(asked)),
            intents.ReturnControl: lambda asked, now: self._lease.give_back(client_of(asked)),
        }

    def message(self, now: float) -> ControlState:
        """The message of the lease."""
        lease = self._lease
        holder, requested, following = lease.holder, lease.requested, lease.next_holder
        return ControlState(
            holder="" if holder is None else holder.key,
            user="" if holder is None else holder.user,
            expires_s=lease.left(now),
            requested_by="" if requested is None else requested.user,
            requested_key="" if requested is None else requested.key,
            next_user="" if following is None else following.user,
            notice=lease.notice,
            notice_number=lease.notice_number,
            supervised=not self.unwatched(now),
        )

    def _watch(self, role: Role, view_age_s: float, at: float) -> None:
        if role != "viewer" and view_age_s < NEVER_SEEN_S:
            self._seen = max(self._seen, at - view_age_s)


def client_of(intent: intents.Intent) -> Client:
    """The client of an intent. Without a client key the name identifies it."""
    return Client(intent.client or intent.user, intent.user)
