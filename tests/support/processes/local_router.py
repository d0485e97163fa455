"""A router on this machine, for tests of what is said through it."""

from collections.abc import Iterator
from contextlib import contextmanager

from rolling_panda.config import TransportConfig
from rolling_panda.transport.zenoh import Router
from tests.support.processes.live_robot import free_port


@contextmanager
def local_router() -> Iterator[str]:
    """A plain router on a free loopback port; yields its endpoint."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    router = Router(TransportConfig(mode="router", connect=(), listen=(endpoint,), plain_wire=True))
    try:
        yield endpoint
    finally:
        router.close()
