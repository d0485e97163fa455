"""Ties the pure core of a process to a wire: inputs, outputs, services, rate and clock from the topic table."""

import functools
import math
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from dataclasses import dataclass
from typing import Any, Protocol

from rolling_panda import __version__, reasons
from rolling_panda import messages as m
from rolling_panda.topics import SERVICES, TOPICS, Service, Topic
from rolling_panda.transport.access import CALLERS
from rolling_panda.transport.inbox import Answered, Inbox, Rejected, Reply, Request

#: Largest time that is left out at once (s), and the fraction of the elapsed time that it recovers by.
_BUDGET_S, _RECOVERY = 1.0, 0.25


class LoopClock:
    """Measures ages for a loop that may itself stall.

    After a stall, for instance without processor time or on a suspended machine, every input seems as old as the stall,
    although its sender is alive and newer messages wait to be read. So the time of a period beyond `longest_s` does not
    count. The bridge's watchdog judges the robot's motion meanwhile, on its own clock.

    At most a second is left out at once, and a quarter of the time in the long run: a loop that is always slow, or has
    stalled for long, must not take stale inputs for fresh ones.
    """

    def __init__(self, now: float, longest_s: float) -> None:
        """Start.

        Args:
            now: Monotonic time (s).
            longest_s: Longest period that is no stall (s).
        """
        # One tuple, so that other threads read consistent values: the last period's start on the machine's clock and on
        # this one, and the remaining budget.
        self._turned = (now, now, _BUDGET_S)
        self._longest = longest_s

    def turn(self, now: float) -> float:
        """Start a period of the loop at `now` (s, monotonic); returns the time on this clock (s)."""
        turned, time, budget = self._turned
        passed, counted = now - turned, self.of(now) - time
        self._turned = (now, time + counted, min(_BUDGET_S, budget - (passed - counted) + _RECOVERY * passed))
        return time + counted

    def of(self, at: float) -> float:
        """Convert a monotonic time (s) to this clock (s). Thread-safe."""
        turned, time, budget = self._turned
        passed = at - turned
        return time + passed - min(max(passed - self._longest, 0.0), budget)


#: Periods in the median of the step's duration, and how often it is computed (periods).
_TIMED, _TIMED_EVERY = 200, 20
#: A period is late from this multiple of its nominal length.
_LATE = 1.5
#: The process answers this long before its caller gives up (s).
_ANSWER_MARGIN_S = 0.2
#: Rejected messages and answers that wait for the loop, each at most.
_OWN = 20


@dataclass(frozen=True)
class Standby:
    """Output of a `step`: whether latched messages are kept back, as another process says them meanwhile."""

    on: bool


class Core(Protocol):
    """The pure core of a process."""

    def step(self, inbox: Inbox, now: float) -> Sequence[object]:
        """Advance to `now` (s, monotonic). Returns messages; the topic or service follows from the type."""

    def end(self) -> Sequence[object]:
        """The last messages."""


class Sender(Protocol):
    """Sends messages of one topic."""

    def put(self, message: Any) -> None:
        """Send one message."""


class Wire(Protocol):
    """A process's session: `transport.zenoh.Transport`, or `transport.memory.MemoryWire`."""

    process: m.Process
    on_reject: Callable[[str, m.Reason], None]

    def publisher(self, topic: Topic[Any]) -> Sender:
        """What sends messages of a topic."""

    def subscribe(self, topic: Topic[Any], store: Callable[[Any, float], None]) -> None:
        """Call `store(message, received_at)` for each message."""

    def serve(self, service: Service[Any], answer: Callable[[Any], m.Answer | None]) -> None:
        """Answer requests."""

    def ask(self, service: Service[Any], request: Any, done: Callable[[m.Answer], None]) -> None:
        """Call a service without waiting; `done` gets its answer, on any thread."""

    def present(self) -> frozenset[str]:
        """Connected processes."""


