"""Commands to the actuators: checked, smoothed, numbered and signed with the token."""

import numpy as np

from controller.identity import Token
from controller.whole_body.saturation import Saturation
from rolling_panda import messages as m
from rolling_panda.model.differential_drive import NXI, Array
from rolling_panda.model.wire_values import actuated

#: Number of zero commands at the start of a token. The bridge requires one, and some may be lost.
_AT_REST_FIRST = 3


class Setpoints:
    """Remembers what was sent last: `sent` (9, rad/s), and `before` in the period before that."""

    def __init__(self, saturation: Saturation) -> None:
        """At rest."""
        self._saturation = saturation
        self._number = 0
        #: Sequence of the newest command that was not zero.
        self.moved = 0
        self._token: Token | None = None
        self._rest = 0
        self.sent: Array = np.zeros(NXI)
        self.before: Array = self.sent

    @property
    def at_rest(self) -> bool:
        """Whether the last commands are zero."""
        return not self.sent.any()

    def admits(self, xi: Array) -> bool:
        """Whether ξ̇ (9) is finite and within the limits, given the last command."""
        return self._saturation.admits(xi, self.sent)

    def smooth(self, xi: Array) -> Array:
        """Final check: a command that `admits` refuses becomes braking. Keeps the arm's jerk limit."""
        if not self.admits(xi):
            xi = self._saturation.brake(self.sent)
        return self._saturation.smooth(xi, self.sent, self.before)

    def command(self, xi: Array, token: Token, echo: int) -> m.MotionCommand:
        """The message for ξ̇ (9), which counts as sent; `echo` is the joint state that it was computed from."""
        if token != self._token:
            # Control changes hands at rest.
            self._token, self._rest = token, _AT_REST_FIRST if self.at_rest else 0
        if self._rest > 0:
            self._rest, xi = self._rest - 1, np.zeros(NXI)
        self.sent, self.before = xi, self.sent
        self._number += 1
        if xi.any():
            self.moved = self._number
        return m.MotionCommand(epoch=token.epoch, token=token.nonce, sequence=self._number, echo=echo, xi=actuated(xi))

    def withhold(self) -> None:
        """Nothing is sent in this period."""
        self.sent = self.before = np.zeros(NXI)
