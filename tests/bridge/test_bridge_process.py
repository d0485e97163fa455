"""The bridge as a process on a real router: commands by wire, in real time."""

import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.sim.robot.trace import read
from rolling_panda import messages as m
from rolling_panda import reasons, topics
from rolling_panda.calibration.file import save_robot
from rolling_panda.config import TransportConfig
from rolling_panda.model.robot import RobotModel
from rolling_panda.reasons import said, text_of
from rolling_panda.resources import resource
from rolling_panda.transport.zenoh import Feed, ForeignWire, Publisher, Slot, Transport
from tests.support.processes.local_router import local_router
from tests.support.waiting import until

pytestmark = pytest.mark.alone  # How long the bridge goes on without commands is real time.

ROOT = Path(__file__).resolve().parents[2]
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
    tokens: Publisher[m.TokenRequest]
    send: Callable[[bytes], None]
    sequence: int = 0

    def drive(self, seconds: float, xi: tuple[float, ...]) -> float:
        """Answer every joint state for a while; returns the clock at the last command."""
        end, sent = time.monotonic() + seconds, time.monotonic()
        while time.monotonic() < end:
            joints = self.joints.take()
            if joints is not None:
                self.sequence += 1
                sent = time.monotonic()
                epoch, echo = self.newest().epoch, joints.message.sequence
                self.tokens.put(m.TokenRequest(token="a", echo=echo, mode="TELEOP"))
                self.motion.put(
                    m.MotionCommand(epoch=epoch, token="a", sequence=self.sequence, echo=echo, xi=xi)  # type: ignore[arg-type]
                )
            time.sleep(0.002)
        return sent

    def drive_on(self, seconds: float, xi: tuple[float, ...]) -> float:
        """From rest, drive for a while; returns the clock at the last command.

        A busy machine may leave the bridge without a command for longer than its deadline. Then it wants one at rest
        first.
        """
        self.drive(0.3, REST)
        for _ in range(20):
            last = self.drive(seconds, xi)
            if not self.newest().watchdog:
                return last
            until(lambda: self.drive(0.1, REST) > 0.0 and not self.newest().watchdog)
        raise AssertionError("the bridge never had a command in time")

    def newest(self) -> m.BridgeState:
        received = self.state.peek()
        assert received is not None
        return received.message


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with running_bridge(tmp_path_factory.mktemp("bridge")) as bridge:
        yield bridge


def configured(folder: Path, **changes: float) -> Path:
    """The simulation's configuration with a small picture and other numbers of the bridge."""
    text = resource("assets/config/sim.toml").read_text().replace("width = 848", "width = 64")
    for key, value in changes.items():
        text, found = re.subn(rf"^{key} = .*$", f"{key} = {value}", text, count=1, flags=re.MULTILINE)
        assert found
    config = folder / "sim.toml"
    config.write_text(text.replace("height = 480", "height = 48"))
    return config


def started(folder: Path, endpoint: str, config: Path, *words: str, **how: Any) -> subprocess.Popen[str]:
    """A bridge as a process of its own."""
    command = [sys.executable, "-m", "bridge", "sim", "--connect", endpoint, "--plain-wire", "--config", str(config)]
    kept = ["--state", str(folder / "state")]
    return subprocess.Popen([*command, *kept, *words], cwd=ROOT, text=True, **how)


@contextmanager
def running_bridge(folder: Path, **changes: float) -> Iterator[Live]:
    """A bridge that has told its first state."""
    with local_router() as endpoint:
        yield from _running(folder, endpoint, configured(folder, **changes))


def _running(folder: Path, endpoint: str, config: Path) -> Iterator[Live]:
    trace = folder / "trace"
    process = started(folder, endpoint, config, "--trace", str(trace))
    settings = TransportConfig(connect=(endpoint,), plain_wire=True)
    transport, raw = Transport(settings, "controller", "rp1"), ForeignWire(settings)
    try:
        bridge = Live(
            transport,
            trace,
            transport.slot(topics.JOINTS),
            transport.slot(topics.BRIDGE),
            transport.feed(topics.EVENT, 200),
            transport.publisher(topics.MOTION),
            transport.publisher(topics.TOKEN),
            raw.publisher(topics.key("rp1", topics.MOTION.name)),
        )
        until(lambda: bridge.joints.peek() is not None and bridge.state.peek() is not None)
        yield bridge
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 0
        raw.close()
        transport.close()


