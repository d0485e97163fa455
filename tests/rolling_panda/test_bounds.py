"""No configuration that loads is outside the hard bounds of safety, and what is wider than usual is told."""

import json
import math
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config import BridgeConfig
from bridge.sim.build import simulated_bridge
from controller.config import ControllerConfig
from controller.core import Controller
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.bounds import bound_of, numbers, wider
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.errors import ConfigError
from rolling_panda.generate.safety import SECTIONS, section
from rolling_panda.model.robot import ARM_Q, RobotModel
from rolling_panda.resources import resource
from rolling_panda.transport.inbox import Inbox
from server.config import ServerConfig
from tests.support.controller_config import controller_config
from tests.support.sent import every

SIM = resource("assets/config/sim.toml")
KINDS = {name: section(name) for name in SECTIONS}
#: What is promised elsewhere in words, and has to stay a bound whatever happens to the types.
PROMISED = {
    ("bridge", "deadline_s"): 0.2,
    ("bridge", "max_age_s"): 0.2,
    ("real", "base.deadline_s"): 0.2,
    ("real", "arm.deadline_s"): 0.2,
    ("robot", "wheel_velocity"): 11.2,
    ("robot", "wheel_acceleration"): 17.9,
    ("controller", "whole_body.base_speed"): 0.3,
    ("controller", "supervision.supervision_s"): 2.0,
    ("controller", "teleoperation.hold_max_age_s"): 0.15,
    ("controller", "teleoperation.speed"): 0.25,
    ("server", "hold_timeout_s"): 0.15,
    ("server", "view_timeout_s"): 0.5,
}
#: Numbers of these sections that no harm comes of: the simulated plant, its pictures, gains, weights, the log.
HARMLESS = {
    "bridge": "arm_lag_s wheel_lag_s close_s opening blade_half_length blade_half_thickness largest_diameter "
    "camera_moving_hz camera_resting_hz frame_time_offset odometry.delay_s odometry.position_noise "
    "odometry.heading_noise odometry.linear_noise odometry.angular_noise inertial",
    "real": "arm.load_mass arm.load_inertia camera.enabled camera.width camera.height camera.rate_hz",
    "robot": "rho",
    "controller": "work.row_heading work.search_steps work.servo motion.blend motion.base_lag_s motion.arm_lag_s "
    "motion.gain_position motion.gain_rotation whole_body.gain_posture whole_body.gain_heading "
    "whole_body.gain_manipulability whole_body.gain_limits whole_body.damping whole_body.hierarchy.base_heading "
    "whole_body.hierarchy.base_place whole_body.hierarchy.arm_posture whole_body.hierarchy.manipulability "
    "whole_body.hierarchy.joint_centre whole_body.hierarchy.smoothness whole_body.hierarchy.good_manipulability "
    "whole_body.hierarchy.damping whole_body.hierarchy.damping_from whole_body.hierarchy.clock_rise "
    "whole_body.hierarchy.axle_rate",
    "server": "scene_rate_hz log_lines cut_pictures",
}


def leaves(kind: type[msgspec.Struct], prefix: str = "") -> list[tuple[str, Any]]:
    """Name and annotation of every number or switch of a section, with those of inner sections."""
    out: list[tuple[str, Any]] = []
    for name, hint in get_type_hints(kind, include_extras=True).items():
        if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
            out += leaves(hint, f"{prefix}{name}.")
        elif get_origin(hint) is tuple:
            out += [(prefix + name, each) for each in get_args(hint) if each is not Ellipsis]
        else:
            out.append((prefix + name, hint))
    return [(name, hint) for name, hint in out if (get_args(hint) or (hint,))[0] in (int, float, bool)]


LEAVES = [(name, key, hint) for name, kind in KINDS.items() for key, hint in leaves(kind)]


def write(folder: Path, name: str, values: dict[str, Any]) -> Path:
    """A file of one section; keys may be of inner sections."""
    tables: dict[str, list[str]] = {}
    for key, value in values.items():
        inner, _, last = key.rpartition(".")
        tables.setdefault(f"{name}.{inner}" if inner else name, []).append(f"{last} = {toml(value)}")
    path = folder / "robot.toml"
    path.write_text("\n".join(f"[{table}]\n" + "\n".join(lines) + "\n" for table, lines in tables.items()))
    return path


def toml(value: Any) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    return json.dumps(value)


