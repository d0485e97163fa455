"""Pages that look on at a running server: most read what they are sent, some never read."""

import argparse
import asyncio
import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import AsyncExitStack, contextmanager, suppress

import httpx
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Origin, Subprotocol

from rolling_panda.errors import RollingPandaError
from rolling_panda.runtime.launch import child_environment, python_command
from server.scene.viser_adapter.contract import VERSION as VISER_VERSION

_OPEN_S, _CLOSE_S = 30.0, 0.2
_FRAME = re.compile(r'"camera_frame":(\d+)')


async def look_on(url: str, cookie: str, pages: int, slow: int, whole: bool = False) -> None:
    """Open the pages, say `open`, and look on until standard input closes.

    Args:
        url: Of the server, http://HOST:PORT.
        cookie: Of a session.
        pages: How many in all.
        slow: How many of them never read.
        whole: Whether each has the 3-D view and the camera's image too, as a page in a browser has.
    """
    address, headers = url.replace("http", "ws", 1), {"Cookie": cookie}
    async with AsyncExitStack() as stack, asyncio.TaskGroup() as group:

        async def opened(path: str, protocols: list[Subprotocol] | None = None) -> ClientConnection:
            opening = connect(
                address + path,
                origin=Origin(url),
                additional_headers=headers,
                open_timeout=_OPEN_S,
                # Who never reads never hears the other side say goodbye.
                close_timeout=_CLOSE_S,
                subprotocols=protocols,
                # A browser asks for no sign of life.
                ping_interval=None,
                max_size=None,
                compression=None,
            )
            return await stack.enter_async_context(opening)

        images = await stack.enter_async_context(httpx.AsyncClient(base_url=url, headers=headers, trust_env=False))
        readers = []
        for number in range(pages):
            page = await opened("/ws")
            view = await opened("/viser", [Subprotocol(f"viser-v{VISER_VERSION}")]) if whole else None
            if number >= slow:
                readers.append(group.create_task(_read(page, images if whole else None)))
                if view is not None:
                    readers.append(group.create_task(_read(view)))
        print("open", flush=True)
        await asyncio.to_thread(sys.stdin.read)
        print(json.dumps([reader.result() for reader in readers if reader.done()]), flush=True)
        for reader in readers:
            reader.cancel()


async def _read(socket: ClientConnection, images: httpx.AsyncClient | None = None) -> str:
    """Read until the other side ends it; how it ended."""
    shown, image = "0", asyncio.create_task(asyncio.sleep(0.0))
    try:
        async for said in socket:
            frame = _FRAME.search(said) if images is not None and isinstance(said, str) else None
            # As the page does: the newest image, beside what else is read, and one at a time.
            if images is not None and frame is not None and frame[1] != shown and image.done():
                shown = frame[1]
                image = asyncio.create_task(_load(images, f"/camera/color.jpg?n={shown}"))
    except ConnectionClosed:
        pass
    finally:
        image.cancel()
    return f"{socket.close_code} {socket.close_reason}".strip()


async def _load(images: httpx.AsyncClient, path: str) -> None:
    with suppress(httpx.HTTPError):
        await images.get(path)


@contextmanager
def looked_at(url: str, cookie: str, pages: int, slow: int, whole: bool = False) -> Iterator[None]:
    """So many pages look on meanwhile, from a process of their own; `slow` of them never read, `whole` as in `look_on`.

    Raises:
        RollingPandaError: They were not let in, or not all of those that read did so to the end.
    """
    words = [url, cookie, "--pages", str(pages), "--slow", str(slow), *(["--whole"] if whole else [])]
    with subprocess.Popen(
        python_command("benchmarks.page.crowd", words),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=child_environment(),
    ) as crowd:
        assert crowd.stdout is not None
        if crowd.stdout.readline() != "open\n":
            raise RollingPandaError("the pages that look on were not let in")
        try:
            yield
        finally:
            told, _ = crowd.communicate(timeout=20)
    if ended := json.loads(told):
        how = ", ".join(f"{count} x {reason}" for reason, count in Counter(ended).most_common())
        raise RollingPandaError(f"{len(ended)} of the pages and views that read were ended: {how}")


def main(argv: Sequence[str] | None = None) -> int:
    """Look on until standard input closes, then say which that read were ended. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("url", help="of the server, http://HOST:PORT")
    parser.add_argument("cookie", help="NAME=VALUE of a session")
    parser.add_argument("--pages", type=int, default=50, help="how many in all (default: 50)")
    parser.add_argument("--slow", type=int, default=10, help="how many of them never read (default: 10)")
    parser.add_argument("--whole", action="store_true", help="each with the 3-D view and the camera's image")
    arguments = parser.parse_args(argv)
    asyncio.run(look_on(arguments.url, arguments.cookie, arguments.pages, arguments.slow, arguments.whole))
    return 0


if __name__ == "__main__":
    sys.exit(main())