def test_it_drives_stops_on_silence_and_the_trace_shows_both(live: Live) -> None:
    last = live.drive_on(1.0, FORWARD)
    until(lambda: live.newest().watchdog)
    time.sleep(0.5)
    trace = read(live.trace)
    moving = trace.rows[(trace.rows["clock"] > last - 0.1) & (trace.rows["clock"] < last)]
    assert np.median(moving["base_velocity"][:, 0]) == pytest.approx(0.2, abs=0.03)
    assert trace.stopping_time(last) < 0.4


def test_the_widest_deadline_that_can_be_set_still_stops_it_within_its_bound(tmp_path: Path) -> None:
    """The largest speed, deadline and fading that any configuration may have, from the last command that was sent."""
    fastest = (*RobotModel().drive.wheels(0.3, 0.0), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    with running_bridge(tmp_path, deadline_s=0.2, fade_s=0.1, wheel_acceleration=12.5) as bridge:
        relaxed = [dict(each.values) for each in bridge.newest().relaxed_limits]
        assert [(values["key"], values["value"]) for values in relaxed] == [
            ("[bridge] fade_s", 0.1),
            ("[bridge] deadline_s", 0.2),
        ]
        last = bridge.drive_on(1.0, fastest)
        until(lambda: read(bridge.trace).rows["clock"][-1] > last + 0.5)
    rows = read(tmp_path / "trace").rows
    assert np.abs(rows["setpoint"][:, :2]).max() == pytest.approx(fastest[0], rel=0.01)
    assert not rows[rows["clock"] > last + 0.25]["setpoint"].any(), "0.2 s, and 50 ms for a machine with other work"


def test_an_old_calibration_that_is_read_at_the_start_is_told(tmp_path: Path) -> None:
    (folder := tmp_path / "state").mkdir()
    made_at = time.time() - 100.5 * 86400.0
    save_robot(folder, "rp1", m.BaseCalibration(left=0.133, right=0.133, track=0.51, made_at=made_at))
    save_robot(folder, "rp1", m.ArmCalibration(offsets=m.NO_OFFSETS, made_at=time.time()))
    old = reasons.base_calibration_old(100.0)
    with running_bridge(tmp_path) as bridge:
        until(lambda: bridge.newest().calibration_warnings == (old,))


@pytest.mark.parametrize(
    ("key", "value", "allowed"), [("deadline_s", 60, "at most 0.2"), ("max_age_s", 5, "at most 0.2")]
)
def test_a_bridge_whose_deadline_is_out_of_bounds_does_not_start(
    tmp_path: Path, key: str, value: float, allowed: str
) -> None:
    with local_router() as endpoint:
        process = started(tmp_path, endpoint, configured(tmp_path, **{key: value}), stderr=subprocess.PIPE)
        try:
            _, said = process.communicate(timeout=60)
        finally:
            process.kill()
            process.wait()
    assert process.returncode == 1
    assert f"[bridge] {key} is {value}; allowed is more than 0, at most 0.2" in said and "Traceback" not in said


def test_a_stop_by_wire_latches_until_released(live: Live) -> None:
    live.drive_on(0.5, FORWARD)
    stop = live.transport.publisher(topics.STOP)
    at = time.monotonic()
    for _ in range(3):
        stop.put(m.StopRequest(stop_id="s1", source="test", user="ada", reason=said("button")))
    live.drive(0.6, FORWARD)
    assert live.newest().stop_id == "s1"
    release = m.ReleaseStop(stop_id="s1", user="ada", reason="checked")
    assert live.transport.call(topics.RELEASE, release).ok
    assert not live.transport.call(topics.RELEASE, release).ok
    live.drive(0.3, FORWARD)
    assert live.newest().stop_id == ""
    time.sleep(0.2)
    assert read(live.trace).stopping_time(at) < 0.5


def test_rubbish_on_the_command_topic_is_counted_and_said(live: Live) -> None:
    before = live.newest().rejections
    live.events.drain()
    texts: list[str] = []

    def noticed() -> bool:
        # Commands may be dropped on a full wire, so rubbish may be as well.
        for data in (b"", b"rubbish", b"\x81\xa4type\xadMotionCommand"):
            live.send(data)
        texts.extend(text_of(received.message.reason) for received in live.events.drain())
        new = [row for row in live.newest().rejections if row not in before and row.topic == "command/motion"]
        return len(new) >= 3 and any("Refused on command/motion" in text for text in texts)

    until(noticed)


def test_it_keeps_real_time(live: Live) -> None:
    assert live.newest().real_time_factor > 0.5
