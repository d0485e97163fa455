"""How often each 3-D view is sent what moves: with many views, those that only look on seldomer than who works.

Every view is packed and sent its own, so dozens of them would take the time of the one whose hand moves the robot. What
is left out is not queued: a view that waits is sent the newest of everything. This uses viser's internals, at an exact
version.
"""

import asyncio
from collections.abc import AsyncGenerator, Callable, Sequence
from typing import Any

import viser

#: With more views than this, those that only look on wait between two pictures for so long (s).
_FEW_VIEWS, _ONLOOKERS_S = 8, 0.2


def pause_s(views: int, looks_on: bool) -> float:
    """How long to wait after a picture was sent to a view (s).

    Args:
        views: How many are open.
        looks_on: Whether this one's session may not operate.
    """
    return _ONLOOKERS_S if looks_on and views > _FEW_VIEWS else 0.0


def pace_views(server: viser.ViserServer, pause: Callable[[int], float]) -> None:
    """After each picture a view waits for `pause(client_id)` seconds; everything of the first one comes without."""
    buffer = server._websock_server._broadcast_buffer
    plain = buffer.window_generator

    async def paced(client_id: int, **more: Any) -> AsyncGenerator[Sequence[Any], None]:
        windows = plain(client_id, **more)
        try:
            async for window in windows:
                yield window
                # A full one is of the many that a view gets when it opens.
                if len(window) < buffer.max_window_size and (seconds := pause(client_id)):
                    await asyncio.sleep(seconds)
        finally:
            await windows.aclose()

    buffer.window_generator = paced
