"""Operators' questions: they come in on the transport's threads, the loop decides, and they wait for the ledger."""

import queue
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError

from controller.acknowledged import Acknowledged
from controller.core import Controller
from rolling_panda import intents
from rolling_panda import messages as m

#: How long an operator's question waits for its answer (s); less than the service's timeout.
_ANSWER_S = 0.8


class IntentDesk:
    """`ask` from any thread; `decide` on the loop's."""

    def __init__(self, controller: Controller, acknowledged: Acknowledged) -> None:
        """Bind who decides, and what holds answers back until they are durable."""
        self._controller, self._acknowledged = controller, acknowledged
        self._waiting: queue.SimpleQueue[tuple[intents.Intent, Future[m.Answer]]] = queue.SimpleQueue()

    def ask(self, intent: intents.Intent) -> m.Answer:
        """Hand the intent to the loop and wait for its answer."""
        future: Future[m.Answer] = Future()
        self._waiting.put((intent, future))
        try:
            return future.result(_ANSWER_S)
        except FutureTimeoutError:
            if future.cancel():
                return m.Answer(ok=False, reason="the control loop did not answer in time; nothing was done")
            return m.Answer(ok=False, reason="it was decided, but not recorded in time: see the state")

    def decide(self, now: float) -> None:
        """Put what waits to the controller; each answer goes out when it is durable."""
        while not self._waiting.empty():
            intent, future = self._waiting.get()
            # What nobody waits for any more must not be done.
            if future.set_running_or_notify_cancel():
                self._hold(self._controller.answer(intent, now), future, now)

    def _hold(self, answer: m.Answer, future: Future[m.Answer], now: float) -> None:
        def say(why: str) -> None:
            lost = m.Answer(ok=False, reason=f"it was decided, but is not recorded: {why}"[:500])
            future.set_result(lost if why and answer.ok else answer)

        self._acknowledged.hold(self._controller.recorded, now, say)
