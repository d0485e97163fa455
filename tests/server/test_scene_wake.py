"""Viser's buffers as `server/scene/wake.py` makes them: changed from another thread, with many that wait."""

import asyncio
import dataclasses
import threading
from collections.abc import Iterator

import pytest
from viser.infra import Message
from viser.infra._async_message_buffer import AsyncMessageBuffer

from server.scene.wake import wake_on_own_thread


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


def test_all_that_wait_are_woken_by_another_thread_and_only_on_their_own(loop: asyncio.AbstractEventLoop) -> None:
    wake_on_own_thread()
    wake_on_own_thread()
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
