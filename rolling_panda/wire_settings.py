"""How Zenoh is set: where to connect, nothing found by itself, and mutual TLS where there are certificates."""

from pathlib import Path
from typing import Any

from rolling_panda.config import TransportConfig
from rolling_panda.errors import TransportError
from rolling_panda.wire_access import access_control


def wire_settings(config: TransportConfig, name: str) -> dict[str, Any]:
    """Zenoh's settings, by path; `name` is whose certificate is shown.

    Raises:
        TransportError: A certificate is missing, or an endpoint is not one for TLS.
    """
    settings = {
        "mode": config.mode,
        "connect/endpoints": list(config.connect),
        "listen/endpoints": list(config.listen),
        "connect/timeout_ms": round(config.connect_timeout_s * 1000),
        "connect/exit_on_failure": True,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
    }
    return settings | (_secure(config, name) if config.certificates else {})


def _secure(config: TransportConfig, name: str) -> dict[str, Any]:
    """Mutual TLS with the files of `name`; a router refuses what the table of topics does not let a sender say."""
    folder = Path(config.certificates).resolve()
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
        settings["access_control"] = access_control(config.robots)
    return settings
