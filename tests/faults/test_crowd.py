"""Pages that look on, some of which never read, and a robot's configuration with a quick camera."""

import subprocess

import pytest
from fake_wire import FakeWire
from running_server import running_server

from benchmarks.faults import loaded
from bridge.config import BridgeConfig
from rolling_panda.config import load_section
from rolling_panda.launch import child_environment, python_command


@pytest.mark.alone
def test_pages_look_on_until_they_are_told_to_end():
    with running_server(FakeWire()) as server, server.client(user="ann") as client:
        words = [server.address, server.cookie(client), "--pages", "6", "--slow", "2"]
        with subprocess.Popen(
            python_command("benchmarks.crowd", words),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=child_environment(),
        ) as crowd:
            assert crowd.stdout.readline() == "open\n"
            assert crowd.communicate(timeout=10)[0] == "4\n"
        assert crowd.returncode == 0


def test_a_loaded_robot_takes_ten_pictures_a_second(tmp_path):
    file = tmp_path / "loaded.toml"
    file.write_text(loaded())
    config = load_section(file, "bridge", BridgeConfig)
    assert config.camera_moving_hz == config.camera_resting_hz == 10.0
