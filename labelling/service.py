"""Serves the labelling page on the loopback address until Ctrl-C."""

import sys

import uvicorn

from labelling.app import create_app
from labelling.pictures import Pictures
from labelling.proposals import Proposals
from server.auth.sessions import Sessions
from server.config import ServerConfig
from server.connections.http_protocol import SiteConfig
from server.connections.listener import Connections, Listener, listen

_HOST = "127.0.0.1"
#: Time limit for a request's body (s): the page sends masks of some megabytes from this machine.
_LIMITS = ServerConfig(connections=64, connections_per_address=48, body_s=30.0)


def listen_locally(port: int) -> Listener:
    """A socket on the loopback address.

    Raises:
        InputError: The port is taken or may not be used.
    """
    return listen(_HOST, port)


def labelling_server(listener: Listener, pictures: Pictures, proposals: Proposals) -> tuple[uvicorn.Server, str]:
    """The server of the page, which is not running yet, and the link that signs in once."""
    port = int(listener.getsockname()[1])
    sessions = Sessions(_LIMITS.session_idle_s)
    token = sessions.invite("labels", "operator")
    origins = frozenset(f"http://{name}:{port}" for name in (_HOST, "localhost"))
    # Cookies ignore ports: two programs on one machine need different names.
    app = create_app(pictures, proposals, sessions, origins, f"rolling_panda_labels_{port}")
    connections = Connections(_LIMITS)
    listener.count(connections, speaks_tls=False)
    config = SiteConfig(
        app,
        connections,
        ws="none",
        log_level="error",
        access_log=False,
        lifespan="off",
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=1,
    )
    return uvicorn.Server(config), f"http://{_HOST}:{port}/sign-in?token={token}"


def serve(listener: Listener, pictures: Pictures, proposals: Proposals) -> None:
    """Print the link, and serve until Ctrl-C."""
    server, link = labelling_server(listener, pictures, proposals)
    print(f"Sign in once with this link: {link}", flush=True)
    try:
        server.run(sockets=[listener])
    except KeyboardInterrupt:
        print("every stroke is saved", file=sys.stderr)
