"""Headless Chromium on a page of the running demo, and the browser's clock read as the machine's monotonic one."""

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rolling_panda.errors import InputError

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Frame, Page

#: A page without the 3-D view.
FLAT_FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
#: The 3-D view needs WebGL, and a machine without a GPU draws it in software.
FLAGS = (
    *(flag for flag in FLAT_FLAGS if flag != "--disable-gpu"),
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)


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


def clock_ahead(frame: "Page | Frame", tries: int = 20) -> float:
    """What to add to `performance.now() / 1000` of a frame for the machine's monotonic clock (s).

    The narrowest of several brackets: the frame's reading lies somewhere within it.
    """
    best = (float("inf"), 0.0)
    for _ in range(tries):
        before = time.monotonic()
        read = float(frame.evaluate("performance.now()")) / 1000
        after = time.monotonic()
        best = min(best, (after - before, (before + after) / 2 - read))
    return best[1]
