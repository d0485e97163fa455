"""The faulty router carries what a router carries, until it is told not to."""

import time

import pytest

from benchmarks.faults.faulty_router import FaultyRouter, obey
from benchmarks.faults.lossy_link import WayFault
from rolling_panda import messages as m
from rolling_panda.config import TransportConfig
from rolling_panda.errors import ServiceError
from rolling_panda.reasons import said
from rolling_panda.topics import CONTROLLER, MOTION, RELEASE, STOP
from rolling_panda.transport.zenoh import Transport
from tests.support.processes.local_router import free_port
from tests.support.running_server import eventually

pytestmark = pytest.mark.paced
COMMAND = m.MotionCommand(epoch=1, token="a", sequence=1, echo=1, xi=(0.0,) * 9)
ASKED = m.ReleaseStop(stop_id="s", user="ada", reason="trial")


@pytest.fixture(scope="module")
def wire():
    """The router, and bridge and controller at their doors."""
    doors = {name: f"tcp/127.0.0.1:{free_port()}" for name in ("bridge", "controller", "server")}
    router = FaultyRouter(doors, "rp1", seed=1)
    sessions = {
        name: Transport(TransportConfig(connect=(doors[name],), plain_wire=True), name, "rp1") for name in doors
    }
    yield router, sessions
    for session in sessions.values():
        session.close()
    router.close()


def test_messages_requests_and_presence_pass_and_nobody_hears_themselves(wire):
    router, s = wire
    bridge, own = s["bridge"].feed(MOTION, 100), s["controller"].feed(MOTION, 100)
    publisher = s["controller"].publisher(MOTION)
    s["bridge"].serve(RELEASE, lambda request: m.Answer(ok=False, reason=said(request.reason)))
    time.sleep(0.3)
    publisher.put(COMMAND)
    assert eventually(bridge.drain)
    time.sleep(0.1)
    # Zenoh itself hands a session what it publishes, once; the router sends nothing back.
    assert len(own.drain()) == 1
    assert s["controller"].call(RELEASE, ASKED).reason == said("trial")
    assert eventually(lambda: s["server"].present() == {"bridge", "controller", "server"})


def test_a_way_is_cut_for_one_topic_and_one_direction(wire):
    router, s = wire
    bridge, server = s["bridge"].feed(MOTION, 100), s["server"].feed(MOTION, 100)
    stops = s["bridge"].feed(STOP, 10)
    publisher, stop = s["controller"].publisher(MOTION), s["controller"].publisher(STOP)
    time.sleep(0.3)
    cut = '{"from": "controller", "to": "bridge", "topic": "command/motion", "fault": {"loss": 1.0}}'
    assert obey(router, cut) == "set"
    stop.put(m.StopRequest(stop_id="s", source="server", user="ada", reason=said("trial")))
    heard = []

    sent = 0

    def another_is_heard():
        nonlocal sent
        sent += 1
        # At the controller's pace, until enough came: of a burst the wire drops what it has no room for.
        publisher.put(COMMAND)
        heard.extend(server.drain())
        return len(heard) >= 20

    assert eventually(another_is_heard), len(heard)
    assert eventually(stops.drain) and len(heard) <= sent, "none comes twice"
    assert not bridge.drain()
    obey(router, '{"clear": true}')
    publisher.put(COMMAND)
    assert eventually(bridge.drain)


def test_a_request_that_is_lost_is_not_answered(wire):
    router, s = wire
    router.set("controller", "bridge", RELEASE.name, WayFault(loss=1.0))
    with pytest.raises(ServiceError, match="did not answer"):
        s["controller"].call(RELEASE, ASKED)
    router.clear()


def test_whoever_leaves_is_seen_to_leave(wire):
    router, s = wire
    assert eventually(lambda: "bridge" in s["server"].present())
    s["bridge"].close()
    assert eventually(lambda: "bridge" not in s["server"].present())
    assert not s["server"].slot(CONTROLLER).peek()
