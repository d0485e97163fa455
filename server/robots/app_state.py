"""Who comes in and goes: one sign-in, one cookie and one session for every robot of this server."""

import time
from dataclasses import dataclass, field

from rolling_panda import messages as m
from rolling_panda.errors import InputError
from server.auth.passwords import Passwords
from server.auth.sessions import Session, Sessions
from server.robots.context import Result, RobotContext


@dataclass(eq=False)
class AppState:
    """What the desks of all robots share; the server's event loop alone touches it.

    Attributes:
        sessions: Who is signed in.
        address: How the page is reached on this machine.
        cookie: Name of the session's cookie.
        invite_s: Life of a sign-in link that a supervisor makes (s).
        max_body_bytes: Longest request body.
        passwords: None where a link signs in.
        desks: One a robot, by the robot's name.
    """

    sessions: Sessions
    address: str
    cookie: str
    invite_s: float
    max_body_bytes: int
    passwords: Passwords | None = None
    desks: dict[str, RobotContext] = field(default_factory=dict)
    _users_trouble: str = ""

    def note(self, severity: m.Severity, text: str, by: str = "") -> None:
        """Write a line into the log of every robot; `by` whom, who must not fill it."""
        for desk in self.desks.values():
            desk.note(severity, text, by)

    def sign_out(self, session: Session) -> None:
        """End a session everywhere; what it held of any robot is let go."""
        for desk in self.desks.values():
            desk.leave(session)
        self.sessions.end(session)
        self.note("info", f"{session.user} signed out")

    def invite(self, session: Session, user: str, role: m.Role) -> Result:
        """A link that signs `user` in once; the result's reason is the link."""
        if self.passwords is not None:
            return Result(403, False, "here people sign in with a password: rolling-panda user add NAME")
        token = self.sessions.invite(user, role, time.monotonic() + self.invite_s)
        self.note("info", f"{session.user} made a sign-in link for {user} ({role})")
        return Result(200, True, f"{self.address}/sign-in?token={token}")

    def end_void_sessions(self) -> None:
        """Sign out whoever's account has been removed or changed."""
        if self.passwords is None:
            return
        try:
            accounts = {user.name: user.fingerprint for user in self.passwords.users.everyone()}
        except InputError as error:
            # Whoever is at work stays at work; nobody new comes in.
            if str(error) != self._users_trouble:
                self._users_trouble = str(error)
                self.note("error", self._users_trouble)
            return
        self._users_trouble = ""
        for session in self.sessions.void(accounts):
            self.note("warning", f"the account of {session.user} was removed or changed")
            self.sign_out(session)

    def held_elsewhere(self, session: Session, here: RobotContext) -> str:
        """Name of another robot that this session holds now; empty where it holds none."""
        for name, desk in self.desks.items():
            if desk is not here and desk.teleop.holder == session.session_id:
                return name
        return ""
