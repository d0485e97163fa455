"""A real server on a loopback port, over a wire in memory, for tests."""

import asyncio
import contextlib
import threading
import time

import httpx
from websockets.sync.client import connect

from server.auth.access import Access
from server.auth.sessions import Sessions
from server.config import ServerConfig
from server.scene.solids import build_solids
from server.service import listen, serve

#: For a machine that is busy with other things; a test that passes never waits this long.
PATIENCE_S = 60.0


class RunningServer:
    def __init__(self, wire, address, sessions, path=""):
        self.wire = wire
        self.address = address
        self.sessions = sessions
        self._path = path

    def robot(self, name, wire):
        """The same server as the page of one of its robots sees it."""
        return RunningServer(wire, self.address, self.sessions, f"/robots/{name}")

    @contextlib.contextmanager
    def client(self, role="supervisor", user="test"):
        """An HTTP client that has signed in."""
        with self.visitor() as client:
            client.headers["origin"] = self.address
            token = self.sessions.invite(user, role)
            assert client.post("/api/sign-in", json={"token": token}).status_code == 200
            yield client

    def visitor(self):
        """An HTTP client that has not signed in and says no origin."""
        # The certificate of a test's own server is nobody's.
        return httpx.Client(base_url=self.address, timeout=PATIENCE_S, trust_env=False, verify=False)

    def cookie(self, client):
        return "; ".join(f"{name}={value}" for name, value in client.cookies.items())

    def socket(self, client, path="/ws", **options):
        """A WebSocket of this client, as a browser opens it; it need not be read to be closed."""
        headers, limits = {"cookie": self.cookie(client)}, {"max_size": None, "max_queue": None, "close_timeout": 0.5}
        if path == "/viser":
            limits["subprotocols"] = ["viser-v1.1.1"]
        address = self.socket_address + path
        return connect(address, origin=self.address, additional_headers=headers, proxy=None, **limits | options)

    @property
    def socket_address(self):
        return self.address.replace("http", "ws", 1) + self._path


@contextlib.contextmanager
def running_server(wire, config=None, access=None, state=None, **others):
    """`wire` is that of the robot `rp1`; further robots are given by their names. `state` is a folder."""
    # Otherwise the first test would wait for them while its server starts.
    build_solids()
    sessions = Sessions(3600.0)
    stopping = threading.Event()
    with listen("127.0.0.1", 0) as listener:
        access = access or Access()
        address = f"{access.scheme}://127.0.0.1:{listener.getsockname()[1]}"
        wires = {"rp1": wire, **others}
        work = serve(config or ServerConfig(), wires, sessions, listener, stopping, access, state=state)
        failure = []

        def run():
            try:
                asyncio.run(work)
            except BaseException as error:
                failure.append(error)
                raise

        thread = threading.Thread(target=run)
        thread.start()
        try:
            server = RunningServer(wire, address, sessions)
            with server.visitor() as visitor:
                eventually(lambda: failure or answers(visitor))
            assert not failure, failure
            yield server
        finally:
            stopping.set()
            thread.join(PATIENCE_S)
            assert not thread.is_alive()


def answers(visitor):
    try:
        return visitor.get("/api/health").status_code == 200
    except httpx.TransportError:
        return False


def eventually(condition, patience_s=PATIENCE_S):
    """Wait until `condition()` is true, and return what it gave."""
    deadline = time.monotonic() + patience_s
    while True:
        value = condition()
        if value or time.monotonic() > deadline:
            assert value, "it never happened"
            return value
        time.sleep(0.005)
