"""The wire over a real router on loopback: newest wins, services, presence, and refusals that are counted."""

import math
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import pytest

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.config import TransportConfig
from rolling_panda.errors import ServiceError, TransportError
from rolling_panda.messages.robot import CameraFrame, Intrinsics
from rolling_panda.reasons import said, text_of
from rolling_panda.topics import CAMERA, HEARTBEAT, INTENT, MOTION, Service, Topic, key
from rolling_panda.transport.codec import StrictDecoder
from rolling_panda.transport.rejections import Rejections
from rolling_panda.transport.zenoh import Feed, ForeignWire, Onlooker, Slot, Transport
from tests.support.processes.local_router import free_port
from tests.support.waiting import until

pytestmark = pytest.mark.processes

ROOT = Path(__file__).resolve().parents[2]


def motion(sequence: int, speed: float = 0.0) -> m.MotionCommand:
    return m.MotionCommand(epoch=1, sequence=sequence, echo=sequence, xi=(speed,) * 9)


@pytest.fixture
def controller(endpoint: str) -> Iterator[Transport]:
    with Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "controller", "rp1") as transport:
        yield transport


@pytest.fixture
def bridge(endpoint: str) -> Iterator[Transport]:
    with Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "bridge", "rp1") as transport:
        yield transport


def reach(publisher_side: Transport, topic: Topic[m.Heartbeat], received: Callable[[], bool]) -> None:
    """Send until the subscription has come about, which is not at once."""
    publisher = publisher_side.publisher(topic)
    until(lambda: (publisher.put(m.Heartbeat(process="controller", sequence=0)), received())[1])


def test_a_slot_holds_the_newest_and_gives_it_once() -> None:
    slot: Slot[m.MotionCommand] = Slot()
    assert slot.take() is None and slot.age(5.0) == math.inf
    slot.store(motion(1), 1.0)
    slot.store(motion(2), 2.0)
    taken = slot.take()
    assert taken is not None and taken.message.sequence == 2
    assert slot.take() is None
    assert slot.peek() is taken and slot.age(5.0) == 3.0


def test_a_feed_keeps_order_and_counts_what_it_drops() -> None:
    feed: Feed[m.MotionCommand] = Feed(3)
    for sequence in range(5):
        feed.store(motion(sequence), float(sequence))
    assert feed.dropped == 2
    assert [received.message.sequence for received in feed.drain()] == [2, 3, 4]
    assert feed.drain() == []


OLD, NAN = reasons.command_old(), reasons.velocity_not_finite()


def test_rejections_are_counted_by_topic_and_reason() -> None:
    rejections = Rejections()
    for reason in (OLD, OLD, NAN):
        rejections.add("command/motion", reason)
    assert rejections.counts() == (
        m.RejectionCount("command/motion", OLD, 2),
        m.RejectionCount("command/motion", NAN, 1),
    )


def test_of_a_burst_the_newest_is_left(controller: Transport, bridge: Transport) -> None:
    slot = bridge.slot(MOTION)
    publisher = controller.publisher(MOTION)
    until(lambda: (publisher.put(motion(0)), slot.peek())[1] is not None)
    for sequence in range(1, 301):
        publisher.put(motion(sequence))
    # A burst may be thinned out on the way, but nothing of it waits behind what comes after it.
    until(lambda: (publisher.put(motion(301)), sequence_held(slot))[1] == 301)
    time.sleep(0.05)
    assert sequence_held(slot) == 301
    assert slot.age(time.monotonic()) < 1.0


def sequence_held(slot: Slot[m.MotionCommand]) -> int:
    held = slot.peek()
    return -1 if held is None else held.message.sequence


def test_robots_do_not_hear_each_other(endpoint: str, bridge: Transport) -> None:
    other = bridge.slot(HEARTBEAT)
    with Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "controller", "rp2") as elsewhere:
        mine = elsewhere.slot(HEARTBEAT)
        reach(elsewhere, HEARTBEAT, lambda: mine.peek() is not None)
        assert other.peek() is None
        assert "controller" not in bridge.present()


def test_what_is_no_message_is_refused_counted_and_told(controller: Transport, bridge: Transport) -> None:
    told: list[tuple[str, m.Reason]] = []
    bridge.on_reject = lambda topic, reason: told.append((topic, reason))
    slot = bridge.slot(MOTION)
    impostor = Topic(MOTION.name, m.Heartbeat, "any", "bridge", 0, "REAL_TIME", "DROP", "wrong type", express=True)
    reach(controller, impostor, lambda: bool(told))
    controller.publisher(MOTION).put(motion(7, math.nan))
    until(lambda: any("xi" in text_of(reason) for _, reason in told))
    assert slot.peek() is None
    assert {topic for topic, _ in told} == {MOTION.name}
    counts = bridge.rejections.counts()
    assert sum(row.count for row in counts) == len(told)
    assert any("Heartbeat" in text_of(row.reason) for row in counts)
    assert any("xi" in text_of(row.reason) for row in counts)


def test_a_message_without_end_is_refused(controller: Transport, bridge: Transport) -> None:
    slot = bridge.slot(CAMERA)
    publisher = controller.publisher(CAMERA)
    until(lambda: (publisher.put(frame(bytes(9 << 20))), bridge.rejections.counts())[1] != (), 10.0)
    assert bridge.rejections.counts()[0].reason.code == "message_too_large"
    assert slot.peek() is None


