"""The fencing token, which allows one controller to command the robot. Only the bridge issues it."""

from typing import Final

from rolling_panda import reasons
from rolling_panda.messages.robot import fingerprint
from rolling_panda.messages.types import MOST_EPOCHS, Reason

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
