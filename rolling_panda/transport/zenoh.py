"""The wire: publishers, newest-wins slots, bounded feeds, services and liveliness over Zenoh.

No other module imports Zenoh. Ages are measured on the receiver's monotonic clock.
"""

import json
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

import zenoh
from msgspec import Struct

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.closing import Closing
from rolling_panda.config import TransportConfig
from rolling_panda.errors import ServiceError, TransportError
from rolling_panda.topics import Service, Topic, key
from rolling_panda.transport.access import ONLOOKER
from rolling_panda.transport.codec import StrictDecoder, UndecodableError, encode
from rolling_panda.transport.inbox import Received
from rolling_panda.transport.rejections import Rejections
from rolling_panda.transport.settings import certificate_folder, wire_settings
from rolling_panda.transport.traffic import Traffic

Msg = TypeVar("Msg", bound=m.Message)
Req = TypeVar("Req", bound=Struct)
_MAX_MESSAGE_BYTES = 8 << 20


class Publisher(Generic[Msg]):
    """Sends messages of one topic."""

    def __init__(self, publisher: zenoh.Publisher) -> None:
        """Wrap a declared Zenoh publisher."""
        self._publisher = publisher

    def put(self, message: Msg) -> None:
        """Send one message; returns at once."""
        self._publisher.put(encode(message))


class Slot(Generic[Msg]):
    """Holds the newest message of a topic; older ones are dropped."""

    def __init__(self) -> None:
        """Start empty."""
        self._newest: Received[Msg] | None = None
        self._taken: Received[Msg] | None = None

    def store(self, message: Msg, at: float) -> None:
        """Replace the message."""
        self._newest = Received(message, at)

    def peek(self) -> Received[Msg] | None:
        """The newest message, however old, or None before the first."""
        return self._newest

    def take(self) -> Received[Msg] | None:
        """The newest message if it has not been taken before, else None."""
        newest = self._newest
        if newest is self._taken:
            return None
        self._taken = newest
        return newest

    def age(self, now: float) -> float:
        """Time since the arrival of the newest message (s); infinite before the first."""
        newest = self._newest
        return float("inf") if newest is None else now - newest.at


class Feed(Generic[Msg]):
    """Keeps the last messages of a topic in order of arrival; when full the oldest are dropped and counted."""

    def __init__(self, capacity: int) -> None:
        """Hold up to `capacity` messages."""
        self._queue: deque[Received[Msg]] = deque(maxlen=capacity)
        self.dropped = 0

    def store(self, message: Msg, at: float) -> None:
        """Append one message."""
        if len(self._queue) == self._queue.maxlen:
            self.dropped += 1
        self._queue.append(Received(message, at))

    def drain(self) -> list[Received[Msg]]:
        """Remove and return all messages, oldest first."""
        out = []
        while self._queue:
            out.append(self._queue.popleft())
        return out


class Onlooker(Closing):
    """A read-only session on the wire of one robot, without liveliness. Use as a context manager, or call `close`."""

    def __init__(self, config: TransportConfig, robot_id: str, name: str = ONLOOKER) -> None:
        """Open the session; `name` is that of the certificate to present, where there is one.

        Raises:
            TransportError: The router cannot be reached or an endpoint is wrong.
        """
        self.robot_id = robot_id
        #: Whether the wire is unencrypted and open to every program on this machine.
        self.plain = config.plain_wire
        self.rejections, self.traffic = Rejections(), Traffic()
        self.on_reject: Callable[[str, m.Reason], None] = lambda topic, reason: None
        self._present: set[str] = set()
        self._session = _open(config, name, robot_id)
        self._presence = self._session.liveliness().declare_subscriber(
            key(robot_id, "alive/*"), self._on_presence, history=True
        )

    def slot(self, topic: Topic[Msg]) -> Slot[Msg]:
        """Subscribe, newest wins."""
        slot: Slot[Msg] = Slot()
        self.subscribe(topic, slot.store)
        return slot

    def feed(self, topic: Topic[Msg], capacity: int) -> Feed[Msg]:
        """Subscribe, keeping the last `capacity` messages."""
        feed: Feed[Msg] = Feed(capacity)
        self.subscribe(topic, feed.store)
        return feed

    def subscribe(self, topic: Topic[Msg], store: Callable[[Msg, float], None]) -> None:
        """Call `store(message, received_at)` for each valid message, on a thread of the transport.

        `store` must return at once: samples behind it wait.
        """
        decoder = StrictDecoder(topic.message)
        # A second subscription gets the same messages.
        if counts := not self.traffic.knows(topic.name):
            self.traffic.begin(topic.name)

        def receive(sample: zenoh.Sample) -> None:
            at = time.monotonic()
            if counts:
                self.traffic.add(topic.name, at)
            try:
                message = decoder.decode(_bounded(sample.payload.to_bytes()))
            except UndecodableError as error:
                self._reject(topic.name, error.reason)
                return
            store(message, at)

        self._session.declare_subscriber(key(self.robot_id, topic.name), receive)

    def present(self) -> frozenset[str]:
        """Processes of this robot that are connected. For display and as an early warning, never as a watchdog."""
        return frozenset(self._present)

    def close(self) -> None:
        """Close the session; safe to call twice."""
        if not self._session.is_closed():
            self._session.close()

    def _reject(self, topic: str, reason: m.Reason) -> None:
        self.rejections.add(topic, reason)
        self.on_reject(topic, reason)

    def _on_presence(self, sample: zenoh.Sample) -> None:
        name = str(sample.key_expr).rsplit("/", 1)[-1]
        if sample.kind == zenoh.SampleKind.PUT:
            self._present.add(name)
        else:
            self._present.discard(name)


