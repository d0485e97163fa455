"""Headless Chromium on a page of the running demo, and the browser's clock read as the machine's monotonic one."""

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import psutil

from rolling_panda.errors import InputError
from tests.support.chromium import FLAGS

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Frame, Page

#: Of the browser's threads, before all ordinary processes and behind what keeps time.
_NICE = -19


@contextmanager
def chromium() -> Iterator["Browser"]:
    """The system's Chromium, without a window.

    Raises:
        InputError: There is none.
    """
    # Here and not above: most benchmarks have no browser.
    from playwright.sync_api import sync_playwright

    path = shutil.which("chromium")
    if path is None:
        raise InputError("this needs Chromium, which is not installed: sudo apt-get install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        try:
            yield browser
        finally:
            browser.close()


def put_first() -> int:
    """Let this process's Chromium go before ordinary processes; how many of its threads could be moved.

    An operator's browser is another machine's. Here it shares the robot's processors, and would wait for perception,
    which an operator's does not. What keeps time stays before it.
    """
    moved = 0
    for process in psutil.Process().children(recursive=True):
        # Processes and threads may go at any time, and without the permission all stays as it is.
        with suppress(psutil.Error, OSError):
            if "chrom" not in process.name():
                continue
            for thread in process.threads():
                if os.getpriority(os.PRIO_PROCESS, thread.id) > _NICE:
                    os.setpriority(os.PRIO_PROCESS, thread.id, _NICE)
                    moved += 1
    return moved


def clock_ahead(frame: "Page | Frame") -> float:
    """What to add to `performance.now() / 1000` of a frame for the machine's monotonic clock (s).

    The narrowest of several brackets: the frame's reading lies somewhere within it.
    """
    best = (float("inf"), 0.0)
    for _ in range(20):
        before = time.monotonic()
        read = float(frame.evaluate("performance.now()")) / 1000
        after = time.monotonic()
        best = min(best, (after - before, (before + after) / 2 - read))
    return best[1]
