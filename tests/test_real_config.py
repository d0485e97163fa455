"""The real robot's configuration says what every process of it reads."""

import msgspec
import pytest

from bridge.__main__ import with_usual_config
from bridge.config import BridgeConfig
from bridge.real.build import open_devices
from bridge.real.config import RealConfig
from controller.config import ControllerConfig
from perception.config import PerceptionConfig
from rolling_panda.config import RobotConfig, TransportConfig, load_section
from rolling_panda.errors import InputError
from rolling_panda.resources import resource
from rolling_panda.robot_model import RobotModel
from server.config import ServerConfig

REAL, SIM = resource("assets/config/real.toml"), resource("assets/config/sim.toml")
SECTIONS: list[tuple[str, type[msgspec.Struct]]] = [
    ("transport", TransportConfig),
    ("robot", RobotConfig),
    ("controller", ControllerConfig),
    ("server", ServerConfig),
]


@pytest.mark.parametrize(("name", "kind"), SECTIONS)
def test_what_no_device_changes_is_as_in_the_simulation(name: str, kind: type[msgspec.Struct]) -> None:
    assert load_section(REAL, name, kind) == load_section(SIM, name, kind)


def test_the_bridge_keeps_the_same_deadlines_and_the_devices_are_no_slower() -> None:
    real, sim = load_section(REAL, "bridge", BridgeConfig), load_section(SIM, "bridge", BridgeConfig)
    devices = load_section(REAL, "real", RealConfig)
    assert (real.max_age_s, real.fade_s, real.deadline_s) == (sim.max_age_s, sim.fade_s, sim.deadline_s)
    assert devices.base.deadline_s <= 0.2
    assert devices.arm.deadline_s <= 0.2
    assert devices.arm.realtime == "enforce"


def test_perception_does_not_wait_for_labels_that_no_camera_has() -> None:
    assert load_section(REAL, "perception", PerceptionConfig).segmenter == "network"


def test_the_real_robot_has_its_own_configuration_unless_another_is_given() -> None:
    assert with_usual_config(["real", "--check"]) == ["real", "--check", "--config", str(REAL)]
    assert with_usual_config(["real", "--config", "mine.toml"]) == ["real", "--config", "mine.toml"]
    assert with_usual_config(["real", "--config=mine.toml"]) == ["real", "--config=mine.toml"]
    assert with_usual_config(["sim"]) == ["sim"]


def test_without_the_drivers_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bridge.real.build.importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"panda_py, pyrealsense2, rosbags.*pip install 'rolling-panda\[real\]'"):
        open_devices(REAL, RobotModel(), moving=False)


def test_without_an_address_of_the_arm_it_says_which_key_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bridge.real.build.importlib.util.find_spec", lambda name: True)
    with pytest.raises(InputError, match=r"\[real.arm\] address"):
        open_devices(REAL, RobotModel(), moving=False)
