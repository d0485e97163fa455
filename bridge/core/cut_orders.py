"""Cut orders: each `cut_id` is executed once, and only while the bridge follows commands."""

from typing import Literal

from bridge.core.cut_memory import CutMemory, ForLife
from rolling_panda.messages.robot import CutCommand

BUSY = "the blades are still at the last cut"
FORGETFUL = "the cut cannot be remembered: the disk is full or broken"

Verdict = Literal["cut", "known", "wait", "refuse"]


class CutOrders:
    """Remembers every ordered cut; with a durable memory, also across restarts."""

    def __init__(self, memory: CutMemory | None = None) -> None:
        """Start with what the memory knows."""
        self._memory = memory or ForLife()
        self._known: set[str] = set(self._memory.known)

    def judge(self, command: CutCommand, wrong: str | None, blades_free: bool, inhibited: str) -> tuple[Verdict, str]:
        """Whether to close the blades now, with the reason if not.

        An order that comes while the cutter is inhibited is spent: its repetitions must not cut later, when nobody
        expects it. One that is not remembered durably yet waits for its next repetition. One with a wrong token or too
        old, during another cut or in motion, changes nothing.

        Args:
            command: The order.
            wrong: Why the order itself is none that counts now; None when it is.
            blades_free: The blades are open and idle.
            inhibited: Why the cutter is inhibited; empty when it is not.
        """
        if command.cut_id in self._known:
            return "known", ""
        if wrong is not None:
            return "refuse", wrong
        if not blades_free:
            return "refuse", BUSY
        kept = self._memory.keep(command.cut_id)
        if inhibited:
            self._known.add(command.cut_id)
            return "refuse", inhibited
        if kept == "waiting":
            return "wait", ""
        self._known.add(command.cut_id)
        return ("cut", "") if kept == "kept" else ("refuse", FORGETFUL)
