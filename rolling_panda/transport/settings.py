"""Zenoh's configuration: explicit endpoints, no scouting, and mutual TLS or a plain wire on the loopback address."""

import argparse
import ipaddress
import re
from pathlib import Path
from typing import Any

from rolling_panda.config import TransportConfig
from rolling_panda.errors import TransportError
from rolling_panda.transport.access import access_control

#: Default endpoint of the router.
DEFAULT_ENDPOINT = "tls/127.0.0.1:7447"
PLAIN_ENDPOINT = "tcp/127.0.0.1:7447"
#: Shown wherever a plain wire is used.
PLAIN_WARNING = (
    "The wire is plain: every program on this machine can move the robot. Leave out --plain-wire to close it."
)


def add_wire_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the wire's protection."""
    parser.add_argument(
        "--certificates",
        type=Path,
        metavar="DIR",
        help="mutual TLS with the files from there; see `rolling-panda certificates --help`",
    )
    parser.add_argument(
        "--plain-wire",
        action="store_true",
        help="without certificates, on the loopback address alone: every program on this machine can move the robot",
    )


def wire_settings(config: TransportConfig, name: str, robot_id: str = "", foreign: bool = False) -> dict[str, Any]:
    """Zenoh's settings, by path.

    Args:
        config: Endpoints and certificates.
        name: Of the certificate to present.
        robot_id: Of the robot; certificates in a folder of that name take precedence.
        foreign: The wire of the devices behind the drivers, which may be plain anywhere; it has no keys of a robot.

    Raises:
        TransportError: No certificates are given without `plain_wire`, a file is missing, or an endpoint is invalid.
    """
    settings = {
        "mode": config.mode,
        "connect/endpoints": list(config.connect),
        "listen/endpoints": list(config.listen),
        "connect/timeout_ms": round(config.connect_timeout_s * 1000),
        "connect/exit_on_failure": True,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        # Otherwise every process, and the router, keeps a segment of it for large messages; sockets are fast enough.
        "transport/shared_memory/enabled": False,
    }
    if config.certificates:
        return settings | _secure(config, name, robot_id)
    if not foreign:
        _check_plain(config)
    return settings


def _check_plain(config: TransportConfig) -> None:
    """Refuse a plain wire without `plain_wire`, or beyond the loopback address."""
    if not config.plain_wire:
        raise TransportError(
            "no certificates for the robot's wire: give --certificates DIR, the folder that the demo prints or that "
            "`rolling-panda certificates --out DIR` makes; or --plain-wire for a wire on this machine that every "
            "program here can use to move the robot"
        )
    for endpoint in (*config.connect, *config.listen):
        if not _on_loopback(endpoint):
            raise TransportError(
                f"got {endpoint}; a plain wire is tcp/HOST:PORT on the loopback address, as {PLAIN_ENDPOINT}. "
                "For another machine give --certificates DIR in place of --plain-wire"
            )


def _on_loopback(endpoint: str) -> bool:
    found = re.fullmatch(r"tcp/(?:\[([0-9a-fA-F:.]+)\]|([^\[\]:/#?]+)):[0-9]+", endpoint)
    if found is None:
        return False
    host = found[1] or found[2]
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def certificate_folder(config: TransportConfig, robot_id: str = "") -> Path:
    """The folder of a robot's certificates: the one of its name, where it exists."""
    folder = Path(config.certificates).resolve()
    own = folder / robot_id
    return own if robot_id and own.is_dir() else folder


def _secure(config: TransportConfig, name: str, robot_id: str) -> dict[str, Any]:
    """Mutual TLS with the files of `name`; a router also gets its access control."""
    if config.plain_wire:
        raise TransportError("--plain-wire and --certificates were given: give one of the two")
    folder = certificate_folder(config, robot_id)
    authority, certificate, private = (folder / file for file in ("ca.pem", f"{name}.pem", f"{name}.key"))
    for file in (authority, certificate, private):
        if not file.is_file():
            raise TransportError(
                f"there is no certificate file {file}; make a folder with `rolling-panda certificates --out DIR`"
            )
    plain = [endpoint for endpoint in (*config.connect, *config.listen) if not endpoint.startswith("tls/")]
    if plain:
        raise TransportError(f"with certificates every endpoint is tls/HOST:PORT; got {', '.join(plain)}")
    side = "listen" if config.mode == "router" else "connect"
    settings: dict[str, Any] = {
        "transport/link/tls/root_ca_certificate": str(authority),
        "transport/link/tls/enable_mtls": True,
        "transport/link/tls/verify_name_on_connect": True,
        f"transport/link/tls/{side}_certificate": str(certificate),
        f"transport/link/tls/{side}_private_key": str(private),
    }
    if config.mode == "router":
        settings["access_control"] = access_control(config.robots, config.field)
    return settings
