"""Cut orders: each `cut_id` is acted on once, and only while the robot is in control."""

from typing import Literal

from rolling_panda.messages import CutCommand

OLD_EPOCH = "an older controller's cut"
BUSY = "the blades are still at the last cut"

Verdict = Literal["cut", "known", "refuse"]


class CutOrders:
    """Remembers every cut asked for, for as long as the process lives."""

    def __init__(self) -> None:
        """Start with none."""
        self._known: set[str] = set()

    def judge(self, command: CutCommand, epoch: int, blades_free: bool, inhibited: str) -> tuple[Verdict, str]:
        """Whether to close the blades now, with the reason if not.

        An order that comes while the cutter is inhibited is spent: its repetitions must not cut later, when nobody
        expects it. One from an older controller, or during another cut, changes nothing.

        Args:
            command: The order.
            epoch: Newest controller epoch.
            blades_free: The blades are open and idle.
            inhibited: Why the cutter is inhibited; empty when it is not.
        """
        if command.epoch != epoch:
            return "refuse", OLD_EPOCH
        if command.cut_id in self._known:
            return "known", ""
        if not blades_free:
            return "refuse", BUSY
        self._known.add(command.cut_id)
        return ("refuse", inhibited) if inhibited else ("cut", "")
