"""Which commands the bridge takes: those with the fencing token, new, fresh and within the robot's limits.

The fencing token allows one controller to command the robot. Only the bridge issues it.
"""

from collections import OrderedDict
from math import isfinite
from typing import Final

from rolling_panda import reasons
from rolling_panda.messages.robot import CutCommand, MotionCommand, TokenRequest, fingerprint
from rolling_panda.messages.types import MOST_EPOCHS, Reason
from rolling_panda.model.differential_drive import Array

#: Time without a valid message after which another controller gets the token (s). Longer than the
#: watchdog's deadline, so that the robot has come to rest before.
SILENT_S: Final = 1.0

OLD_EPOCH, UNKNOWN_EPOCH, OTHER_TOKEN = reasons.epoch_old(), reasons.epoch_unknown(), reasons.token_foreign()
HELD, MOVING, USED_UP = reasons.token_held(), reasons.token_at_rest_only(), reasons.epochs_used_up()


class Fence:
    """Issues tokens: at most one holder, each token with the next epoch. Times are the robot's (s)."""

    def __init__(self, epoch: int = 0, token: str | None = None) -> None:
        """Start with the stored state.

        Args:
            epoch: Epoch of the newest token; 0 before the first.
            token: Random part of the token; None without a holder.
        """
        self.epoch, self.token = epoch, token
        self._heard: float | None = None

    @property
    def holder(self) -> str:
        """Fingerprint of the token; empty without a holder."""
        return "" if self.token is None else fingerprint(self.token)

    def refuse(self, epoch: int, token: str) -> Reason | None:
        """Why a command under this token is not the holder's; None when it is."""
        if epoch != self.epoch:
            return OLD_EPOCH if epoch < self.epoch else UNKNOWN_EPOCH
        return None if token == self.token else OTHER_TOKEN

    def renew(self, now: float) -> None:
        """The holder has sent something valid."""
        self._heard = now

    def claim(self, token: str, now: float, at_rest: bool) -> Reason | None:
        """Issue the token, or renew it for its holder. Returns the reason of a refusal; None if granted.

        Args:
            token: Random part drawn by the requesting controller.
            now: Present time.
            at_rest: Whether the last commands are zero; only then the token changes hands.
        """
        if self._heard is None:
            # The holder from before a restart of the bridge has the full time to send a message.
            self._heard = now
        if token != self.token:
            if self.token is not None and now - self._heard < SILENT_S:
                return HELD
            if not at_rest:
                return MOVING
            if self.epoch >= MOST_EPOCHS:
                return USED_UP
            self.epoch, self.token = self.epoch + 1, token
        self._heard = now
        return None

    def release(self, token: str) -> bool:
        """The holder gives the token back; False from anybody else."""
        if token != self.token:
            return False
        self.token = None
        return True


OLD_SEQUENCE, UNSENT_ECHO, TOO_OLD = reasons.command_old(), reasons.echo_unsent(), reasons.command_late()
NOT_FINITE, TOO_FAST = reasons.velocity_not_finite(), reasons.velocity_too_high()
NOT_AT_REST = reasons.must_begin_at_rest()

#: Speed below which a setpoint means rest (rad/s).
_REST = 1e-3
# 2 s of joint states at 1 kHz: older ones are too old for any configuration.
_REMEMBERED = 2000
# Tolerance for rounding: a command exactly at the limit must not be refused.
_ROUNDING = 1.0 + 1e-9


class CommandValidator:
    """Validates the controller's commands. A refused command changes nothing.

    After a stop by the bridge (start, watchdog, software stop) the first valid command has to be zero, so that no
    earlier motion resumes.
    """

    def __init__(self, velocity_limit: Array, max_age_s: float, fence: Fence) -> None:
        """Wait at rest.

        Args:
            velocity_limit: Largest speed of each actuator (9, rad/s).
            max_age_s: Largest age of the joint state that a command was computed from (s, the bridge's clock).
            fence: Knows who holds the token.
        """
        self._limit = tuple(float(v) * _ROUNDING for v in velocity_limit)
        self._max_age = max_age_s
        self._sent: OrderedDict[int, float] = OrderedDict()
        self._fence = fence
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

    def claim(self, request: TokenRequest, now: float, at_rest: bool) -> Reason | None:
        """Issue the token, or renew it for its holder. Returns None, or the reason of a refusal.

        Args:
            request: The decoded request.
            now: Time of its arrival (s, the bridge's clock).
            at_rest: Whether the last commands are zero.
        """
        reason = self._stale(request.echo, now)
        if reason is not None:
            return reason
        epoch = self._fence.epoch
        reason = self._fence.claim(request.token, now, at_rest)
        if self._fence.epoch != epoch:
            self.sequence, self.must_rest = -1, True
        return reason

    def refuse(self, command: MotionCommand, now: float) -> Reason | None:
        """Take the command and return None, or the reason why it is refused.

        Args:
            command: As decoded; its numbers are checked again here.
            now: Time of its arrival (s, the bridge's clock).
        """
        reason = self._fault(command, now)
        if reason is None:
            self.sequence, self.must_rest = command.sequence, False
            self._fence.renew(now)
        return reason

    def refuse_cut(self, command: CutCommand, now: float) -> Reason | None:
        """Why a cut order is not to be acted on by its token and age; None when it may. Changes nothing."""
        return self._fence.refuse(command.epoch, command.token) or self._stale(command.echo, now)

    def _fault(self, command: MotionCommand, now: float) -> Reason | None:
        wrong = self._fence.refuse(command.epoch, command.token)
        if wrong is not None:
            return wrong
        if command.sequence <= self.sequence:
            return OLD_SEQUENCE
        if not all(isfinite(v) for v in command.xi):
            return NOT_FINITE
        if any(abs(v) > limit for v, limit in zip(command.xi, self._limit, strict=True)):
            return TOO_FAST
        stale = self._stale(command.echo, now)
        if stale is not None:
            return stale
        if self.must_rest and any(abs(v) > _REST for v in command.xi):
            return NOT_AT_REST
        return None

    def _stale(self, echo: int, now: float) -> Reason | None:
        at = self._sent.get(echo)
        if at is None:
            newest = next(reversed(self._sent), -1)
            return UNSENT_ECHO if echo > newest else TOO_OLD
        return TOO_OLD if now - at > self._max_age else None
