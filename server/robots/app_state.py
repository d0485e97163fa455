"""State that all robots of this server share: sessions, sign-in and the contexts of the robots."""

import time
from dataclasses import dataclass, field

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.errors import InputError
from server.auth.passwords import Passwords
from server.auth.sessions import Session, Sessions
from server.robots.context import RobotContext


@dataclass(eq=False)
class AppState:
    """Shared state of the server; it belongs to the event loop.

    Attributes:
        sessions: Signed-in sessions.
        cookie: Name of the session cookie.
        invite_s: Lifetime of a sign-in link that a supervisor makes (s).
        max_body_bytes: Longest request body.
        passwords: None where sign-in is by link.
        robots: By name.
    """

    sessions: Sessions
    cookie: str
    invite_s: float
    max_body_bytes: int
    passwords: Passwords | None = None
    robots: dict[str, RobotContext] = field(default_factory=dict)
    _users_error: str = ""

    def note(self, reason: m.Reason, by: str = "") -> None:
        """Write a line into the log of every robot; see `RobotLog.note`."""
        for robot in self.robots.values():
            robot.log.note(reason, by)

    def sign_out(self, session: Session) -> None:
        """End a session; its holds of all robots are released."""
        for robot in self.robots.values():
            robot.end_session(session)
        self.sessions.end(session)
        self.note(reasons.signed_out(session.user))

    def invite(self, session: Session, user: str, role: m.Role, origin: str) -> str | m.Reason:
        """A link to the page at `origin` that signs `user` in once, or why there is none."""
        if self.passwords is not None:
            return reasons.invitation_impossible()
        token = self.sessions.invite(user, role, time.monotonic() + self.invite_s)
        self.note(reasons.invited(session.user, user, role))
        return f"{origin}/sign-in?token={token}"

    def end_void_sessions(self) -> None:
        """Sign out the sessions of removed and changed accounts."""
        if self.passwords is None:
            return
        try:
            accounts = {user.name: user.fingerprint for user in self.passwords.users.all()}
        except InputError as error:
            # Sessions stay signed in while the file cannot be read; nobody new can sign in.
            if str(error) != self._users_error:
                self._users_error = str(error)
                self.note(reasons.users_unreadable(self._users_error))
            return
        self._users_error = ""
        for session in self.sessions.void(accounts):
            self.note(reasons.account_changed(session.user))
            self.sign_out(session)

    def held_elsewhere(self, session: Session, here: RobotContext) -> str:
        """Name of another robot that this session holds now; empty where it holds none."""
        for name, robot in self.robots.items():
            if robot is not here and robot.teleop.holder == session.session_id:
                return name
        return ""
