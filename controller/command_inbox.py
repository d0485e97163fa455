"""Operator commands: handed to the control loop, answered once the ledger holds them."""

import queue
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError

import msgspec

from controller.core import Controller
from controller.ledger.journal import LedgerState
from rolling_panda import commands as intents
from rolling_panda import messages as m

#: Time limit of a command's answer (s), below the service's timeout.
_ANSWER_S = 0.8


#: Time limit of a record; after it the answer is "not recorded" (s).
_PATIENCE_S = 0.6


class CommitBarrier:
    """Queue of messages that wait for their records to be durable, in the order of the records. No clock."""

    def __init__(self) -> None:
        """Start with nothing to say."""
        self._waiting: deque[tuple[int, float, Callable[[str], None]]] = deque()

    def hold(self, number: int, now: float, say: Callable[[str], None]) -> None:
        """Call `say` once all records up to `number` are durable.

        `say` gets an empty text, or the reason why they are not durable.
        """
        self._waiting.append((number, now, say))

    def settle(self, ledger: LedgerState, now: float) -> None:
        """Call the functions whose records are durable."""
        while self._waiting:
            number, since, say = self._waiting[0]
            why = ""
            if number > ledger.durable:
                why = ledger.failure
                if not why and now - since > _PATIENCE_S:
                    why = f"the ledger has not written it within {_PATIENCE_S} s"
                if not why:
                    return
            self._waiting.popleft()
            say(why)


class CommandInbox:
    """`ask` from any thread; `decide` on the loop's."""

    def __init__(self, controller: Controller, barrier: CommitBarrier) -> None:
        """Bind the controller, and the barrier that holds answers until they are durable."""
        self._controller, self._barrier = controller, barrier
        self._waiting: queue.SimpleQueue[tuple[intents.Intent, float, Future[m.Answer]]] = queue.SimpleQueue()

    def ask(self, intent: intents.Intent) -> m.Answer | None:
        """Hand the intent to the loop and wait for its answer; None where it is another controller's to answer."""
        if self._controller.waits:
            return None
        future: Future[m.Answer] = Future()
        self._waiting.put((intent, time.monotonic(), future))
        try:
            return future.result(_ANSWER_S)
        except FutureTimeoutError:
            if future.cancel():
                return m.Answer(ok=False, reason="the control loop did not answer in time; nothing was done")
            return m.Answer(ok=False, reason="it was decided, but not recorded in time: see the state")

    def decide(self, now: float) -> None:
        """Pass the waiting commands to the controller. Each answer is sent when it is durable."""
        while not self._waiting.empty():
            intent, asked_at, future = self._waiting.get()
            # The operator's view has aged while the command waited.
            view_age_s = intent.view_age_s + time.monotonic() - asked_at
            intent = msgspec.structs.replace(intent, view_age_s=view_age_s)
            # A command whose caller has given up must not be executed.
            if future.set_running_or_notify_cancel():
                self._hold(self._controller.answer(intent, now), future, now)

    def _hold(self, answer: m.Answer, future: Future[m.Answer], now: float) -> None:
        def say(why: str) -> None:
            lost = m.Answer(ok=False, reason=f"it was decided, but is not recorded: {why}"[:500])
            future.set_result(lost if why and answer.ok else answer)

        self._barrier.hold(self._controller.recorded, now, say)
