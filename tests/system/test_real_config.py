"""The real robot's configuration says what every process of it reads."""

from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from bridge.__main__ import with_usual_config
from bridge.config import BridgeConfig
from bridge.real.build import open_devices
from bridge.real.config import RealConfig
from bridge.sim.camera.config import CameraConfig
from bridge.sim.vineyard.config import VineyardConfig
from controller.config import ControllerConfig
from perception.config import PerceptionConfig
from rolling_panda.config import RobotConfig, TransportConfig, load_section
from rolling_panda.errors import InputError
from rolling_panda.model.robot import RobotModel
from rolling_panda.resources import resource
from server.config import ServerConfig

REAL, SIM = resource("assets/config/real.toml"), resource("assets/config/sim.toml")
FAKES = resource("assets/config/fakes.toml")
SECTIONS: list[tuple[str, type[msgspec.Struct]]] = [
    ("transport", TransportConfig),
    ("robot", RobotConfig),
    ("controller", ControllerConfig),
    ("server", ServerConfig),
]


@pytest.mark.parametrize(("name", "kind"), SECTIONS)
def test_what_no_device_changes_is_as_in_the_simulation(name: str, kind: type[msgspec.Struct]) -> None:
    real, sim = load_section(REAL, name, kind), load_section(SIM, name, kind)
    if isinstance(real, ControllerConfig):
        # A robot that is new begins slower, in the canes and along the row.
        assert real.motion.cut_speed < sim.motion.cut_speed and real.work.survey_speed < sim.work.survey_speed
        sim = replace(
            sim,
            motion=replace(sim.motion, cut_speed=real.motion.cut_speed),
            work=replace(sim.work, survey_speed=real.work.survey_speed),
        )
    assert real == sim


def test_the_bridge_keeps_the_same_deadlines_and_the_devices_are_no_slower() -> None:
    real, sim = load_section(REAL, "bridge", BridgeConfig), load_section(SIM, "bridge", BridgeConfig)
    devices = load_section(REAL, "real", RealConfig)
    assert (real.max_age_s, real.fade_s, real.deadline_s) == (sim.max_age_s, sim.fade_s, sim.deadline_s)
    assert devices.base.deadline_s <= 0.2
    assert devices.arm.deadline_s <= 0.2
    assert devices.arm.realtime == "enforce"


@pytest.mark.parametrize("path", [REAL, SIM])
def test_perception_does_not_wait_for_labels_that_no_real_camera_has(path: Path) -> None:
    assert load_section(path, "perception", PerceptionConfig).segmenter == "network"
    assert PerceptionConfig().segmenter == "network"


def test_the_real_robot_has_its_own_configuration_unless_another_is_given() -> None:
    assert with_usual_config(["real", "--check"]) == ["real", "--check", "--config", str(REAL)]
    assert with_usual_config(["real", "--config", "mine.toml"]) == ["real", "--config", "mine.toml"]
    assert with_usual_config(["real", "--config=mine.toml"]) == ["real", "--config=mine.toml"]
    assert with_usual_config(["sim"]) == ["sim"]
    assert with_usual_config(["real", "--fakes"])[-1] == str(FAKES)


def test_without_the_drivers_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bridge.real.build.importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"panda_py, pyrealsense2, rosbags.*pip install 'rolling-panda\[real\]'"):
        open_devices(REAL, TransportConfig(plain_wire=True), RobotModel(), moving=False)


def test_without_an_address_of_the_arm_it_says_which_key_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bridge.real.build.importlib.util.find_spec", lambda name: True)
    with pytest.raises(InputError, match=r"\[real.arm\] address"):
        open_devices(REAL, TransportConfig(plain_wire=True), RobotModel(), moving=False)


@pytest.mark.parametrize(("name", "kind"), [*SECTIONS, ("vineyard", VineyardConfig), ("camera", CameraConfig)])
def test_the_fakes_are_told_what_the_simulation_is(name: str, kind: type[msgspec.Struct]) -> None:
    assert load_section(FAKES, name, kind) == load_section(SIM, name, kind)


def test_the_fakes_differ_from_the_real_devices_in_where_they_are_and_how_often_they_look() -> None:
    fakes, real = load_section(FAKES, "real", RealConfig), load_section(REAL, "real", RealConfig)
    assert fakes.base == real.base
    same = msgspec.structs.replace(fakes.arm, address=real.arm.address, realtime=real.arm.realtime)
    assert same == real.arm
    assert msgspec.structs.replace(fakes.cutter, service="") == real.cutter
    assert msgspec.structs.replace(fakes.camera, rate_hz=30) == real.camera


def test_fakes_at_an_address_where_a_real_arm_may_be_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bridge.real.build.importlib.util.find_spec", lambda name: True)
    config = tmp_path / "mixed.toml"
    config.write_text('[real.arm]\naddress = "172.16.0.2"\n')
    with pytest.raises(InputError, match="172.16.0.2 may be a real arm"):
        open_devices(config, TransportConfig(plain_wire=True), RobotModel(), moving=True, fakes=True)
