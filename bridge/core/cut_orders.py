"""Cut orders: each `cut_id` is executed once, and only while the bridge follows commands."""

from typing import Literal

from bridge.core.cut_memory import CutMemory, ForLife
from rolling_panda import reasons
from rolling_panda.messages.robot import CutCommand
from rolling_panda.messages.types import Reason

BUSY, FORGETFUL = reasons.blades_busy(), reasons.cut_not_remembered()

Verdict = Literal["cut", "known", "wait", "refuse"]


class CutOrders:
    """Remembers every ordered cut; with a durable memory, also across restarts."""

    def __init__(self, memory: CutMemory | None = None) -> None:
        """Start with the stored cuts."""
        self._memory = memory or ForLife()
        self._known: set[str] = set(self._memory.known)

    def judge(
        self, command: CutCommand, wrong: Reason | None, blades_free: bool, inhibited: Reason | None
    ) -> tuple[Verdict, Reason | None]:
        """Decide whether to close the blades now; returns the reason of a refusal.

        An order that arrives while the cutter is inhibited is used up: its repetitions must not cut later, when nobody
        expects it. An order that is not yet on disk waits for its next repetition. An order with a wrong token or too
        old, during another cut or in motion, changes nothing.

        Args:
            command: The order.
            wrong: Reason why the order is invalid; None if it is valid.
            blades_free: Whether the blades are open and idle.
            inhibited: Reason why the cutter is inhibited; None if it is not.
        """
        if command.cut_id in self._known:
            return "known", None
        if wrong is not None:
            return "refuse", wrong
        if not blades_free:
            return "refuse", BUSY
        kept = self._memory.keep(command.cut_id)
        if inhibited is not None:
            self._known.add(command.cut_id)
            return "refuse", inhibited
        if kept == "waiting":
            return "wait", None
        self._known.add(command.cut_id)
        return ("cut", None) if kept == "kept" else ("refuse", FORGETFUL)
