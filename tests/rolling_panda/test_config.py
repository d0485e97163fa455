"""A mistake in a configuration file is told in one line that says where and what is meant."""

from pathlib import Path
from typing import Annotated

import pytest
from msgspec import Meta, Struct

from rolling_panda.config import RobotConfig, TransportConfig, load_section
from rolling_panda.errors import ConfigError
from rolling_panda.resources import resource


class Gripper(Struct, frozen=True, forbid_unknown_fields=True):
    opening: Annotated[float, Meta(gt=0.0)] = 0.03


class Kind(Struct, frozen=True, forbid_unknown_fields=True):
    rate_hz: float = 100.0
    gripper: Gripper = Gripper()


def load(folder: Path, text: str) -> Kind:
    path = folder / "robot.toml"
    path.write_text(text)
    return load_section(path, "controller", Kind)


def test_what_is_given_is_taken_and_the_rest_has_defaults(tmp_path: Path) -> None:
    got = load(tmp_path, "[controller]\nrate_hz = 50\n[controller.gripper]\nopening = 0.02\n[robot]\nrho = 0.1\n")
    assert got == Kind(rate_hz=50.0, gripper=Gripper(0.02))
    assert load(tmp_path, "") == Kind()


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("[controller]\nrate = 50\n", ["[controller]", "'rate'", "did you mean 'rate_hz'"]),
        ("[controller]\nopening = 50\n", ["'opening'", "it stands in [controller.gripper]"]),
        ("[controller]\nzzz = 50\n", ["'zzz'", "known are rate_hz, gripper"]),
        ("[controler]\nrate_hz = 50\n", ["[controler]", "did you mean 'controller'"]),
        ("[controller.gripper]\nopenning = 1\n", ["[controller.gripper]", "did you mean 'opening'"]),
        ("[controller.gripper]\nopening = -1\n", ["[controller.gripper] opening is -1", "more than 0", "usual 0.03"]),
        ("[controller]\nrate_hz = 'fast'\n", ["rate_hz", "float"]),
        ("[controller]\nrate_hz = true\n", ["rate_hz", "bool"]),
        ("controller = 3\n", ["[controller] must be a section", "int"]),
        ("[controller]\ngripper = 3\n", ["[controller.gripper] must be a section"]),
        ("[controller\n", ["is not TOML"]),
    ],
)
def test_a_mistake_is_named_with_the_nearest_known_word(tmp_path: Path, text: str, parts: list[str]) -> None:
    with pytest.raises(ConfigError) as error:
        load(tmp_path, text)
    for part in ["robot.toml", *parts]:
        assert part in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_a_number_that_is_none_is_refused(tmp_path: Path, value: str) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(f"[robot]\nwheel_velocity = {value}\n")
    with pytest.raises(ConfigError, match="wheel_velocity"):
        load_section(path, "robot", RobotConfig)


def test_a_missing_file_and_a_folder_are_told_apart(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        load_section(tmp_path / "none.toml", "robot", RobotConfig)
    with pytest.raises(ConfigError, match="directory"):
        load_section(tmp_path, "robot", RobotConfig)


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="is not TOML"):
        load_section(path, "robot", RobotConfig)


def test_the_shipped_configuration_is_valid() -> None:
    shipped = resource("assets/config/sim.toml")
    assert load_section(shipped, "transport", TransportConfig).mode == "client"
    assert load_section(shipped, "robot", RobotConfig).wheel_velocity == 11.2
