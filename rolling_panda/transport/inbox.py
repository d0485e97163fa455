"""The messages that have arrived at a process: the input of its `step`. No thread, clock or wire."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from rolling_panda import messages as m
from rolling_panda.topics import TOPIC_OF

T = TypeVar("T")
#: A message with an older stamp is accepted after this time (s): its sender has restarted.
_RESTART_S = 0.2


@dataclass(frozen=True)
class Received(Generic[T]):
    """A message and its time of arrival (s, the clock of the reader)."""

    message: T
    at: float


@dataclass(frozen=True)
class Request:
    """A request of a service. Whoever answers it sends a `Reply`.

    Attributes:
        message: The request.
        at: Time of arrival (s).
        accept: False where the caller has given up: the request must not be executed.
        reply: Hands the answer to the caller.
    """

    message: Any
    at: float
    accept: Callable[[], bool]
    reply: Callable[[m.Answer | None], None]


@dataclass(frozen=True)
class Reply:
    """Output of a `step`: the answer of a request; None leaves it to another server."""

    request: Request
    answer: m.Answer | None


@dataclass(frozen=True)
class Answered:
    """Input of a `step`: the answer of a request that it sent."""

    request: Any
    answer: m.Answer


@dataclass(frozen=True)
class Rejected:
    """Input of a `step`: a message that could not be decoded."""

    topic: str
    reason: m.Reason


class Inbox:
    """Messages by type: the newest, or all since the last step, as the topic table says.

    Results of a process's own workers, which are on no topic, are kept newest-wins too.

    Attributes:
        present: Connected processes.
        wall_time: Wall clock (s since 1970), for texts only.
        requests: Requests of services in order of arrival.
        ticks: Periods of the loop.
        late_ticks: Periods that lasted more than 1.5 times their nominal length.
        tick_s: Median duration of a step (s).
    """

    _QUEUED: dict[type[Any], int] = {
        Answered: 32,
        Rejected: 1000,
        **{kind: topic.queue for kind, topic in TOPIC_OF.items() if topic.queue},
    }
    _ORDERED = frozenset(kind for kind, topic in TOPIC_OF.items() if topic.ordered)

    def __init__(self) -> None:
        """Start empty."""
        self.present: frozenset[str] = frozenset()
        self.wall_time = 0.0
        self.requests: deque[Request] = deque()
        self.ticks = self.late_ticks = 0
        self.tick_s = 0.0
        self._newest: dict[type[Any], Received[Any]] = {}
        self._queues: dict[type[Any], deque[Received[Any]]] = {}
        self._beats: dict[str, Received[m.Heartbeat]] = {}

    def put(self, message: object, at: float) -> None:
        """Store a message that arrived at `at` (s)."""
        kind, received = type(message), Received(message, at)
        if isinstance(message, m.Heartbeat):
            last = self._beats.get(message.process)
            # A heartbeat with an unchanged number comes from a loop that hangs.
            if last is None or last.message.sequence != message.sequence:
                self._beats[message.process] = Received(message, at)
        elif (length := self._QUEUED.get(kind)) is not None:
            self._queues.setdefault(kind, deque(maxlen=length)).append(received)
        elif kind not in self._ORDERED or _newer(self._newest.get(kind), received):
            self._newest[kind] = received

    def newest(self, kind: type[T]) -> Received[T] | None:
        """The newest message of a type, however old; None before the first."""
        return self._newest.get(kind)

    def drain(self, kind: type[T]) -> list[Received[T]]:
        """Remove and return the messages of a queued type, oldest first."""
        queue = self._queues.get(kind)
        if not queue:
            return []
        messages = list(queue)
        queue.clear()
        return messages

    def heard(self, process: m.Process) -> float | None:
        """Time of the newest heartbeat of a process whose loop runs (s); None before the first."""
        beat = self._beats.get(process)
        return None if beat is None else beat.at

    def next_request(self) -> Request | None:
        """Remove and return the oldest request whose caller still waits."""
        while self.requests:
            request = self.requests.popleft()
            if request.accept():
                return request
        return None


def _newer(kept: Received[Any] | None, offered: Received[Any]) -> bool:
    if kept is None:
        return True
    ahead = offered.message.header.stamp - kept.message.header.stamp
    # A repetition is never new, however late it arrives.
    return bool(ahead > 0.0 or (ahead < 0.0 and offered.at - kept.at > _RESTART_S))
