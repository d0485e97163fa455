"""Single-use sign-in tokens, and sessions in memory. No clock here: `now` is given (s, monotonic)."""

import asyncio
import hashlib
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field

from rolling_panda import reasons
from rolling_panda.errors import InputError
from rolling_panda.messages.types import Reason, Role
from server.auth.throttle import LoginThrottle

_TOKEN_BYTES = 32


class SignInError(InputError):
    """A sign-in was refused for a reason; further attempts are refused for `wait_s`."""

    def __init__(self, reason: Reason, wait_s: float = 0.0) -> None:
        """Store reason and delay."""
        super().__init__(reasons.text_of(reason))
        self.reason, self.wait_s = reason, wait_s


@dataclass(eq=False)
class Session:
    """A signed-in person or script.

    Attributes:
        session_id: The cookie's value; never logged.
        user: Name for logs.
        role: Of the user.
        used_at: When the session was last used (s).
        account: Fingerprint of the account, for sign-in by password; empty for sign-in by link.
        ended: Set at the end of the session; its WebSockets close.
        client: Public key of the session on the wire and on pages; reveals nothing of the cookie.
    """

    session_id: str
    user: str
    role: Role
    used_at: float
    account: str = ""
    ended: asyncio.Event = field(default_factory=asyncio.Event)
    client: str = field(default_factory=lambda: secrets.token_hex(8))

    @property
    def may_operate(self) -> bool:
        """Whether the role may move the robot."""
        return self.role in ("operator", "supervisor")


@dataclass(frozen=True)
class _Invitation:
    user: str
    role: Role
    expires_at: float


class Sessions:
    """Sign-in tokens and sessions. Only digests of tokens are stored."""

    def __init__(self, idle_s: float) -> None:
        """No session exists; one that is unused for `idle_s` ends."""
        self._idle_s = idle_s
        self._invitations: dict[str, _Invitation] = {}
        self._sessions: dict[str, Session] = {}
        self._attempts = LoginThrottle()

    def invite(self, user: str, role: Role, expires_at: float = float("inf")) -> str:
        """A new sign-in token of 256 bits, valid for one sign-in until `expires_at` (s)."""
        token = secrets.token_urlsafe(_TOKEN_BYTES)
        self.admit(token, user, role, expires_at)
        return token

    def admit(self, token: str, user: str, role: Role, expires_at: float = float("inf")) -> None:
        """Register a given token for one sign-in.

        Raises:
            InputError: The token is too short to be a secret.
        """
        if len(token) < 22:
            raise InputError(f"the sign-in token has {len(token)} characters; it must have at least 22 (128 bits)")
        self._invitations[_digest(token)] = _Invitation(user, role, expires_at)

    def sign_in(self, token: str, now: float, address: str = "") -> Session:
        """Redeem a token and open a session; `address` is that of the client.

        Raises:
            SignInError: The token is unknown, used or expired, or too many attempts have failed.
        """
        wait = self._attempts.wait((address,), now)
        if wait > 0.0:
            raise SignInError(reasons.sign_in_throttled(max(1.0, wait)), wait)
        invitation = self._invitations.pop(_digest(token), None)
        if invitation is None or now > invitation.expires_at:
            self._attempts.failed((address,), now)
            raise SignInError(reasons.sign_in_link_void())
        self._attempts.succeeded((address,))
        return self.open(invitation.user, invitation.role, now)

    def open(self, user: str, role: Role, now: float, account: str = "") -> Session:
        """Open a session for an authenticated user."""
        session = Session(secrets.token_urlsafe(_TOKEN_BYTES), user, role, now, account)
        self._sessions[_digest(session.session_id)] = session
        return session

    def find(self, session_id: str, now: float) -> Session | None:
        """The session of a cookie value, marked as used now; None without one."""
        session = self._sessions.get(_digest(session_id))
        if session is None:
            return None
        if now - session.used_at > self._idle_s:
            self.end(session)
            return None
        session.used_at = now
        return session

    def active(self) -> tuple[Session, ...]:
        """All sessions."""
        return tuple(self._sessions.values())

    def void(self, accounts: Mapping[str, str]) -> tuple[Session, ...]:
        """Sessions of removed and changed accounts; `accounts` has the present fingerprints by user."""
        sessions = self._sessions.values()
        return tuple(each for each in sessions if each.account and accounts.get(each.user) != each.account)

    def end(self, session: Session) -> None:
        """Sign out; safe to call twice."""
        self._sessions.pop(_digest(session.session_id), None)
        session.ended.set()


def _digest(secret: str) -> str:
    # The time of a lookup by digest reveals nothing of the secret.
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()
