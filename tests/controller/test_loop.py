"""The control loop over a real router; the test is the bridge and the server."""

import threading
import time

import msgspec
import pytest

from bridge.core.validator import Fence
from controller.config import ControllerConfig
from controller.core import Controller
from controller.ledger.check import reading, verify
from controller.ledger.store import Ledger, read
from controller.ledger.writer import LedgerWriter
from controller.loop import controller_runner, open_stop_file
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.config import RobotConfig, TransportConfig
from rolling_panda.reasons import said
from rolling_panda.topics import (
    BRIDGE,
    CONTROLLER,
    EVENT,
    HEARTBEAT,
    INTENT,
    JOINTS,
    MOTION,
    ODOMETRY,
    RELEASE,
    STOP,
    TOKEN,
    key,
)
from rolling_panda.transport.zenoh import ForeignWire, Transport

pytestmark = pytest.mark.alone

CONFIG = ControllerConfig()


class Rest:
    """The other processes: joint states, odometry, the bridge's latch and the server's heartbeat."""

    def __init__(self, endpoint):
        self.bridge = Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "bridge", "rp1")
        self.server = Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "server", "rp1")
        self.perception = Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "perception", "rp1")
        self.motion = self.bridge.feed(MOTION, 10000)
        self.state = self.server.slot(CONTROLLER)
        self.events = self.server.feed(EVENT, 1000)
        self.stop = self.server.publisher(STOP)
        self.releases = []
        self.bridge.serve(RELEASE, self._release)
        self.stop_id = ""
        self.fence, self.asked = Fence(7), self.bridge.feed(TOKEN, 100)
        self.beats = True
        self._senders = [self.bridge.publisher(topic) for topic in (JOINTS, ODOMETRY, BRIDGE)]
        self._beat = self.server.publisher(HEARTBEAT)
        self._sequence = 0

    def _release(self, request):
        self.releases.append(request)
        self.stop_id = ""
        return m.Answer(ok=True)

    def tick(self):
        self._sequence += 1
        n, header = self._sequence, m.Header(time.monotonic(), "odom")
        joints, odometry, bridge = self._senders
        for request in self.asked.drain():
            self.fence.claim(request.message.token, request.at, True)
        joints.put(m.JointState(header=header, sequence=n, position=(0.0, 0.0, *CONFIG.work.home), velocity=(0.0,) * 9))
        odometry.put(m.Odometry(header=header, sequence=n, pose=m.PlanarPose(), linear=0.0, angular=0.0))
        bridge.put(
            m.BridgeState(
                header=header,
                kind="sim",
                epoch=self.fence.epoch,
                holder=self.fence.holder,
                watchdog=False,
                stop_id=self.stop_id,
                stopped_by=reasons.software_stop("eve", said("dog in the row")) if self.stop_id else None,
                cutter="open",
                cut_id="",
                outcome="",
                real_time_factor=1.0,
            )
        )
        self._beat.put(m.Heartbeat(process="server", sequence=n if self.beats else 1))

    def until(self, condition, limit_s=5.0):
        end = time.monotonic() + limit_s
        while not condition():
            assert time.monotonic() < end, self.state.peek()
            self.tick()
            threading.Event().wait(0.01)

    def rows(self):
        with reading(self.folder) as database:
            return list(read(database))

    def mode(self):
        newest = self.state.peek()
        return None if newest is None else newest.message.mode

    def close(self):
        for transport in (self.bridge, self.server, self.perception):
            transport.close()


@pytest.fixture
def rest(endpoint, tmp_path):
    others = Rest(endpoint)
    others.folder = tmp_path
    stopping = threading.Event()
    with Transport(TransportConfig(connect=(endpoint,), plain_wire=True), "controller", "rp1") as transport:
        ledger = LedgerWriter(lambda: Ledger(tmp_path))
        (tmp_path / "stops").mkdir()
        stop_file = open_stop_file(tmp_path / "stops")
        loop = controller_runner(
            Controller(CONFIG, RobotConfig()), transport, CONFIG.rate_hz, ledger, stop_file=stop_file
        )
        thread = threading.Thread(target=loop.run, args=(stopping,))
        thread.start()
        yield others
        stopping.set()
        thread.join()
        ledger.close()
        stop_file.close()
    others.close()


