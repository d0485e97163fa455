"""Pages that look on at a running server: most read what they are sent, some never read."""

import argparse
import asyncio
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import AsyncExitStack, contextmanager, suppress

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Origin

from rolling_panda.errors import RollingPandaError
from rolling_panda.launch import child_environment, python_command

_OPEN_S = 30.0


async def look_on(url: str, cookie: str, pages: int, slow: int) -> None:
    """Open the pages, say `open`, and look on until standard input closes.

    Args:
        url: Of the server, http://HOST:PORT.
        cookie: Of a session.
        pages: How many in all.
        slow: How many of them never read.
    """
    socket_url = url.replace("http", "ws", 1) + "/ws"
    async with AsyncExitStack() as stack, asyncio.TaskGroup() as group:
        readers = []
        for number in range(pages):
            opening = connect(
                socket_url, origin=Origin(url), additional_headers={"Cookie": cookie}, open_timeout=_OPEN_S
            )
            page = await stack.enter_async_context(opening)
            if number >= slow:
                readers.append(group.create_task(_read(page)))
        print("open", flush=True)
        await asyncio.to_thread(sys.stdin.read)
        print(sum(not reader.done() for reader in readers), flush=True)
        for reader in readers:
            reader.cancel()


async def _read(page: ClientConnection) -> None:
    with suppress(ConnectionClosed):
        async for _ in page:
            pass


@contextmanager
def looked_at(url: str, cookie: str, pages: int, slow: int) -> Iterator[None]:
    """So many pages look on meanwhile, from a process of their own; `slow` of them never read.

    Raises:
        RollingPandaError: They were not let in, or not all of those that read did so to the end.
    """
    words = [url, cookie, "--pages", str(pages), "--slow", str(slow)]
    with subprocess.Popen(
        python_command("benchmarks.crowd", words),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=child_environment(),
    ) as crowd:
        assert crowd.stdout is not None
        if crowd.stdout.readline() != "open\n":
            raise RollingPandaError("the pages that look on were not let in")
        yield
        reading, _ = crowd.communicate(timeout=20)
    if int(reading) != pages - slow:
        raise RollingPandaError(f"{reading.strip()} of {pages - slow} pages still read at the end")


def main(argv: Sequence[str] | None = None) -> int:
    """Look on until standard input closes, then say how many still read. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("url", help="of the server, http://HOST:PORT")
    parser.add_argument("cookie", help="NAME=VALUE of a session")
    parser.add_argument("--pages", type=int, default=50, help="how many in all (default: 50)")
    parser.add_argument("--slow", type=int, default=10, help="how many of them never read (default: 10)")
    arguments = parser.parse_args(argv)
    asyncio.run(look_on(arguments.url, arguments.cookie, arguments.pages, arguments.slow))
    return 0


if __name__ == "__main__":
    sys.exit(main())
