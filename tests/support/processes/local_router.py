"""A router on this machine, for what speaks over a real wire, and ports that nobody listens on."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager

from rolling_panda.config import TransportConfig
from rolling_panda.transport.zenoh import Router


def free_port() -> int:
    """A loopback port that nobody listens on now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def local_router() -> Iterator[str]:
    """A plain router on a free loopback port; yields its endpoint."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    router = Router(TransportConfig(mode="router", connect=(), listen=(endpoint,), plain_wire=True))
    try:
        yield endpoint
    finally:
        router.close()
