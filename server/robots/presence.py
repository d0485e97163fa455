"""Presence of the sessions, for the controller's lease, and the age of the newest state that each has seen.

No clock here: `now` is given (s).
"""

from dataclasses import dataclass

from rolling_panda.messages.supervision import NEVER_SEEN_S, Person, Presence
from server.auth.sessions import Session

#: A session is absent this long after its last message (s).
PRESENT_S = 1.0
#: The first activity after a longer silence (s) is published at once; the next period could be too late for the lease.
_SILENCE_S = 0.4


@dataclass
class _Client:
    session: Session
    active_at: float
    seen_at: float


class PresenceTracker:
    """Time of the last activity of each session, and of the measurement of the newest state that it has seen."""

    def __init__(self) -> None:
        """No session is present."""
        self._clients: dict[str, _Client] = {}
        self._sequence = 0

    def on_activity(self, session: Session, now: float) -> bool:
        """A page or a script of this session has sent something.

        Returns:
            Whether to publish at once: the session may operate and has been silent for a while.
        """
        client = self._of(session)
        publish = session.may_operate and now - client.active_at > _SILENCE_S
        client.active_at = now
        return publish

    def on_seen(self, session: Session, seen_at: float) -> bool:
        """A page or a script of this session has rendered or fetched a state that was measured at `seen_at` (s).

        Returns:
            Whether to publish at once: the session had not seen the robot for a while.
        """
        client = self._of(session)
        publish = seen_at - client.seen_at > PRESENT_S
        client.seen_at = max(client.seen_at, seen_at)
        return publish

    def view_age_s(self, session: Session, now: float) -> float:
        """Age of the newest state that this session has rendered or fetched (s)."""
        client = self._clients.get(session.client)
        return NEVER_SEEN_S if client is None else _view_age_s(client, now)

    def forget(self, session: Session) -> None:
        """The session is absent from now on."""
        self._clients.pop(session.client, None)

    def message(self, now: float) -> Presence:
        """The sessions that are present at `now` (s)."""
        self._clients = {key: client for key, client in self._clients.items() if now - client.active_at <= PRESENT_S}
        self._sequence += 1
        return Presence(
            sequence=self._sequence,
            people=tuple(
                Person(
                    key,
                    client.session.user,
                    client.session.role,
                    max(0.0, now - client.active_at),
                    _view_age_s(client, now),
                )
                for key, client in self._clients.items()
            ),
        )

    def _of(self, session: Session) -> _Client:
        return self._clients.setdefault(session.client, _Client(session, float("-inf"), float("-inf")))


def _view_age_s(client: _Client, now: float) -> float:
    return min(max(0.0, now - client.seen_at), NEVER_SEEN_S)