def test_a_stop_that_cannot_be_kept_for_the_next_start_is_a_fault_until_it_can(rest):
    rest.until(lambda: rest.mode() == "IDLE")
    (rest.folder / "stops").rmdir()
    rest.stop_id = "s1"
    rest.stop.put(m.StopRequest(stop_id="s1", source="server", user="eve", reason=said("dog in the row")))
    rest.until(lambda: rest.mode() == "ESTOP_LATCHED")
    assert rest.server.call(INTENT, intents.Reset(user="ada", role="supervisor", reason="dog gone")).ok
    rest.until(lambda: rest.mode() == "FAULT")
    path = str(rest.folder / "stops" / "controller-stops.json")
    assert rest.state.peek().message.reason == reasons.file_unwritable(path, "No such file or directory")
    (rest.folder / "stops").mkdir()
    acknowledge = intents.Acknowledge(user="ada", role="supervisor")
    rest.until(lambda: rest.server.call(INTENT, acknowledge).ok or rest.mode() == "IDLE")
    rest.until(lambda: rest.mode() == "IDLE")


def test_operator_is_answered_a_stop_latches_and_a_reset_releases_it(rest):
    commands = []

    def many():
        commands.extend(received.message for received in rest.motion.drain())
        return rest.mode() == "IDLE" and len(commands) > 20

    rest.until(many)
    assert {command.epoch for command in commands} == {8}
    numbers = [command.sequence for command in commands]
    assert numbers == sorted(set(numbers))
    assert all(command.xi == (0.0,) * 9 for command in commands)

    refused = rest.server.call(INTENT, intents.Start(user="ada")).reason
    assert refused == reasons.impossible_in_idle("start")
    rest.until(lambda: rest.state.peek().message.allowed["Arm"] is None)
    assert rest.server.call(INTENT, intents.Arm(user="ada")).ok
    rest.until(lambda: rest.mode() == "READY")

    request = m.StopRequest(stop_id="s1", source="server", user="eve", reason=said("dog in the row"))
    rest.stop_id = "s1"
    for _ in range(3):
        rest.stop.put(request)
    rest.until(lambda: rest.mode() == "ESTOP_LATCHED")
    assert rest.state.peek().message.reason == reasons.software_stop("eve", said("dog in the row"))
    rest.motion.drain()
    rest.until(lambda: True)
    assert rest.server.call(INTENT, intents.Reset(user="ada", role="supervisor", reason="dog gone")).ok
    rest.until(lambda: rest.mode() == "IDLE")
    assert [release.stop_id for release in rest.releases] == ["s1"]
    told = [received.message.reason for received in rest.events.drain()]
    assert reasons.command_refused("ada", "start", reasons.impossible_in_idle("start")) in told
    assert reasons.mode_changed("ESTOP_LATCHED", "IDLE", reasons.stop_reset("ada", "dog gone")) in told

    rest.server.publisher(EVENT).put(
        m.LogEvent(header=m.Header(), process="server", reason=reasons.signed_in("ada", "supervisor"))
    )
    rest.until(lambda: any("signed_in" in row.entry.body for row in rest.rows()))
    kinds = {row.entry.kind for row in rest.rows()}
    assert kinds == {"request", "stop", "event"}
    refused = [row for row in rest.rows() if row.entry.kind == "request" and '"reason":{' in row.entry.body]
    assert [row.entry.name for row in refused] == ["ada"] and "impossible_in_idle" in refused[0].entry.body
    assert verify(rest.folder).problem == ""


def test_a_heartbeat_that_stands_still_is_no_sign_of_life(rest):
    rest.until(lambda: rest.mode() == "IDLE" and rest.state.peek().message.allowed["Arm"] is None)
    assert rest.server.call(INTENT, intents.Arm(user="ada")).ok
    rest.until(lambda: rest.mode() == "READY" and rest.state.peek().message.allowed["Home"] is None)
    rest.beats = False
    rest.until(lambda: rest.state.peek().message.allowed["Home"] is not None)
    assert rest.server.call(INTENT, intents.Home(user="ada")).reason.code == "process_silent"


def test_what_is_no_intent_is_refused_and_logged(rest, endpoint):
    rest.until(lambda: rest.mode() == "IDLE")
    bad = msgspec.msgpack.encode({"type": "Arm", "user": "ada", "and": "more"})
    wire = ForeignWire(TransportConfig(connect=(endpoint,), plain_wire=True))
    assert msgspec.msgpack.decode(wire.ask(key("rp1", INTENT.name), bad, 2.0))["ok"] is False
    wire.close()

    def refused(reason):
        return reason.code == "message_rejected" and dict(reason.values)["topic"] == INTENT.name

    rest.until(lambda: any(refused(received.message.reason) for received in rest.events.drain()))
    assert rest.mode() == "IDLE"
