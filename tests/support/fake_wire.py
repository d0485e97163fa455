"""A wire in memory for tests of one process: what is published can be read back, and services answer as told."""

import threading
import time
from collections import defaultdict
from contextlib import contextmanager
from functools import cache

from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.messages.perception import Localisation
from rolling_panda.model.robot import pose_message
from rolling_panda.reasons import said
from rolling_panda.transport.codec import StrictDecoder, encode
from rolling_panda.transport.traffic import Traffic
from rolling_panda.transport.zenoh import Feed, Slot
from tests.support.points import point


@cache
def decoder(kind):
    return StrictDecoder(kind)


def as_received(message):
    """A message as it comes to the others: what they would refuse fails here."""
    return decoder(type(message)).decode(encode(message))


class FakePublisher:
    def __init__(self, topic, sent):
        self._kind, self._sent = topic.message, sent

    def put(self, message):
        assert isinstance(message, self._kind)
        self._sent.append(as_received(message))


class FakeWire:
    """Stands where a `Transport` stands; the test is the rest of the robot."""

    def __init__(self, process="server"):
        self.process = process
        self.plain = False
        self.sent = defaultdict(list)
        self.asked = []
        self.answer = lambda request: m.Answer(ok=True, reason=said("done"))
        self.processes = {"bridge", "controller", "perception", "server"}
        self.on_reject = lambda topic, reason: None
        self.services = {}
        self._stores = defaultdict(list)
        self.traffic = Traffic()

    def publisher(self, topic):
        return FakePublisher(topic, self.sent[topic.name])

    def subscribe(self, topic, store):
        self._stores[topic.name].append(store)
        if not self.traffic.knows(topic.name):
            self.traffic.begin(topic.name)

    def slot(self, topic):
        slot = Slot()
        self.subscribe(topic, slot.store)
        return slot

    def feed(self, topic, capacity):
        feed = Feed(capacity)
        self.subscribe(topic, feed.store)
        return feed

    def serve(self, service, answer):
        self.services[service.name] = answer

    def call(self, service, request):
        self.asked.append(request)
        return self.answer(request)

    def ask(self, service, request, done):
        done(self.call(service, request))

    def present(self):
        return frozenset(self.processes)

    def deliver(self, topic, message, at=None):
        """A message comes in on `topic`."""
        at = time.monotonic() if at is None else at
        if self._stores[topic.name]:
            self.traffic.add(topic.name, at)
        for store in self._stores[topic.name]:
            store(message, at)


HEADER = m.Header(stamp=0.0, frame_id="odom")
ARM = (1.57, -1.2, 0.0, -2.6, 0.0, 1.9, 0.785)


def joints(sequence=1, arm=ARM):
    return m.JointState(header=HEADER, sequence=sequence, position=(0.0, 0.0, *arm), velocity=(0.0,) * 9)


def odometry(sequence=1, x=0.0):
    return m.Odometry(header=HEADER, sequence=sequence, pose=m.PlanarPose(x, 0.0, 0.0), linear=0.0, angular=0.0)


def located(T_map_odom):
    """Perception's message of where odom (pin.SE3) is in map."""
    return Localisation(
        header=HEADER, state="located", T_map_odom=pose_message(T_map_odom), covariance=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    )


def bridge_state(stop_id=""):
    return m.BridgeState(
        header=HEADER, kind="sim", epoch=1, watchdog=False, stop_id=stop_id, stopped_by=None, cutter="open", cut_id="",
        outcome="", real_time_factor=1.0,
    )  # fmt: skip


def controller_state(queue=(), mode="READY"):
    return m.ControllerState(
        header=HEADER, mode=mode, phase="", reason=said("ready"), allowed={"Start": None}, active_point_id="",
        method="nullspace", T_odom_tool=None, T_odom_tool_desired=None, position_error=0.0, rotation_error=0.0,
        manipulability=0.1, joint_margin=0.3, tick_s=1e-4, ticks=100, late_ticks=0, queue=queue,
    )  # fmt: skip


def pruning_point(point_id="p1", revision=3, position=(0.3, 0.85, 1.0)):
    return point(point_id, position, revision=revision, radius=0.005, confidence=0.8, spur=1)


def pruning_points(*points, canes=()):
    return m.PruningPoints(header=HEADER, segmenter="test", frames=1, points=points, canes=canes)


@contextmanager
def telling(wire):
    """The robot says where it is, often, until the event that this yields is set."""
    silent = threading.Event()

    def tell():
        while True:
            wire.deliver(topics.JOINTS, joints())
            wire.deliver(topics.ODOMETRY, odometry())
            if silent.wait(0.02):
                return

    thread = threading.Thread(target=tell)
    thread.start()
    try:
        yield silent
    finally:
        silent.set()
        thread.join()
