"""Which motion commands are actuated at all: newer than every one before, fresh, and within the robot's limits."""

from collections import OrderedDict
from math import isfinite

from rolling_panda.messages.robot import CutCommand, MotionCommand
from rolling_panda.model.differential_drive import Array

OLD_EPOCH = "an older controller's command"
OTHER_TOKEN = "another token of the same epoch"
MOVING = "a new token while the robot still moves under the old one"
OLD_SEQUENCE = "sequence not newer than the last"
UNSENT_ECHO = "echoes a joint state that was never sent"
TOO_OLD = "computed from a joint state that is too old"
NOT_FINITE = "velocity is not a finite number"
TOO_FAST = "velocity outside the robot's limits"
NOT_AT_REST = "the first setpoint after a standstill must be zero"

#: Speed below which a setpoint means rest (rad/s).
_REST = 1e-3
# 2 s of joint states at 1 kHz: what is older is too old whatever the configuration.
_REMEMBERED = 2000
# A controller that works exactly at the limit must not be refused for its last bit.
_ROUNDING = 1.0 + 1e-9


class CommandValidator:
    """Judges motion commands. A refused one changes nothing: neither the token nor the setpoint.

    After a standstill that the bridge itself enforced (start, watchdog, stop) the gate waits for a setpoint at rest, so
    that nothing that was under way before wakes moving.
    """

    def __init__(self, velocity_limit: Array, max_age_s: float, epoch: int = 0, token: str | None = None) -> None:
        """Wait at rest.

        Args:
            velocity_limit: Largest speed of each actuator (9, rad/s).
            max_age_s: Largest age of the joint state that a command was computed from (s, the bridge's clock).
            epoch: Newest one accepted before this start.
            token: Random part of the token that came with it; None when no command has come yet.
        """
        self._limit = tuple(float(v) * _ROUNDING for v in velocity_limit)
        self._max_age = max_age_s
        self._sent: OrderedDict[int, float] = OrderedDict()
        self.epoch, self.token = epoch, token
        self.sequence = -1
        self.must_rest = True

    def sent(self, sequence: int, now: float) -> None:
        """Note that the joint state `sequence` goes out now."""
        self._sent[sequence] = now
        if len(self._sent) > _REMEMBERED:
            self._sent.popitem(last=False)

    def require_rest(self) -> None:
        """Take nothing but a setpoint at rest from here on, until one has come."""
        self.must_rest = True

    def refuse(self, command: MotionCommand, now: float, at_rest: bool = True) -> str | None:
        """Take the command and return None, or the reason why it is refused.

        Args:
            command: As decoded; its numbers are checked again here.
            now: When it was received (s, the bridge's clock).
            at_rest: Whether nothing moves by what was sent on last; only then control may change hands.
        """
        reason = self._fault(command, now, at_rest)
        if reason is None:
            self.epoch, self.token, self.sequence = command.epoch, command.token, command.sequence
            self.must_rest = False
        return reason

    def refuse_cut(self, command: CutCommand, now: float) -> str | None:
        """Why a cut order is not to be acted on by its token and age; None when it may. Changes nothing."""
        if command.epoch != self.epoch:
            return OLD_EPOCH if command.epoch < self.epoch else "a token that no motion command has brought yet"
        if command.token != self.token:
            return OTHER_TOKEN
        return self._stale(command.echo, now)

    def _fault(self, command: MotionCommand, now: float, at_rest: bool) -> str | None:
        if command.epoch < self.epoch:
            return OLD_EPOCH
        if command.epoch == self.epoch and self.token is not None:
            if command.token != self.token:
                return OTHER_TOKEN
            if command.sequence <= self.sequence:
                return OLD_SEQUENCE
        if not all(isfinite(v) for v in command.xi):
            return NOT_FINITE
        if any(abs(v) > limit for v, limit in zip(command.xi, self._limit, strict=True)):
            return TOO_FAST
        stale = self._stale(command.echo, now)
        if stale is not None:
            return stale
        new = command.epoch > self.epoch
        if new and not at_rest:
            return MOVING
        if (self.must_rest or new) and any(abs(v) > _REST for v in command.xi):
            return NOT_AT_REST
        return None

    def _stale(self, echo: int, now: float) -> str | None:
        at = self._sent.get(echo)
        if at is None:
            newest = next(reversed(self._sent), -1)
            return UNSENT_ECHO if echo > newest else TOO_OLD
        return TOO_OLD if now - at > self._max_age else None
