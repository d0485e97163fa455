"""The bridge as a process on a real router: commands by wire, in real time."""

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from bridge.sim.trace import read
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.config import TransportConfig
from rolling_panda.resources import resource
from rolling_panda.robot_model import RobotModel
from rolling_panda.transport import Feed, Publisher, Router, Slot, Transport

pytestmark = pytest.mark.alone

ROOT = Path(__file__).resolve().parents[1]
REST = (0.0,) * 9
FORWARD = (*RobotModel().drive.wheels(0.2, 0.0), 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass
class Live:
    """A running bridge, and this test in the controller's place."""

    transport: Transport
    trace: Path
    joints: Slot[m.JointState]
    state: Slot[m.BridgeState]
    events: Feed[m.LogEvent]
    motion: Publisher[m.MotionCommand]
    sequence: int = 0

    def drive(self, seconds: float, xi: tuple[float, ...]) -> float:
        """Answer every joint state for a while; returns the clock at the last command."""
        end, sent = time.monotonic() + seconds, time.monotonic()
        while time.monotonic() < end:
            joints = self.joints.take()
            if joints is not None:
                self.sequence += 1
                sent = time.monotonic()
                self.motion.put(
                    m.MotionCommand(epoch=1, sequence=self.sequence, echo=joints.message.sequence, xi=xi)  # type: ignore[arg-type]
                )
            time.sleep(0.002)
        return sent

    def newest(self) -> m.BridgeState:
        received = self.state.peek()
        assert received is not None
        return received.message


def until(condition: Callable[[], bool], limit_s: float = 20.0) -> None:
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    folder = tmp_path_factory.mktemp("bridge")
    config = folder / "sim.toml"
    text = resource("assets/config/sim.toml").read_text().replace("width = 848", "width = 64")
    config.write_text(text.replace("height = 480", "height = 48"))
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    router = Router(TransportConfig(mode="router", connect=(), listen=(endpoint,)))
    trace = folder / "trace"
    command = [sys.executable, "-m", "bridge", "sim", "--connect", endpoint, "--config", str(config)]
    process = subprocess.Popen([*command, "--trace", str(trace)], cwd=ROOT)
    transport = Transport(TransportConfig(connect=(endpoint,)), "controller", "rp1")
    try:
        bridge = Live(
            transport,
            trace,
            transport.slot(topics.JOINTS),
            transport.slot(topics.BRIDGE),
            transport.feed(topics.EVENT, 200),
            transport.publisher(topics.MOTION),
        )
        until(lambda: bridge.joints.peek() is not None and bridge.state.peek() is not None)
        yield bridge
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 0
        transport.close()
        router.close()


def test_it_drives_stops_on_silence_and_the_trace_shows_both(live: Live) -> None:
    live.drive(0.3, REST)
    last = live.drive(1.0, FORWARD)
    until(lambda: live.newest().watchdog)
    time.sleep(0.5)
    trace = read(live.trace)
    moving = trace.rows[(trace.rows["clock"] > last - 0.1) & (trace.rows["clock"] < last)]
    assert np.median(moving["base_velocity"][:, 0]) == pytest.approx(0.2, abs=0.03)
    assert trace.still_after(last) < 0.4


def test_a_stop_by_wire_latches_until_released(live: Live) -> None:
    live.drive(0.3, REST)
    live.drive(0.5, FORWARD)
    stop = live.transport.publisher(topics.STOP)
    at = time.monotonic()
    for _ in range(3):
        stop.put(m.StopRequest(stop_id="s1", source="test", user="ada", reason="button"))
    live.drive(0.6, FORWARD)
    assert live.newest().stop_id == "s1"
    release = m.ReleaseStop(stop_id="s1", user="ada", reason="checked")
    assert live.transport.call(topics.RELEASE, release).ok
    assert not live.transport.call(topics.RELEASE, release).ok
    live.drive(0.3, FORWARD)
    assert live.newest().stop_id == ""
    time.sleep(0.2)
    assert read(live.trace).still_after(at) < 0.5


def test_rubbish_on_the_command_topic_is_counted_and_said(live: Live) -> None:
    before = live.newest().rejections
    live.events.drain()
    texts: list[str] = []

    def noticed() -> bool:
        # Commands may be dropped on a full wire, so rubbish may be as well.
        for data in (b"", b"rubbish", b"\x81\xa4type\xadMotionCommand"):
            live.motion._publisher.put(data)
        texts.extend(received.message.text for received in live.events.drain())
        new = [row for row in live.newest().rejections if row not in before and row.topic == "command/motion"]
        return len(new) >= 3 and any("refused on command/motion" in text for text in texts)

    until(noticed)


def test_it_keeps_real_time(live: Live) -> None:
    assert live.newest().real_time_factor > 0.5