class Transport(Onlooker):
    """A process's session on the wire of one robot: it declares liveliness, publishes, serves and calls."""

    def __init__(self, config: TransportConfig, process: m.Process, robot_id: str) -> None:
        """Open the session and declare the process's liveliness.

        Raises:
            TransportError: The router cannot be reached or an endpoint is wrong.
        """
        super().__init__(config, robot_id, process)
        self.process = process
        self._token = self._session.liveliness().declare_token(key(robot_id, f"alive/{process}"))

    def publisher(self, topic: Topic[Msg]) -> Publisher[Msg]:
        """A publisher with the topic's priority and congestion control."""
        return Publisher(
            self._session.declare_publisher(
                key(self.robot_id, topic.name),
                priority=getattr(zenoh.Priority, topic.priority),
                congestion_control=getattr(zenoh.CongestionControl, topic.congestion),
                express=topic.express,
            )
        )

    def serve(self, service: Service[Req], answer: Callable[[Req], m.Answer | None]) -> None:
        """Answer requests with `answer(request)`, on a thread of the transport; None leaves it to another server."""
        decoder = StrictDecoder(*service.requests)

        def reply(query: zenoh.Query) -> None:
            with query:
                try:
                    payload = query.payload
                    request = decoder.decode(_bounded(payload.to_bytes() if payload is not None else b""))
                except UndecodableError as error:
                    self._reject(service.name, error.reason)
                    result: m.Answer | None = m.Answer(ok=False, reason=error.reason)
                else:
                    result = answer(request)
                if result is not None:
                    query.reply(query.key_expr, encode(result))

        self._session.declare_queryable(key(self.robot_id, service.name), reply)

    def call(self, service: Service[Req], request: Req) -> m.Answer:
        """Call a service and wait for its answer; blocks up to the service's timeout.

        Raises:
            ServiceError: No answer came in time, or not an `Answer`.
        """
        if not isinstance(request, service.requests):
            names = ", ".join(t.__name__ for t in service.requests)
            raise ServiceError(f"{service.name} takes {names}; got {type(request).__name__}")
        replies = self._session.get(
            key(self.robot_id, service.name),
            payload=zenoh.ZBytes(encode(request)),
            timeout=service.timeout_s,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )
        for item in replies:
            if item.ok is None:
                break
            try:
                return StrictDecoder(m.Answer).decode(item.ok.payload.to_bytes())
            except UndecodableError as error:
                raise ServiceError(f"{service.name} sent something else than an answer: {error}") from error
        raise ServiceError(
            f"{service.name} did not answer within {service.timeout_s} s: is the {service.server} running?"
        )

    def ask(self, service: Service[Req], request: Req, done: Callable[[m.Answer], None]) -> None:
        """Call a service without waiting; `done` gets its answer, or a refusal with the cause, on another thread."""

        def call() -> None:
            try:
                answer = self.call(service, request)
            except ServiceError as error:
                answer = m.Answer(ok=False, reason=reasons.service_silent(service.server, str(error)))
            done(answer)

        threading.Thread(target=call, daemon=True).start()


