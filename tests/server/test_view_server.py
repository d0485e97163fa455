"""Viser's internals as the server patches them: events across threads, and the rate of updates."""

import asyncio
import dataclasses
import threading
import time
from collections.abc import Iterator

import pytest
from viser import _messages as viser_messages
from viser.infra import Message
from viser.infra._async_message_buffer import AsyncMessageBuffer

from server.scene.viser_adapter.view_server import limit_frame_rate, patch_event_thread, update_pause_s


@dataclasses.dataclass
class Moved(Message):
    number: int

    def redundancy_key(self) -> str:
        return "where it is"


@pytest.fixture
def loop() -> Iterator[asyncio.AbstractEventLoop]:
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    yield loop
    loop.call_soon_threadsafe(loop.stop)
    thread.join()
    loop.close()


def test_changes_from_another_thread_wake_all_views_on_their_own_thread(loop: asyncio.AbstractEventLoop) -> None:
    patch_event_thread()
    patch_event_thread()
    made = [AsyncMessageBuffer(loop, persistent_messages=True)]
    woken_on: set[int] = set()
    heard: list[int] = []

    async def watch(client: int, last: int) -> None:
        windows = made[0].window_generator(client)
        async for window in windows:
            woken_on.add(threading.get_ident())
            if any(isinstance(each, Moved) and each.number == last for each in window):
                heard.append(client)
                break
        await windows.aclose()

    made[0].window_duration_sec = 0.001
    views = [asyncio.run_coroutine_threadsafe(watch(client, 300), loop) for client in range(40)]
    made[0].message_event.set()
    assert not made[0].message_event.is_set(), "this is not their thread"
    for number in range(301):
        made[0].push(Moved(number))
    for view in views:
        view.result(10)
    assert sorted(heard) == list(range(40))
    assert len(woken_on) == 1


def moved(x: float) -> viser_messages.Message:
    return viser_messages.SetPositionMessage("/robot", (x, 0.0, 0.0))


@pytest.mark.parametrize(("views", "may_operate", "waits"), [(8, False, False), (9, False, True), (50, True, False)])
def test_operators_never_wait_and_viewers_only_beside_many_views(views: int, may_operate: bool, waits: bool) -> None:
    assert (update_pause_s(views, may_operate) > 0.0) is waits


async def _heard(pause: float, moves: int) -> tuple[list[list[float]], float]:
    """What a view is sent while the robot moves every 10 ms, window by window, and how long that took (s)."""
    buffer = AsyncMessageBuffer(asyncio.get_running_loop(), persistent_messages=True)
    limit_frame_rate(buffer, lambda client_id: pause)
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
        limit_frame_rate(buffer, lambda client_id: 60.0)
        windows = buffer.window_generator(7)
        return sum([len(await asyncio.wait_for(anext(windows), 5.0)) for _ in range(3)])

    assert asyncio.run(opened()) == 300
