"""Configuration: frozen, typed sections of one TOML file, read once at the start of a process and passed inwards.

A section belongs to the package that uses it (`controller.config`, …); the two shared ones, `transport` and `robot`,
are here. An unknown key is an error that names the nearest known one.
"""

import difflib
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import msgspec
from msgspec import Meta, Struct

from rolling_panda.errors import ConfigError

SECTIONS = ("transport", "robot", "bridge", "vineyard", "camera", "controller", "perception", "server", "real")
Positive = Annotated[float, Meta(gt=0.0, le=1e6)]
Section = TypeVar("Section", bound=Struct)


class TransportConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """How a process finds the wire.

    Attributes:
        mode: `client` of a router, the `router` itself, or `peer` with explicit endpoints.
        connect: Endpoints to connect to, as `tcp/HOST:PORT`, or `tls/HOST:PORT` with certificates.
        listen: Endpoints to listen on.
        connect_timeout_s: How long to try before giving up at the start; later losses are retried for ever.
        certificates: Folder with ca.pem and this process's NAME.pem and NAME.key, for mutual TLS; empty for none.
        robots: Ids of the robots that a router with certificates serves.
    """

    mode: Literal["client", "peer", "router"] = "client"
    connect: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    listen: tuple[str, ...] = ()
    connect_timeout_s: Positive = 10.0
    certificates: str = ""
    robots: tuple[str, ...] = ("rp1",)


class RobotConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Numbers of the robot that its URDF does not carry. Sources stand beside the values in `assets/config`.

    Attributes:
        wheel_radius: Effective rolling radius of the wheels (m), as calibrated; 0 takes the URDF's.
        track: Distance between the wheels' contacts (m), as calibrated; 0 takes the URDF's.
        rho: Distance of the base's reference point ahead of the wheel axle (m); 0 puts (x, y) on the axle.
        wheel_velocity: Limit of each wheel (rad/s).
        wheel_acceleration: Limit of each wheel (rad/s²).
        arm_acceleration: Limit of each arm joint (rad/s²).
        arm_jerk: Limit of each arm joint (rad/s³).
    """

    wheel_radius: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.0
    track: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.0
    rho: Annotated[float, Meta(ge=-1.0, le=1.0)] = 0.0
    wheel_velocity: Positive = 11.2
    wheel_acceleration: Positive = 17.9
    arm_acceleration: tuple[Positive, Positive, Positive, Positive, Positive, Positive, Positive] = (
        15.0,
        7.5,
        10.0,
        12.5,
        15.0,
        20.0,
        20.0,
    )
    arm_jerk: tuple[Positive, Positive, Positive, Positive, Positive, Positive, Positive] = (
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
    try:
        return msgspec.convert(table, kind)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{path}: [{name}]: {error}") from error


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
            raise ConfigError(f"{path}: [{name}] has no key {item!r}{_nearest(item, tuple(fields))}")
        inner = fields[item]
        if isinstance(inner, type) and issubclass(inner, Struct):
            _check_keys(path, f"{name}.{item}", value, inner)


def _nearest(got: str, known: tuple[str, ...]) -> str:
    close = difflib.get_close_matches(got, known, n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; known are {', '.join(known)}"