class ForeignWire:
    """A session for keys and bytes of other programs, such as a base that speaks ROS 2 through a Zenoh bridge."""

    def __init__(self, config: TransportConfig, name: str = "bridge") -> None:
        """Open the session; `name` is that of the certificate to present, where there is one.

        Raises:
            TransportError: The router cannot be reached or an endpoint is wrong.
        """
        self._session = _open(config, name, foreign=True)

    def publisher(self, name: str, lossless: bool = False) -> Callable[[bytes], None]:
        """A function that sends bytes under this key.

        Args:
            name: The key.
            lossless: On congestion wait, for some seconds at most, instead of dropping samples.
        """
        full = zenoh.CongestionControl.BLOCK if lossless else zenoh.CongestionControl.DROP
        publisher = self._session.declare_publisher(
            name, priority=zenoh.Priority.REAL_TIME, congestion_control=full, express=True
        )
        return publisher.put

    def subscribe(self, name: str, store: Callable[[bytes, float], None]) -> None:
        """Call `store(bytes, received_at)` on a thread of the transport; samples that are too large are dropped."""

        def receive(sample: zenoh.Sample) -> None:
            if len(sample.payload) <= _MAX_MESSAGE_BYTES:
                store(sample.payload.to_bytes(), time.monotonic())

        self._session.declare_subscriber(name, receive)

    def serve(self, name: str, answer: Callable[[bytes], bytes]) -> None:
        """Answer requests under this key, on a thread of the transport."""

        def reply(query: zenoh.Query) -> None:
            with query:
                query.reply(query.key_expr, answer(query.payload.to_bytes() if query.payload is not None else b""))

        self._session.declare_queryable(name, reply)

    def ask(self, name: str, request: bytes, timeout_s: float) -> bytes:
        """Call a service and wait for its reply.

        Raises:
            ServiceError: No reply came in time.
        """
        for item in self._session.get(name, payload=zenoh.ZBytes(request), timeout=timeout_s):
            if item.ok is not None:
                return item.ok.payload.to_bytes()
        raise ServiceError(f"{name} did not answer within {timeout_s} s: is its node running, and the bridge to Zenoh?")

    def close(self) -> None:
        """Close the session; safe to call twice."""
        if not self._session.is_closed():
            self._session.close()


class Router:
    """The Zenoh router of the wire, run inside this process."""

    def __init__(self, config: TransportConfig) -> None:
        """Listen on `config.listen`; with certificates, access control applies.

        Raises:
            TransportError: An endpoint is taken or wrong, or the router's own certificate is not valid now.
        """
        if cause := _out_of_date(config, "router"):
            raise TransportError(f"nobody could come in: {cause}")
        try:
            self._session = zenoh.open(_zenoh_config(config, "router"))
        except zenoh.ZError as error:
            raise TransportError(
                f"cannot listen on {', '.join(config.listen)}: {_plain(error)}. Choose another port."
            ) from error

    def close(self) -> None:
        """Stop routing."""
        self._session.close()


def _open(config: TransportConfig, name: str, robot_id: str = "", foreign: bool = False) -> zenoh.Session:
    try:
        return zenoh.open(_zenoh_config(config, name, robot_id, foreign))
    except zenoh.ZError as error:
        cause = _out_of_date(config, name, robot_id) or "Is the router running?"
        raise TransportError(
            f"no wire at {', '.join(config.connect + config.listen)}: {_plain(error)}. {cause}"
        ) from error


def _out_of_date(config: TransportConfig, name: str, robot_id: str = "") -> str:
    """Why the presented certificate is not valid now; empty where it is, or where there is none."""
    if not config.certificates:
        return ""
    # Imported here, since only a failed connection needs it.
    from rolling_panda.transport.certificates import out_of_date

    return out_of_date(certificate_folder(config, robot_id), name)


def _plain(error: zenoh.ZError) -> str:
    """Zenoh's error message without its source locations."""
    return re.sub(r" at /\S+\.rs:\d+\.?", "", str(error)).rstrip(". ")


def _bounded(data: bytes) -> bytes:
    if len(data) > _MAX_MESSAGE_BYTES:
        raise UndecodableError(reasons.message_too_large(len(data), _MAX_MESSAGE_BYTES))
    return data


def _zenoh_config(config: TransportConfig, name: str, robot_id: str = "", foreign: bool = False) -> zenoh.Config:
    out = zenoh.Config()
    for path, value in wire_settings(config, name, robot_id, foreign).items():
        out.insert_json5(path, json.dumps(value))
    return out
