"""Views of the 3-D scene are woken on viser's own thread alone.

Viser 1.1.1 sets an `asyncio.Event` from whichever thread has changed the scene, and again on its own thread just after.
The first walks through all that wait while they come and go, which with dozens of views fails in time ("deque mutated
during iteration") and with the call ends the server. The second is enough.
"""

import asyncio
from typing import Any

from viser.infra import _async_message_buffer as viser_buffer

_MENDED = "_woken_on_its_own_thread"


class LoopsOwnEvent(asyncio.Event):
    """Set only where its loop runs; elsewhere setting it does nothing."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        """Not set."""
        super().__init__()
        self._own = loop

    def set(self) -> None:
        """Wake those that wait, when called on the loop."""
        try:
            running = asyncio.get_running_loop()
        except RuntimeError:
            return
        if running is self._own:
            super().set()


def wake_on_own_thread() -> None:
    """Every message buffer that viser makes from now on is woken so; once is enough, and more do no harm."""
    kind: Any = viser_buffer.AsyncMessageBuffer
    if getattr(kind, _MENDED, False):
        return
    plain = kind.__init__

    def make(self: Any, event_loop: asyncio.AbstractEventLoop, *rest: Any, **more: Any) -> None:
        plain(self, event_loop, *rest, **more)
        self.message_event = LoopsOwnEvent(event_loop)

    kind.__init__ = make
    setattr(kind, _MENDED, True)
