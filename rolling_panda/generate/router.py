"""The configuration of a stand-alone Zenoh router: mutual TLS, and access control from the topic table."""

import json

from rolling_panda.transport.access import access_control

_HEAD = """\
// Configuration of a Zenoh router (zenohd 1.x) for the robot's wire: mutual TLS, and everything refused that the table
// of topics does not let a sender say. `rolling-panda router --certificates DIR` does the same without this file.
// Made by `python -m rolling_panda.generate --write`; put the certificates where the paths say, or change the paths.
"""


def router_config() -> str:
    """Text of the file."""
    folder = "/etc/rolling-panda/certificates"
    tls = {
        "root_ca_certificate": f"{folder}/ca.pem",
        "listen_certificate": f"{folder}/router.pem",
        "listen_private_key": f"{folder}/router.key",
        "enable_mtls": True,
    }
    content = {
        "mode": "router",
        "listen": {"endpoints": ["tls/0.0.0.0:7447"]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"link": {"tls": tls}},
        "access_control": access_control(),
    }
    return f"{_HEAD}{json.dumps(content, indent=2)}\n"
