"""Pages that look on, some of which never read, and a robot's configuration with a quick camera."""

import time

import pytest

from benchmarks.faults.run import loaded
from benchmarks.page.crowd import looked_at
from bridge.config import BridgeConfig
from rolling_panda.config import load_section
from rolling_panda.errors import RollingPandaError
from tests.support.fake_wire import FakeWire
from tests.support.running_server import running_server


# Pages are other programs, which take their time to begin.
@pytest.mark.slow
@pytest.mark.alone
def test_pages_look_on_until_they_are_told_to_end(capfd):
    with running_server(FakeWire()) as server, server.client(user="ann") as client:
        cookie = server.cookie(client)
        with looked_at(server.address, cookie, pages=6, slow=2):
            pass
        with (
            pytest.raises(RollingPandaError, match="2 of the pages and views .* ended: 2 x 1008 signed out"),
            looked_at(server.address, cookie, pages=3, slow=1),
        ):
            client.post("/api/sign-out", json={})
            time.sleep(1.0)
        with pytest.raises(RollingPandaError, match="not let in"), looked_at(server.address, "a=b", 1, 0):
            pass
    assert "HTTP 40" in capfd.readouterr().err


def test_a_loaded_robot_takes_ten_pictures_a_second(tmp_path):
    file = tmp_path / "loaded.toml"
    file.write_text(loaded())
    config = load_section(file, "bridge", BridgeConfig)
    assert config.camera_moving_hz == config.camera_resting_hz == 10.0
