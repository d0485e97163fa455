"""Fencing token of the controller: request, renewal, loss and release. Pure: `now` is an argument."""

import math
import secrets
from collections.abc import Callable
from typing import Final

from controller.identity import Token
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.topics import TOKEN

#: Without a bridge state for this long after the start (s), the controller publishes its state all the same.
_UNHEARD_S: Final = 1.0


def draw_nonce() -> str:
    """The random part of a token, 64 bits."""
    return secrets.token_hex(8)


class FencingToken:
    """Requests the token until the bridge grants it, and repeats the request to keep it."""

    def __init__(self, draw: Callable[[], str] = draw_nonce) -> None:
        """Draw a random part; no token is held yet.

        Args:
            draw: Draws the random part of a token.
        """
        self._draw = draw
        self._nonce, self._former = draw(), ""
        self._mine = m.fingerprint(self._nonce)
        self._began = self._due = -math.inf
        self._mode: m.Mode | None = None
        self._given: m.TokenRequest | None = None
        #: Token of the commands; None while the bridge has not granted it.
        self.token: Token | None = None
        #: Another controller commands the robot.
        self.overruled = False
        #: This controller is silent: another one commands, or no bridge state has arrived yet.
        self.waits = True

    def update(self, bridge: m.BridgeState | None, now: float) -> m.Reason | None:
        """Update the holder of the token. Returns the change; None without one.

        Args:
            bridge: Newest bridge state.
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
            return reasons.controller_waits()
        if self.token is not None and self.token != had:
            return reasons.controller_commands(self.token.epoch)
        return None

    def request(self, echo: int, mode: m.Mode, now: float) -> m.TokenRequest | None:
        """The request that is due; None when none is.

        Args:
            echo: Of the newest joint state.
            mode: Of the controller; a change is sent at once.
            now: Monotonic time (s).
        """
        given, self._given = self._given, None
        if given is not None or (now < self._due and mode == self._mode):
            return given
        self._due, self._mode = now + 1.0 / TOKEN.rate_hz, mode
        return m.TokenRequest(token=self._nonce, echo=echo, mode=mode)

    def release_token(self) -> m.TokenRequest:
        """The message that releases the token: this controller ends, or requests a new token."""
        self._given = m.TokenRequest(token=self._nonce, releases=True)
        self._former, self._nonce, self.token = self._mine, self._draw(), None
        self._mine, self._due = m.fingerprint(self._nonce), -math.inf
        return self._given
