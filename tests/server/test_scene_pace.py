"""With many 3-D views, those that only look on are sent the newest now and then, and nothing is queued for them."""

import asyncio
import time
from types import SimpleNamespace

import pytest
from viser import _messages as viser_messages
from viser.infra._async_message_buffer import AsyncMessageBuffer

from server.scene.pace import pace_views, pause_s


def moved(x: float) -> viser_messages.Message:
    return viser_messages.SetPositionMessage("/robot", (x, 0.0, 0.0))


@pytest.mark.parametrize(("views", "looks_on", "waits"), [(8, True, False), (9, True, True), (50, False, False)])
def test_who_works_is_sent_everything_and_who_looks_on_while_they_are_few(
    views: int, looks_on: bool, waits: bool
) -> None:
    assert (pause_s(views, looks_on) > 0.0) is waits


async def _heard(pause: float, moves: int) -> tuple[list[list[float]], float]:
    """What a view is sent while the robot moves every 10 ms, window by window, and how long that took (s)."""
    buffer = AsyncMessageBuffer(asyncio.get_running_loop(), persistent_messages=True)
    pace_views(SimpleNamespace(_websock_server=SimpleNamespace(_broadcast_buffer=buffer)), lambda client_id: pause)
    heard: list[list[float]] = []

    async def view() -> None:
        async for window in buffer.window_generator(7):
            heard.append([message.position[0] for message in window])
            if heard[-1][-1] == moves:
                return

    began = time.monotonic()
    watching = asyncio.create_task(view())
    for x in range(1, moves + 1):
        buffer.push(moved(float(x)))
        await asyncio.sleep(0.01)
    await asyncio.wait_for(watching, 5.0)
    return heard, time.monotonic() - began


def test_a_view_that_waits_is_sent_the_newest_and_the_last() -> None:
    heard, took_s = asyncio.run(_heard(pause=0.1, moves=40))
    assert len(heard) <= 1 + took_s / 0.1, "seldom"
    assert all(len(window) == 1 for window in heard), "nothing was queued for it"
    assert heard[-1] == [40.0]


def test_a_view_that_does_not_wait_is_sent_every_turn() -> None:
    assert len(asyncio.run(_heard(pause=0.0, moves=40))[0]) >= 15


def test_what_a_view_gets_when_it_opens_comes_without_a_wait() -> None:
    async def opened() -> int:
        buffer = AsyncMessageBuffer(asyncio.get_running_loop(), persistent_messages=True)
        for number in range(300):
            buffer.push(viser_messages.SetPositionMessage(f"/points/{number}", (0.0, 0.0, 0.0)))
        pace_views(SimpleNamespace(_websock_server=SimpleNamespace(_broadcast_buffer=buffer)), lambda client_id: 60.0)
        windows = buffer.window_generator(7)
        return sum([len(await asyncio.wait_for(anext(windows), 5.0)) for _ in range(3)])

    assert asyncio.run(opened()) == 300
