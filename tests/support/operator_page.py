"""Headless Chromium on the real page, as an operator would have it."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Page, Request, sync_playwright

from tests.support.chromium import FLAGS


@contextmanager
def operator_page(
    chromium_path: str, link: str, *, width: int = 1280, height: int = 800, scale: float = 0.25, touch: bool = False
) -> Iterator[Page]:
    """A page signed in by a single-use link. Leaving it fails if the page asked any other origin for anything.

    An operator's browser draws on a graphics card, and mostly on another machine. Here it draws in software, so it gets
    a quarter of the pixels a way, and leaves the robot's processes a share of the cores.
    """
    origin = link.split("/sign-in")[0]
    own = (origin, origin.replace("http", "ws", 1), "blob:", "data:")
    foreign: list[str] = []

    def look(request: Request) -> None:
        if not request.url.startswith(own):
            foreign.append(request.url)

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium_path, args=list(FLAGS))
        try:
            # The 3-D client reads the language and dies on an empty one.
            context = browser.new_context(
                locale="en-US",
                viewport={"width": width, "height": height},
                device_scale_factor=scale,
                has_touch=touch,
            )
            # This operator knows the page: no hints for newcomers lie over it.
            context.add_init_script("localStorage.setItem('setting.hints', 'seen')")
            page = context.new_page()
            page.on("request", look)
            page.goto(link)
            # With several robots the way in leads on to the first one's page.
            page.wait_for_url(re.compile(rf"^{re.escape(origin)}/(robots/[^/]+/)?$"), timeout=30_000)
            yield page
        finally:
            browser.close()
    assert not foreign, f"the page asked another origin: {foreign}"


def accept(page: Page, point_id: str) -> None:
    """Look at a cut's picture and accept it, as an operator does."""
    page.click('[data-tab="review"]')
    page.click(f'.strip-mark[data-point-id="{point_id}"]')
    page.wait_for_selector(f'rp-review[data-key="{point_id}"] #review-accept[aria-disabled="false"]')
    # A press right after another picture has come was meant for the one before.
    page.wait_for_timeout(300)
    page.click("#review-accept")
    page.click('[data-tab="work"]')
