"""Processes in one thread on one simulated clock, tied by a wire in memory that delays, loses, repeats and reorders.

The same cores and the same `Runner` run here and on Zenoh. The same seed gives the same messages.
"""

import functools
import hashlib
import random
import struct
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.topics import TOPIC_OF, Service, Topic
from rolling_panda.transport.codec import StrictDecoder, encode
from rolling_panda.transport.runner import Core, Runner


@dataclass
class Link:
    """What messages meet on their way.

    Attributes:
        rng: Source of chance.
        loss: Share that is lost.
        twice: Share that arrives twice.
        delay: Time on the way (s).
        jitter: Greatest additional time (s). Messages overtake each other by it.
        held: Nothing arrives until it ends; then everything that is due.
    """

    rng: random.Random
    loss: float = 0.0
    twice: float = 0.0
    delay: float = 0.001
    jitter: float = 0.0
    held: bool = False
    waiting: list[tuple[float, m.Message]] = field(default_factory=list)

    def push(self, message: m.Message, now: float) -> None:
        """A message is sent at `now` (s)."""
        if self.rng.random() < self.loss:
            return
        for _ in range(2 if self.rng.random() < self.twice else 1):
            self.waiting.append((now + self.delay + self.rng.random() * self.jitter, message))

    def arrived(self, now: float) -> list[m.Message]:
        """What arrives now, in order of arrival."""
        if self.held:
            return []
        due = sorted((item for item in self.waiting if item[0] <= now), key=lambda item: item[0])
        self.waiting = [item for item in self.waiting if item[0] > now]
        return [message for _, message in due]


@dataclass(frozen=True)
class _Publisher:
    put: Callable[[Any], None]


class MemoryWire:
    """A process's session on the wire of a `World`."""

    def __init__(self, world: "World", process: m.Process) -> None:
        """Connect."""
        self.process = process
        self.on_reject: Callable[[str, m.Reason], None] = lambda topic, reason: None
        self._world = world
        self._stores: dict[str, Callable[[Any, float], None]] = {}

    def publisher(self, topic: Topic[Any]) -> _Publisher:
        """What sends messages of a topic."""
        return _Publisher(self._world.say)

    def subscribe(self, topic: Topic[Any], store: Callable[[Any, float], None]) -> None:
        """Call `store(message, received_at)` for each message."""
        self._stores[topic.name] = store

    def serve(self, service: Service[Any], answer: Callable[[Any], m.Answer | None]) -> None:
        """Nothing: the world hands requests to the runner, since nobody may block it."""

    def ask(self, service: Service[Any], request: Any, done: Callable[[m.Answer], None]) -> None:
        """Call a service; `done` gets its answer."""
        future = self._world.request(service.server, request)
        future.add_done_callback(
            lambda answered: done(answered.result() or m.Answer(ok=False, reason=reasons.nobody_answers()))
        )

    def present(self) -> frozenset[str]:
        """Connected processes."""
        return self._world.present

    def deliver(self, topic: Topic[Any], message: m.Message, at: float) -> None:
        """A message arrives at `at` (s)."""
        if (store := self._stores.get(topic.name)) is not None:
            store(message, at)


class Node:
    """A process in a `World`: it can be suspended, and started again with another core.

    Attributes:
        core: The core.
        wire: Its session.
        runner: What ties them.
        suspended: It does not run, though what is sent to it arrives.
    """

    def __init__(
        self, world: "World", process: m.Process, ticks: int, make: Callable[[Core, MemoryWire], Runner]
    ) -> None:
        """Bind it; `start` it with a core. It runs every `ticks` ticks."""
        self.process, self.suspended = process, False
        self._world, self._ticks, self._make = world, ticks, make

    def start(self, core: Core) -> None:
        """(Re)start with this core. What has arrived at an earlier one is lost."""
        self.core = core
        self.wire = MemoryWire(self._world, self.process)
        self.runner = self._make(core, self.wire)

    def tick(self, ticks: int, now: float) -> None:
        """Run a period where it is due."""
        if ticks % self._ticks == 0 and not self.suspended:
            self.runner.turn(now)


