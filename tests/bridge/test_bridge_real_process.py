"""`rolling-panda bridge real` as a process, on devices in other processes."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.config import TransportConfig
from rolling_panda.model.robot import RobotModel
from rolling_panda.reasons import text_of
from rolling_panda.resources import resource
from rolling_panda.runtime.launch import child_environment
from rolling_panda.transport.zenoh import Transport
from tests.support.extras import need
from tests.support.real_rig import Devices
from tests.support.waiting import until

need("real")

pytestmark = pytest.mark.paced

ADDRESS = f"127.0.{os.getpid() % 250 + 1}.7"
REST = (0.0,) * 9
FORWARD = (*RobotModel().drive.wheels(0.2, 0.0), 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Site(Devices):
    """Devices, and a configuration that names them."""

    def __init__(self, folder: Path) -> None:
        super().__init__(ADDRESS)
        self.folder = folder
        text = resource("assets/config/real.toml").read_text()
        text = text.replace("tls/127.0.0.1:7447", self.endpoint).replace('address = ""', f'address = "{ADDRESS}"')
        text = text.replace('realtime = "enforce"', 'realtime = "ignore"').replace("width = 848", "enabled = false", 1)
        self.config = folder / "real.toml"
        self.config.write_text(text)

    def command(self, *options: str) -> list[str]:
        files = ["--config", str(self.config), "--state", str(self.folder / "state")]
        return [sys.executable, "-m", "bridge", "real", *files, "--plain-wire", *options]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    site = Site(tmp_path_factory.mktemp("site"))
    yield site
    site.close()


def moved(site: Site) -> float:
    return float(np.abs(site.base.tell()["travel"]).max() + site.arm.tell()["commands"])


def test_the_check_moves_nothing_and_names_what_is_missing(site: Site) -> None:
    before = moved(site)
    done = subprocess.run(
        site.command("--check"), capture_output=True, text=True, timeout=60, env=child_environment(), check=False
    )
    rows = {line[4:].split("  ")[0]: line[:2] for line in done.stdout.splitlines()}
    assert rows["base: wheel speeds"] == rows["base: free to move"] == rows["arm: ready to move"] == "ok"
    assert rows["base: own odometry"] == rows["base: battery"] == "ok"
    assert rows["camera"] == rows["cutter"] == "NO"
    assert done.returncode == 1
    assert "nothing was moved" in done.stderr
    assert moved(site) == before
    assert site.base.tell()["commands"] == 0


@pytest.mark.parametrize("readonly", [True, False])
def test_it_follows_the_wire_or_only_tells_the_robots_state(site: Site, readonly: bool) -> None:
    bridge = subprocess.Popen(site.command(*["--readonly"] * readonly), env=child_environment())
    transport = Transport(TransportConfig(connect=(site.endpoint,), plain_wire=True), "controller", "rp1")
    try:
        joints, state = transport.slot(topics.JOINTS), transport.slot(topics.BRIDGE)
        events, motion = transport.feed(topics.EVENT, 100), transport.publisher(topics.MOTION)
        tokens = transport.publisher(topics.TOKEN)
        until(lambda: joints.peek() is not None and state.peek() is not None)
        first = joints.peek()
        assert first is not None
        np.testing.assert_allclose(first.message.position[2:], site.arm.tell()["q"], atol=1e-6)
        before, sequence = moved(site), 0

        def drives() -> bool:
            wheels, dq = site.base.tell()["wheels"], site.arm.tell()["dq"]
            return np.allclose(wheels, FORWARD[:2], atol=0.1) and np.allclose(dq, FORWARD[2:], atol=0.02)

        for xi, seconds in ((REST, 0.5), (FORWARD, 1.5 if readonly else 5.0)):
            end = time.monotonic() + seconds
            while time.monotonic() < end and not (xi is FORWARD and not readonly and drives()):
                got, told = joints.take(), state.peek()
                if got is not None:
                    sequence += 1
                    echo = got.message.sequence
                    # After a gap, as a busy machine makes them, the bridge wants a command at rest first.
                    wanted = REST if told is not None and told.message.watchdog and not readonly else xi
                    tokens.put(m.TokenRequest(token="a", echo=echo, mode="TELEOP"))
                    motion.put(m.MotionCommand(epoch=1, token="a", sequence=sequence, echo=echo, xi=wanted))  # type: ignore[arg-type]
                time.sleep(0.002)
        newest = state.peek()
        assert newest is not None and newest.message.kind == "real"
        if readonly:
            assert moved(site) == before
            assert newest.message.watchdog
            assert any("--readonly" in text_of(event.message.reason) for event in events.drain())
        else:
            assert drives(), (site.base.tell(), site.arm.tell())
            assert site.breaches() == []
    finally:
        bridge.send_signal(signal.SIGINT)
        code = bridge.wait(10)
        transport.close()
    assert code == 0
    assert np.abs(site.arm.tell()["dq"]).max() == 0.0