VALUES = st.one_of(
    st.floats(),
    st.integers(-(2**63), 2**63 - 1),
    st.booleans(),
    st.floats(0.0, 2.0),
    st.sampled_from([0.0, -0.0, 1e-12, 0.2, 0.3, 1e6, 50, 60.0]),
)


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_whatever_loads_is_within_the_hard_bounds(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    name = data.draw(st.sampled_from(list(KINDS)))
    scalars = [key for at, key, hint in LEAVES if at == name and not key.endswith(ARRAYS)]
    values = data.draw(st.dictionaries(st.sampled_from(scalars), VALUES, min_size=1, max_size=4))
    path = write(tmp_path_factory.mktemp("drawn"), name, values)
    try:
        config = load_section(path, name, KINDS[name])
    except ConfigError as error:
        assert "\n" not in str(error)
        return
    for each in numbers(config):
        assert each.bound.allows(each.value), each
    promised = {key: high for (at, key), high in PROMISED.items() if at == name}
    for each in numbers(config):
        assert each.value <= promised.get(each.name, math.inf), each


ARRAYS = ("arm_acceleration", "arm_jerk", "start_arm", "home", "reach", "load_center", "load_inertia")


@pytest.mark.parametrize(("name", "key"), list(PROMISED))
@pytest.mark.parametrize("value", [50.0, 60, 1e6, math.nan, math.inf, -1.0, 0.0])
def test_what_is_promised_cannot_be_configured_away(tmp_path: Path, name: str, key: str, value: float) -> None:
    with pytest.raises(ConfigError) as refused:
        load_section(write(tmp_path, name, {key: value}), name, KINDS[name])
    text = str(refused.value)
    assert key.rpartition(".")[2] in text
    assert f" is {value:.10g}; allowed is " in text
    assert f"{PROMISED[name, key]:g}" in text
    assert "Choose such a value, or leave the line out for the usual" in text


@pytest.mark.parametrize("key", ["collisions", "tipping"])
def test_what_keeps_the_robot_from_harm_cannot_be_turned_off(tmp_path: Path, key: str) -> None:
    with pytest.raises(ConfigError, match=rf"\[controller.whole_body.hierarchy\] {key} is false; allowed is true"):
        load_section(
            write(tmp_path, "controller", {f"whole_body.hierarchy.{key}": False}), "controller", ControllerConfig
        )


@pytest.mark.parametrize(
    ("name", "key", "values"),
    [
        ("controller", "work.home", [0.0, 2.0, 0.0, -2.0, 0.0, 1.0, 0.0]),
        ("bridge", "start_arm", [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        ("robot", "arm_jerk", [7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10001.0]),
        ("real", "arm.load_center", [0.0, 0.0, 3.0]),
    ],
)
def test_each_number_of_an_array_has_its_own_bound(tmp_path: Path, name: str, key: str, values: list[float]) -> None:
    with pytest.raises(ConfigError, match=r"\[\d\] is .*; allowed is from"):
        load_section(write(tmp_path, name, {key: values}), name, KINDS[name])


def test_every_number_of_these_sections_is_bounded_or_known_to_do_no_harm() -> None:
    free = {(name, key) for name, key, hint in LEAVES if bound_of(hint) is None}
    assert free == {(name, key) for name, keys in HARMLESS.items() for key in keys.split()}


def test_the_defaults_are_within_their_own_bounds() -> None:
    for kind in KINDS.values():
        for each in numbers(kind()):
            assert each.bound.allows(each.usual), each


def test_postures_are_bounded_by_the_arms_own_limits() -> None:
    limits = RobotModel(RobotConfig()).limits
    for config in (BridgeConfig(), ControllerConfig()):
        posture = [each for each in numbers(config) if each.name.startswith(("work.home", "start_arm"))]
        assert [each.bound.low for each in posture] == limits.lower[ARM_Q].tolist()
        assert [each.bound.high for each in posture] == limits.upper[ARM_Q].tolist()


@pytest.mark.parametrize("file", ["sim", "real", "fakes"])
@pytest.mark.parametrize("name", list(KINDS))
def test_nothing_that_is_shipped_is_wider_than_usual(file: str, name: str) -> None:
    assert wider(name, load_section(resource(f"assets/config/{file}.toml"), name, KINDS[name])) == ()


def test_what_is_stricter_is_taken_without_a_word_and_what_is_wider_is_said(tmp_path: Path) -> None:
    path = write(tmp_path, "bridge", {"deadline_s": 0.1, "joint_margin": 0.1})
    assert wider("bridge", load_section(path, "bridge", BridgeConfig)) == ()
    path = write(tmp_path, "bridge", {"deadline_s": 0.195, "joint_margin": 0.006})
    assert wider("bridge", load_section(path, "bridge", BridgeConfig)) == (
        reasons.limit_raised("[bridge] deadline_s", 0.195, 0.19, 0.2),
        reasons.limit_lowered("[bridge] joint_margin", 0.006, 0.01, 0.005),
    )
    path = write(tmp_path, "controller", {"work.post_cut_check": False})
    assert wider("controller", load_section(path, "controller", ControllerConfig)) == (
        reasons.safeguard_off("[controller] work.post_cut_check"),
    )
    assert wider("server", ServerConfig(invite_s=3600.0)) == (
        reasons.limit_raised("[server] invite_s", 3600.0, 600.0, 3600.0),
    )


def test_the_bridge_and_the_controller_say_what_is_wider_at_the_start_and_in_every_state(tmp_path: Path) -> None:
    path = tmp_path / "wide.toml"
    text = SIM.read_text().replace("deadline_s = 0.19", "deadline_s = 0.195").replace("width = 848", "width = 64")
    path.write_text(text.replace("height = 480", "height = 48"))
    deadline = reasons.limit_raised("[bridge] deadline_s", 0.195, 0.19, 0.2)
    core = simulated_bridge(path, 0)
    try:
        outputs = [core.step(0.001 * n) for n in range(1, 60)]
    finally:
        core.robot.close()
    assert reasons.limits_relaxed(deadline) in [event.reason for each in outputs for event in each.events]
    assert {each.state.relaxed_limits for each in outputs if each.state is not None} == {(deadline,)}

    told = Controller(controller_config(whole_body__arm_velocity_scale=0.9), RobotConfig())
    out = told.step(Inbox(), 1.0)
    scale = reasons.limit_raised("[controller] whole_body.arm_velocity_scale", 0.9, 0.6, 1.0)
    assert reasons.limits_relaxed(scale) in [event.reason for event in every(out, m.LogEvent)]
    assert [state.relaxed_limits for state in every(out, m.ControllerState)] == [(scale,)]
