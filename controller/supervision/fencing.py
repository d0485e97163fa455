"""The controller's side of the fencing token: asked of the bridge, kept, lost or given back. Pure: `now` is given."""

import math
import secrets
from collections.abc import Callable
from typing import Final

from controller.identity import Token
from rolling_panda import messages as m
from rolling_panda.topics import TOKEN

#: Without a word of the bridge for so long after the start (s), this controller tells its state all the same.
_UNHEARD_S: Final = 1.0


def draw_nonce() -> str:
    """The random part of a token, 64 bits."""
    return secrets.token_hex(8)


class FencingToken:
    """Asks for the token until the bridge shows that it is given, and goes on asking to keep it."""

    def __init__(self, draw: Callable[[], str] = draw_nonce) -> None:
        """Ask under a new random part.

        Args:
            draw: Gives the random part of a token.
        """
        self._draw = draw
        self._nonce, self._former = draw(), ""
        self._mine = m.fingerprint(self._nonce)
        self._began = self._due = -math.inf
        self._mode: m.Mode | None = None
        self._given: m.TokenRequest | None = None
        #: Of the commands; None while the bridge has not given it.
        self.token: Token | None = None
        #: Another controller commands the robot.
        self.overruled = False
        #: This controller keeps silent: another one commands, or the bridge has not said yet who does.
        self.waits = True

    def update(self, bridge: m.BridgeState | None, now: float) -> str:
        """Take in whose the token is. Returns what has changed, in words; empty when nothing has.

        Args:
            bridge: Newest word of the bridge.
            now: Monotonic time (s).
        """
        if self._began == -math.inf:
            self._began = now
        had, was_overruled = self.token, self.overruled
        if bridge is not None:
            self.token = Token(bridge.epoch, self._nonce) if bridge.holder == self._mine else None
            self.overruled = bridge.holder not in ("", self._mine, self._former)
        self.waits = self.overruled or (bridge is None and now - self._began < _UNHEARD_S)
        if self.overruled and not was_overruled:
            return "another controller commands this robot; this one waits until that one has ended or is silent"
        if self.token is not None and self.token != had:
            return f"this controller commands the robot: epoch {self.token.epoch}"
        return ""

    def request(self, echo: int, mode: m.Mode, now: float) -> m.TokenRequest | None:
        """What to ask of the bridge now; None when nothing is due.

        Args:
            echo: Of the newest joint state.
            mode: Of the machine, which the bridge is told at once when it changes.
            now: Monotonic time (s).
        """
        given, self._given = self._given, None
        if given is not None or (now < self._due and mode == self._mode):
            return given
        self._due, self._mode = now + 1.0 / TOKEN.rate_hz, mode
        return m.TokenRequest(token=self._nonce, echo=echo, mode=mode)

    def give_way(self) -> m.TokenRequest:
        """What gives the token back: this controller ends, or trusts it no more and asks for another one."""
        self._given = m.TokenRequest(token=self._nonce, releases=True)
        self._former, self._nonce, self.token = self._mine, self._draw(), None
        self._mine, self._due = m.fingerprint(self._nonce), -math.inf
        return self._given