class Runner:
    """Runs one core on one wire.

    Messages arrive on threads of the wire. The loop's thread moves them into the inbox, calls `step` and sends what it
    returns. The newest message of a latched topic is repeated at the topic's rate.

    Attributes:
        inbox: What has arrived.
    """

    def __init__(
        self,
        core: Core,
        wire: Wire,
        period_s: float,
        longest_turn_s: float = math.inf,
        at_once: Mapping[type[Any], Callable[[Any, float], None]] | None = None,
        clock: Callable[[], float] = time.monotonic,
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        """Subscribe, advertise and serve what the topic table says of the wire's process.

        Args:
            core: The process.
            wire: Open session.
            period_s: Time between steps (s).
            longest_turn_s: Longest time that the clock of `step` advances in one period (s); see `LoopClock`.
            at_once: Handlers of messages that do not wait for the next step. They get the message and the wall clock
                (s since 1970), on a thread of the wire, never during a step.
            clock: Monotonic clock (s).
            wall_clock: Clock for texts (s since 1970).
        """
        self._core, self._wire, self._period = core, wire, period_s
        self._time, self._wall_clock = clock, wall_clock
        self._clock = LoopClock(clock(), longest_turn_s)
        self.inbox = Inbox()
        self._lock, self._wake = threading.Lock(), threading.Event()
        self._arrived: dict[type[Any], tuple[Any, float]] = {}
        self._queued: dict[type[Any], deque[tuple[Any, float]]] = {
            own: deque(maxlen=_OWN) for own in (Rejected, Answered)
        }
        self._asked: deque[tuple[Any, float, Future[m.Answer | None]]] = deque()
        self._latched: dict[type[Any], tuple[Any, float]] = {}
        self._durations: deque[float] = deque(maxlen=min(max(1, round(1.0 / period_s)), _TIMED))
        self._sends: dict[type[Any], Callable[[Any], None]] = {Reply: _reply, Standby: self._stand_by}
        immediate = at_once or {}
        self._repeats: dict[type[Any], tuple[Callable[[Any], None], float]] = {}
        self._standby = False
        wire.on_reject = self._reject
        for topic in TOPICS:
            if topic.said_by(wire.process):
                put = wire.publisher(topic).put
                self._sends[topic.message] = self._latch if topic.latched else put
                if topic.latched:
                    self._repeats[topic.message] = put, 1.0 / topic.rate_hz
            if topic.read_by(wire.process):
                handler = immediate.get(topic.message)
                wire.subscribe(topic, self._receiver(topic) if handler is None else self._immediate(handler))
        self._latch(m.Program(process=wire.process, version=__version__, began_at=wall_clock()))
        for service in SERVICES:
            if service.server == wire.process:
                wire.serve(service, functools.partial(self._ask, service))
            if wire.process in CALLERS[service.name]:
                for kind in service.requests:
                    self._sends[kind] = functools.partial(self._call, service)

    def run(self, stopping: threading.Event) -> None:
        """Run until `stopping` is set. Missed periods are skipped."""
        due = began = self._time()
        while not stopping.is_set():
            started = self._time()
            self.inbox.late_ticks += started - began > _LATE * self._period
            began = started
            self.turn(started)
            due += self._period
            wait = due - self._time()
            if wait <= 0.0:
                due += int(-wait / self._period) * self._period
            elif self._wake.wait(wait):
                due = self._time()
            self._wake.clear()
        self._send(self._core.end())

    def turn(self, clock: float) -> None:
        """One period at `clock` (s, monotonic)."""
        now = self._clock.turn(clock)
        inbox = self.inbox
        self._collect(inbox)
        with self._lock:
            out = self._core.step(inbox, now)
        self._durations.append(self._time() - clock)
        self._send(out)
        if not self._standby:
            for kind, (message, due) in self._latched.items():
                if now >= due:
                    put, period = self._repeats[kind]
                    put(message)
                    self._latched[kind] = message, now + period

    def _collect(self, inbox: Inbox) -> None:
        """Move what has arrived into the inbox, with times of the loop's clock."""
        inbox.ticks += 1
        if inbox.ticks % _TIMED_EVERY == 0:
            inbox.tick_s = statistics.median(self._durations)
        inbox.present, inbox.wall_time = self._wire.present(), self._wall_clock()
        clock = self._clock
        while self._arrived:
            _, (message, at) = self._arrived.popitem()
            inbox.put(message, clock.of(at))
        for queue in self._queued.values():
            while queue:
                message, at = queue.popleft()
                inbox.put(message, clock.of(at))
        while self._asked:
            message, at, future = self._asked.popleft()
            accept = future.set_running_or_notify_cancel
            inbox.requests.append(Request(message, clock.of(at), accept, future.set_result))

    def _latch(self, message: Any) -> None:
        self._latched[type(message)] = message, -math.inf

    def _stand_by(self, standby: Standby) -> None:
        self._standby = standby.on
        for message, _ in list(self._latched.values()):
            self._latch(message)

    def _send(self, out: Sequence[object]) -> None:
        for message in out:
            self._sends[type(message)](message)

    def _receiver(self, topic: Topic[Any]) -> Callable[[Any, float], None]:
        """What takes the messages of a topic, on a thread of the wire."""
        arrived, wake, kind = self._arrived, self._wake, topic.message

        def newest(message: Any, at: float) -> None:
            arrived[kind] = message, at
            if topic.wakes:
                wake.set()

        if not topic.queue:
            return newest
        queue = self._queued[kind] = deque(maxlen=topic.queue)
        return lambda message, at: queue.append((message, at))

    def _immediate(self, handler: Callable[[Any, float], None]) -> Callable[[Any, float], None]:
        def handle(message: Any, at: float) -> None:
            with self._lock:
                handler(message, self._wall_clock())

        return handle

    def _reject(self, topic: str, reason: m.Reason) -> None:
        self._queued[Rejected].append((Rejected(topic, reason), self._time()))

    def wake(self) -> None:
        """End the wait for the next step; from any thread."""
        self._wake.set()

    def request(self, request: Any) -> "Future[m.Answer | None]":
        """Hand a request to the core. Its answer is None where another process has to answer."""
        future: Future[m.Answer | None] = Future()
        # It waits for the next step: a step before its time would move the robot further than its period allows.
        self._asked.append((request, self._time(), future))
        return future

    def _ask(self, service: Service[Any], request: Any) -> m.Answer | None:
        """Hand a request to the core and wait for its answer, on a thread of the wire."""
        future = self.request(request)
        try:
            return future.result(service.timeout_s - _ANSWER_MARGIN_S)
        except FutureTimeoutError:
            if future.cancel():
                return m.Answer(ok=False, reason=reasons.answer_late(service.server))
            return m.Answer(ok=False, reason=reasons.answer_missing())

    def _call(self, service: Service[Any], request: Any) -> None:
        def done(answer: m.Answer) -> None:
            self._queued[Answered].append((Answered(request, answer), self._time()))

        self._wire.ask(service, request, done)


def _reply(reply: Reply) -> None:
    reply.request.reply(reply.answer)