def frame(color: bytes) -> CameraFrame:
    return CameraFrame(
        header=m.Header(frame_id="camera"),
        sequence=1,
        intrinsics=Intrinsics(width=4, height=4, fx=1.0, fy=1.0, cx=2.0, cy=2.0),
        base=m.PlanarPose(),
        position=(0.0,) * 9,
        color_jpeg=color,
        depth_zlib=b"",
        depth_unit=0.001,
    )


def test_a_service_answers_what_it_was_asked(controller: Transport, bridge: Transport) -> None:
    asked: list[intents.Intent] = []

    def answer(intent: intents.Intent) -> m.Answer:
        asked.append(intent)
        return m.Answer(ok=False, reason=said("not while it rains"))

    controller.serve(INTENT, answer)
    until(lambda: answered(bridge))
    assert bridge.call(INTENT, intents.RejectPoint(user="ada", point_id="p1", reason="too thick")).reason == said(
        "not while it rains"
    )
    assert asked[-1] == intents.RejectPoint(user="ada", point_id="p1", reason="too thick")


def answered(transport: Transport) -> bool:
    try:
        transport.call(INTENT, intents.Arm(user="ada"))
    except ServiceError:
        return False
    return True


def test_a_request_that_is_none_is_answered_with_the_reason(controller: Transport, bridge: Transport) -> None:
    controller.serve(INTENT, lambda intent: m.Answer(ok=True))
    until(lambda: answered(bridge))
    refused = bridge.call(INTENT, intents.AcceptAll(user="ada", confidence=math.nan))
    assert not refused.ok and "confidence" in text_of(refused.reason)
    assert [row.topic for row in controller.rejections.counts()] == [INTENT.name]


def test_a_request_without_end_is_refused_though_each_field_is_right(
    endpoint: str, controller: Transport, bridge: Transport
) -> None:
    heard: list[intents.Intent] = []
    controller.serve(INTENT, lambda intent: (heard.append(intent), m.Answer(ok=True))[1])
    until(lambda: answered(bridge))
    heard.clear()
    foreign = ForeignWire(TransportConfig(connect=(endpoint,), plain_wire=True))
    for times, allowed in ((1, True), (1 << 20, False)):
        # A map may say the same field again and again.
        fields = msgspec.msgpack.encode("type") + msgspec.msgpack.encode("Arm") + b"\xa4user\xa3ada" * times
        request = b"\xdf" + (1 + times).to_bytes(4, "big") + fields
        answer = StrictDecoder(m.Answer).decode(foreign.ask(key("rp1", INTENT.name), request, 20.0))
        assert answer.ok is allowed and len(heard) == 1
    assert "at most" in text_of(answer.reason)
    foreign.close()


def test_a_service_takes_its_own_requests_only(bridge: Transport) -> None:
    with pytest.raises(ServiceError, match="takes Arm"):
        bridge.call(INTENT, m.Heartbeat(process="bridge", sequence=1))  # type: ignore[arg-type]


def test_a_service_that_nobody_serves_says_whom_to_start(bridge: Transport) -> None:
    nobody = Service("service/nobody", (intents.Arm,), "controller", 0.2, "nobody is there")
    with pytest.raises(ServiceError, match="is the controller running"):
        bridge.call(nobody, intents.Arm(user="ada"))


def test_processes_see_each_other_and_an_onlooker_is_not_seen(
    endpoint: str, controller: Transport, bridge: Transport
) -> None:
    with Onlooker(TransportConfig(connect=(endpoint,), plain_wire=True), "rp1") as onlooker:
        until(lambda: onlooker.present() == {"controller", "bridge"})
        assert bridge.present() == {"controller", "bridge"}
        controller.close()
        until(lambda: onlooker.present() == {"bridge"})


def test_a_killed_process_is_gone_at_once(endpoint: str, bridge: Transport) -> None:
    code = (
        "import sys, signal\n"
        "from rolling_panda.config import TransportConfig\n"
        "from rolling_panda.transport.zenoh import Transport\n"
        "transport = Transport(TransportConfig(connect=(sys.argv[1],), plain_wire=True), 'perception', 'rp1')\n"
        "signal.pause()\n"
    )
    child = subprocess.Popen([sys.executable, "-c", code, endpoint], cwd=ROOT)
    try:
        until(lambda: "perception" in bridge.present(), 20.0)
        child.send_signal(signal.SIGKILL)
        assert until(lambda: "perception" not in bridge.present(), 2.0) < 0.4
    finally:
        child.kill()
        child.wait()


def test_without_a_router_one_line_says_so() -> None:
    config = TransportConfig(connect=(f"tcp/127.0.0.1:{free_port()}",), connect_timeout_s=0.3, plain_wire=True)
    with pytest.raises(TransportError, match="Is the router running") as error:
        Transport(config, "bridge", "rp1")
    assert "\n" not in str(error.value) and ".rs:" not in str(error.value)


def test_closing_twice_is_no_mistake(endpoint: str) -> None:
    transport = Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "server", "rp1")
    transport.close()
    transport.close()


def test_what_must_not_get_lost_waits_where_the_way_is_full(endpoint: str) -> None:
    sent, came = 200, 0

    def slowly(data: bytes, at: float) -> None:
        nonlocal came
        came += 1
        time.sleep(0.3 if came == 2 else 0.0)

    listener = ForeignWire(TransportConfig(connect=(endpoint,), plain_wire=True))
    listener.subscribe("full/way", slowly)
    speaker = ForeignWire(TransportConfig(connect=(endpoint,), plain_wire=True))
    put = speaker.publisher("full/way", lossless=True)
    put(b"")
    until(lambda: came > 0)
    for _ in range(sent):
        put(bytes(200_000))
    until(lambda: came == 1 + sent, 10.0)
    speaker.close()
    listener.close()