class World:
    """Steps its processes at their rates.

    Attributes:
        now: Simulated time (s).
        ticks: Ticks since the start.
        tick_s: Length of a tick (s).
        rng: Source of all chance.
        links: What the messages of a topic meet on their way, by the topic's name; the others arrive at once.
        present: Connected processes.
    """

    def __init__(self, seed: int = 0, tick_s: float = 0.001, present: frozenset[str] = frozenset(m.PROCESSES)) -> None:
        """Without processes."""
        self.now, self.ticks, self.tick_s, self.present = 0.0, 0, tick_s, present
        self.rng = random.Random(seed)
        self.links: dict[str, Link] = {}
        self._nodes: list[Node] = []
        self._record = hashlib.sha256()

    @property
    def digest(self) -> str:
        """Hash of all messages up to now, with their times."""
        return self._record.hexdigest()

    def add(
        self,
        process: m.Process,
        core: Core,
        period_s: float,
        longest_turn: float = float("inf"),
        at_once: Mapping[type[Any], str] | None = None,
    ) -> Node:
        """Start a process.

        Args:
            process: Its name.
            core: Its core.
            period_s: Time between steps (s), a multiple of the world's tick.
            longest_turn: Longest time that its clock advances in one step, in periods.
            at_once: Names of the core's methods for messages that do not wait for the next step.
        """
        methods = at_once or {}

        def make(core: Core, wire: MemoryWire) -> Runner:
            handlers = {kind: getattr(core, name) for kind, name in methods.items()}
            clock = functools.partial(getattr, self, "now")
            return Runner(core, wire, period_s, longest_turn * period_s, handlers, clock, clock)

        node = Node(self, process, max(1, round(period_s / self.tick_s)), make)
        node.start(core)
        self._nodes.append(node)
        return node

    def tick(self) -> None:
        """Advance one tick: what is due arrives, then the processes run in the order in which they were added."""
        self.ticks += 1
        self.now = self.ticks * self.tick_s
        for link in {id(link): link for link in self.links.values()}.values():
            for message in link.arrived(self.now):
                self._deliver(message)
        for node in self._nodes:
            node.tick(self.ticks, self.now)

    def run(self, seconds: float) -> None:
        """Advance by simulated seconds."""
        for _ in range(round(seconds / self.tick_s)):
            self.tick()

    def run_until(self, condition: Callable[[], bool], limit_s: float) -> bool:
        """Advance until `condition()` holds; False when it does not within `limit_s` simulated seconds."""
        end = self.now + limit_s
        while self.now < end:
            self.run(10 * self.tick_s)
            if condition():
                return True
        return False

    def say(self, message: m.Message) -> None:
        """Send a message to the readers of its topic, encoded and decoded as on the wire."""
        data = encode(message)
        self._record.update(struct.pack("<d", self.now) + data)
        received = _decoder(type(message)).decode(data)
        link = self.links.get(TOPIC_OF[type(message)].name)
        if link is None:
            self._deliver(received)
        else:
            link.push(received, self.now)

    def request(self, process: str, request: object) -> "Future[m.Answer | None]":
        """Ask the service of a process; the answer comes in a later tick."""
        for node in self._nodes:
            if node.process == process:
                return node.runner.request(request)
        nobody: Future[m.Answer | None] = Future()
        nobody.set_result(None)
        return nobody

    def ask(self, process: str, request: object, limit_s: float = 1.0) -> m.Answer:
        """Ask the service of a process, and advance until it answers."""
        future = self.request(process, request)
        end = self.now + limit_s
        while not future.done() and self.now < end:
            self.tick()
        return (future.result() if future.done() else None) or m.Answer(ok=False, reason=reasons.answer_late(process))

    def _deliver(self, message: m.Message) -> None:
        topic = TOPIC_OF[type(message)]
        for node in self._nodes:
            node.wire.deliver(topic, message, self.now)


@functools.cache
def _decoder(kind: type[Any]) -> StrictDecoder[Any]:
    return StrictDecoder(kind)
