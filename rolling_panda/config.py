"""Configuration: frozen, typed sections of one TOML file, read once at the start of a process and passed inwards.

A section belongs to the package that uses it (`controller.config`, …); the two shared ones, `transport` and `robot`,
are here. An unknown key is an error that names the nearest known one.
"""

import difflib
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import msgspec
from msgspec import Meta, Struct

from rolling_panda.bounds import at_most, check, within
from rolling_panda.errors import ConfigError

SECTIONS = ("transport", "robot", "bridge", "vineyard", "camera", "world", "controller", "perception", "server", "real")
Positive = Annotated[float, Meta(gt=0.0, le=1e6)]
Section = TypeVar("Section", bound=Struct)

# Limits of the arm's joints by its data sheet (rad).
_Q1 = Annotated[float, within(-2.8973, 2.8973)]
_Q2 = Annotated[float, within(-1.7628, 1.7628)]
_Q4 = Annotated[float, within(-3.0718, -0.0698)]
_Q6 = Annotated[float, within(-0.0175, 3.7525)]
#: A posture that the arm can take.
ArmPosture = tuple[_Q1, _Q2, _Q1, _Q4, _Q1, _Q6, _Q1]
# What the arm's joints can do, by its data sheet (rad/s², rad/s³). Less than half could not stop it in time.
_A15 = Annotated[float, at_most(15.0, 7.5)]
_A7 = Annotated[float, at_most(7.5, 3.75)]
_A10 = Annotated[float, at_most(10.0, 5.0)]
_A12 = Annotated[float, at_most(12.5, 6.25)]
_A20 = Annotated[float, at_most(20.0, 10.0)]
_J7500 = Annotated[float, at_most(7500.0, 3750.0)]
_J3750 = Annotated[float, at_most(3750.0, 1875.0)]
_J5000 = Annotated[float, at_most(5000.0, 2500.0)]
_J6250 = Annotated[float, at_most(6250.0, 3125.0)]
_J10000 = Annotated[float, at_most(10000.0, 5000.0)]


class TransportConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Connection of a process to the wire.

    Attributes:
        mode: `client` of a router, the `router` itself, or `peer` with explicit endpoints.
        connect: Endpoints to connect to, as `tls/HOST:PORT`, or `tcp/HOST:PORT` on a plain wire.
        listen: Endpoints to listen on.
        connect_timeout_s: Time limit of the connection at the start. Later losses are retried for ever.
        certificates: Folder with ca.pem and this process's NAME.pem and NAME.key, for mutual TLS. Files in its
            subfolder with the robot's id take precedence.
        robots: Ids of the robots that a router with certificates serves.
        field: Keys of the devices behind the drivers. A router with certificates routes them between the bridge and the
            holder of the devices' certificate; empty for none.
        plain_wire: No certificates and no access control, on the loopback address only.
    """

    mode: Literal["client", "peer", "router"] = "client"
    connect: tuple[str, ...] = ("tls/127.0.0.1:7447",)
    listen: tuple[str, ...] = ()
    connect_timeout_s: Positive = 10.0
    certificates: str = ""
    robots: tuple[str, ...] = ("rp1",)
    field: tuple[str, ...] = ()
    plain_wire: bool = False


class RobotConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the robot that are not in its URDF. `assets/config` has their sources.

    Attributes:
        wheel_radius: Effective rolling radius of the wheels (m), as calibrated; 0 takes the URDF's.
        track: Distance between the wheels' contacts (m), as calibrated; 0 takes the URDF's.
        rho: Distance of the base's reference point ahead of the wheel axle (m); 0 puts (x, y) on the axle.
        wheel_velocity: Limit of each wheel (rad/s).
        wheel_acceleration: Limit of each wheel (rad/s²).
        arm_acceleration: Limit of each arm joint (rad/s²).
        arm_jerk: Limit of each arm joint (rad/s³).
    """

    # 5 % about the vendor's: a wrong radius makes every speed on the ground wrong by as much.
    wheel_radius: Annotated[float, within(0.127, 0.141, or_zero=True)] = 0.0
    track: Annotated[float, within(0.48, 0.535, or_zero=True)] = 0.0
    rho: Annotated[float, Meta(ge=-1.0, le=1.0)] = 0.0
    wheel_velocity: Annotated[float, at_most(11.2)] = 11.2
    # Less than the lower bound could not bring the base to rest from 0.3 m/s before the watchdog's deadline.
    wheel_acceleration: Annotated[float, at_most(17.9, 12.5)] = 17.9
    arm_acceleration: tuple[_A15, _A7, _A10, _A12, _A15, _A20, _A20] = (
        15.0,
        7.5,
        10.0,
        12.5,
        15.0,
        20.0,
        20.0,
    )
    arm_jerk: tuple[_J7500, _J3750, _J5000, _J6250, _J7500, _J10000, _J10000] = (
        7500.0,
        3750.0,
        5000.0,
        6250.0,
        7500.0,
        10000.0,
        10000.0,
    )


def load_section(path: Path, name: str, kind: type[Section]) -> Section:
    """One section of a configuration file; absent keys take their defaults.

    Args:
        path: TOML file.
        name: Section, one of `SECTIONS`.
        kind: Frozen struct that says which keys there are, their types, units and bounds.

    Raises:
        ConfigError: No such file, not TOML, an unknown section or key, or a value out of bounds.
    """
    document = _read(path)
    for section in document:
        if section not in SECTIONS:
            raise ConfigError(f"{path}: unknown section [{section}]{_nearest(section, SECTIONS)}")
    table = document.get(name, {})
    _check_keys(path, name, table, kind)
    check(str(path), name, table, kind)
    try:
        return msgspec.convert(table, kind)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{path}: [{name}]: {error}") from error


def load_preset(path: Path, name: str, presets: Mapping[str, Section]) -> Section:
    """One section of a configuration file whose key `preset` names the values of all keys that are not given.

    Args:
        path: TOML file.
        name: Section, one of `SECTIONS`.
        presets: By name; at least one.

    Raises:
        ConfigError: As of `load_section`.
    """
    given = msgspec.structs.asdict(load_section(path, name, type(next(iter(presets.values())))))
    return msgspec.structs.replace(presets[given["preset"]], **{key: given[key] for key in _read(path).get(name, {})})


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"cannot read the configuration {path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} is not TOML: {error}") from error


def _check_keys(path: Path, name: str, table: Any, kind: Any) -> None:
    if not isinstance(table, dict):
        raise ConfigError(f"{path}: [{name}] must be a section, got {type(table).__name__}")
    fields = {field.encode_name: field.type for field in msgspec.structs.fields(kind)}
    for item, value in table.items():
        if item not in fields:
            raise ConfigError(
                f"{path}: [{name}] has no key {item!r}{_elsewhere(name, item, kind) or _nearest(item, tuple(fields))}"
            )
        inner = fields[item]
        if isinstance(inner, type) and issubclass(inner, Struct):
            _check_keys(path, f"{name}.{item}", value, inner)


def _elsewhere(name: str, item: str, kind: type[Struct]) -> str:
    """The subsection that has such a key; empty without one."""
    for field in msgspec.structs.fields(kind):
        inner = field.type
        if isinstance(inner, type) and issubclass(inner, Struct):
            if item in {each.encode_name for each in msgspec.structs.fields(inner)}:
                return f"; it stands in [{name}.{field.encode_name}]"
    return ""


def _nearest(got: str, known: tuple[str, ...]) -> str:
    close = difflib.get_close_matches(got, known, n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; known are {', '.join(known)}"
