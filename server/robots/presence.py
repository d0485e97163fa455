"""Who is there, for the controller: it renews the lease and tells whether somebody sees the robot. No clock here."""

from dataclasses import dataclass

from rolling_panda.messages.supervision import NEVER_SEEN_S, Person, Presence
from server.auth.sessions import Session

#: Who has been silent for so long (s) is not there any more.
HEARD_S = 1.0
#: The first word after so long a silence (s) is told at once: with the next turn it could come too late for the lease.
_SILENT_S = 0.4


@dataclass
class _Client:
    session: Session
    heard_at: float
    seen_at: float


class PresentPeople:
    """When each session was heard from, and how old the robot was as it was last drawn or fetched."""

    def __init__(self) -> None:
        """Nobody is there."""
        self._clients: dict[str, _Client] = {}
        self._sequence = 0

    def heard(self, session: Session, now: float) -> bool:
        """A page or a script of this session has said something.

        Returns:
            Whether that is news that should not wait: somebody who may operate has been silent for a while.
        """
        client = self._of(session)
        news = session.may_operate and now - client.heard_at > _SILENT_S
        client.heard_at = now
        return news

    def saw(self, session: Session, seen_at: float) -> bool:
        """Something of this session has drawn or fetched the robot as it was at this time (s).

        Returns:
            Whether that is news that should not wait: nobody of this session has seen the robot for a while.
        """
        client = self._of(session)
        news = seen_at - client.seen_at > HEARD_S
        client.seen_at = max(client.seen_at, seen_at)
        return news

    def view_age_s(self, session: Session, now: float) -> float:
        """Age of the newest state of the robot that something of this session has drawn or fetched (s)."""
        client = self._clients.get(session.client)
        return NEVER_SEEN_S if client is None else _view_age_s(client, now)

    def forget(self, session: Session) -> None:
        """The last of this session has gone."""
        self._clients.pop(session.client, None)

    def message(self, now: float) -> Presence:
        """Who is there now (s)."""
        self._clients = {key: client for key, client in self._clients.items() if now - client.heard_at <= HEARD_S}
        self._sequence += 1
        return Presence(
            sequence=self._sequence,
            people=tuple(
                Person(
                    key,
                    client.session.user,
                    client.session.role,
                    max(0.0, now - client.heard_at),
                    _view_age_s(client, now),
                )
                for key, client in self._clients.items()
            ),
        )

    def _of(self, session: Session) -> _Client:
        return self._clients.setdefault(session.client, _Client(session, float("-inf"), float("-inf")))


def _view_age_s(client: _Client, now: float) -> float:
    return min(max(0.0, now - client.seen_at), NEVER_SEEN_S)
