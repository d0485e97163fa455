"""A morning's work on the page of a running demo, as an operator would go through it, with a picture of each step."""

from typing import Any, Protocol

from rolling_panda.errors import InputError
from tests.support.processes.demo import Demo

#: So many points are accepted: enough to see the work, and soon done.
FEW = 4
#: So often, every 0.3 s, it is looked whether work goes on.
_PAUSES = 400


class Keeps(Protocol):
    """What takes the pictures."""

    def take(self, page: Any, name: str, part: str = "") -> None:
        """Keep what is on the page."""

    def keep_still(self, page: Any) -> None:
        """Keep the 3-D view alone."""


def walk_through(page: Any, album: Keeps, port: int, seed: int) -> None:
    """From signing in to leading the tool by hand, on a demo of its own."""
    demo = Demo(port, seed)
    try:
        # The first hints would cover the view.
        page.add_init_script("localStorage.setItem('setting.hints', 'seen')")
        page.goto(f"http://127.0.0.1:{port}/")
        page.locator("#token").wait_for()
        album.take(page, "sign-in", ".card")
        # Drawn in software the view is slow, and work is paused while nobody looks on.
        with demo.watched():
            page.goto(demo.post("invite", user="Ada", role="supervisor")["link"])
            for step in (_find, _preview, _work, _charts_and_report, _by_hand):
                step(page, album)
    finally:
        demo.close()


def _rest(page: Any, seconds: float = 3.0) -> None:
    """Let the 3-D view catch up with the robot: there is nothing on the page that says when it has."""
    page.wait_for_timeout(1000.0 * seconds)


def _mode(page: Any, mode: str) -> None:
    page.locator(f'#mode[data-mode="{mode}"]').wait_for()


def _press(page: Any, button: str) -> None:
    page.locator(f'{button}[aria-disabled="false"]').click()


def _open(page: Any, screen: str) -> None:
    page.locator(f'[data-tab="{screen}"]').click()
    page.locator(f"rp-{screen}:defined").wait_for()


def _resumed(page: Any, wanted: str) -> None:
    """Wait for something; work that a busy machine has paused goes on."""
    for _ in range(_PAUSES):
        if not page.locator("#to-continue").is_visible() and page.locator(wanted).first.is_visible():
            return
        if page.locator("#to-continue").is_visible():
            _press(page, "#to-continue")
        page.wait_for_timeout(300)
    raise InputError(f"the work did not get to {wanted}")


def _find(page: Any, album: Keeps) -> None:
    page.locator("rp-scene iframe.loaded").wait_for()
    # Drawn, not only there.
    page.locator("rp-scene .empty").wait_for(state="hidden", timeout=180_000)
    page.locator("[data-cut]").nth(2).wait_for()
    page.locator("rp-camera img").wait_for()
    _rest(page, 8.0)
    album.keep_still(page)
    _press(page, "#arm")
    _mode(page, "READY")
    page.locator("[data-cut] button").first.click()
    page.locator('.work-picture[data-shown="yes"]').wait_for()
    _rest(page, 10.0)
    album.take(page, "live-points")


def _preview(page: Any, album: Keeps) -> None:
    # Here and not above: `rolling-panda bench` lists its commands where there is no browser too.
    from tests.support.operator_page import accept

    for _ in range(FEW):
        name = page.locator('[data-cut][data-state="PROPOSED"]').first.get_attribute("data-cut")
        accept(page, str(name))
        _rest(page, 0.5)
    page.locator("#show-preview").click()
    page.locator('#approve-preview[aria-disabled="false"]').wait_for()
    slider = page.locator("#preview-time")
    slider.fill(str(0.6 * float(slider.get_attribute("max"))))
    # From where the transparent robot is in sight.
    page.locator('[data-preset="follow"]').click()
    _rest(page, 10.0)
    album.take(page, "live-preview")
    _press(page, "#approve-preview")
    page.locator("#close-preview").click()


def _work(page: Any, album: Keeps) -> None:
    _press(page, "#start")
    _mode(page, "AUTO")
    _resumed(page, '[data-cut][data-state="CUTTING"], [data-cut][data-state="DONE"]')
    album.take(page, "live-running")
    _resumed(page, ".next #to-review")


def _charts_and_report(page: Any, album: Keeps) -> None:
    _open(page, "engineer")
    _rest(page)
    album.take(page, "live-charts")
    _open(page, "report")
    page.locator("rp-report tbody tr").first.wait_for()
    album.take(page, "live-report")


def _by_hand(page: Any, album: Keeps) -> None:
    _open(page, "drive")
    _press(page, "#teleop")
    _rest(page, 10.0)
    # A browser that draws in software may be silent for so long that its control has ended.
    page.wait_for_function("!document.querySelector('rp-toasts .toast')")
    album.take(page, "live-teleoperate")
    page.locator("#teleop").click()
