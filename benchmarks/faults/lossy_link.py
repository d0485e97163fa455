"""One way from a process to another that loses, delays, repeats, reorders, spoils, replays or holds back messages."""

import heapq
import itertools
import random
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

#: How many of the last messages of a topic are kept to be replayed.
_KEPT = 200


@dataclass(frozen=True)
class WayFault:
    """What a way does to the messages of one topic.

    Attributes:
        loss: Share that is lost.
        delay_s: By which each comes later.
        jitter_s: By which each comes later on top, evenly drawn, so that messages overtake each other.
        twice: Share that comes twice, the second time up to 50 ms later.
        corrupt: Share in which a byte is changed.
        every_s: No more than one message in this time, the others wait behind it; 0 for as fast as they come.
        held: Everything waits until the fault is changed, and then comes at once.
    """

    loss: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    twice: float = 0.0
    corrupt: float = 0.0
    every_s: float = 0.0
    held: bool = False


@dataclass(frozen=True)
class Parcel:
    """A message on its way: its topic, its bytes, and what hands them over."""

    topic: str
    payload: bytes
    deliver: Callable[[bytes], None]


class BadWay:
    """Carries parcels on a thread of its own. Without a fault they go at once and in order."""

    def __init__(self, seed: int, clock: Callable[[], float] = time.monotonic) -> None:
        """Nothing is wrong yet; `seed` draws what is lost or spoiled."""
        self._rng, self._clock = random.Random(seed), clock
        self._faults: dict[str, WayFault] = {}
        self._queue: list[tuple[float, int, Parcel]] = []
        self._held: list[Parcel] = []
        self._kept: dict[str, list[Parcel]] = {}
        self._last: dict[str, float] = {}
        self._number = itertools.count()
        self._changed = threading.Condition()
        self._ended = False
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def set(self, topic: str, fault: WayFault) -> None:
        """From now on; `*` is every topic that has no fault of its own."""
        with self._changed:
            self._faults[topic] = fault
            held, self._held = self._held, []
            for parcel in held:
                self._take(parcel)
            self._changed.notify()

    def clear(self) -> None:
        """Nothing is wrong any more; what was held back comes at once."""
        with self._changed:
            self._faults.clear()
            held, self._held = self._held, []
            for parcel in held:
                self._take(parcel)
            self._changed.notify()

    def replay(self, topic: str) -> int:
        """Send the last messages of a topic once more, as they were; returns how many."""
        with self._changed:
            kept = list(self._kept.get(topic, ()))
            for parcel in kept:
                self._push(self._clock(), parcel)
            self._changed.notify()
        return len(kept)

    def send(self, parcel: Parcel) -> None:
        """Put something on its way."""
        with self._changed:
            kept = self._kept.setdefault(parcel.topic, [])
            kept.append(parcel)
            del kept[:-_KEPT]
            self._take(parcel)
            self._changed.notify()

    def close(self) -> None:
        """Carry nothing more."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join()

    def _take(self, parcel: Parcel) -> None:
        fault = self._faults.get(parcel.topic) or self._faults.get("*") or WayFault()
        if fault.held:
            self._held.append(parcel)
            return
        if self._rng.random() < fault.loss:
            return
        if self._rng.random() < fault.corrupt:
            parcel = Parcel(parcel.topic, self._spoilt(parcel.payload), parcel.deliver)
        at = self._clock() + fault.delay_s + self._rng.random() * fault.jitter_s
        if fault.every_s:
            at = self._last[parcel.topic] = max(at, self._last.get(parcel.topic, 0.0) + fault.every_s)
        self._push(at, parcel)
        if self._rng.random() < fault.twice:
            self._push(at + 0.05 * self._rng.random(), parcel)

    def _push(self, at: float, parcel: Parcel) -> None:
        heapq.heappush(self._queue, (at, next(self._number), parcel))

    def _spoilt(self, payload: bytes) -> bytes:
        place = self._rng.randrange(max(len(payload), 1))
        return payload[:place] + bytes([self._rng.randrange(256)]) + payload[place + 1 :]

    def _carry(self) -> None:
        while True:
            with self._changed:
                while not self._ended and (not self._queue or self._queue[0][0] > self._clock()):
                    wait = self._queue[0][0] - self._clock() if self._queue else None
                    self._changed.wait(wait)
                if self._ended:
                    return
                _, _, parcel = heapq.heappop(self._queue)
            parcel.deliver(parcel.payload)
