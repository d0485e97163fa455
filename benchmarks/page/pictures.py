"""`rolling-panda bench pictures`: the operator's page in each of its states, as pictures for the documents.

What needs the 3-D view is taken from a running demo. States that are rare there are the real page's too, but with a
server that plays them; behind its controls stands a still of the demo's 3-D view.
"""

import argparse
import importlib
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from benchmarks.page.pictures_live import walk_through
from rolling_panda.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
#: Without the 3-D view.
FLAT_FLAGS = ("--no-sandbox", "--disable-gpu")
#: It needs WebGL, and a machine without a graphics card draws it in software.
FLAGS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)
DESKTOP, TABLET, TELEPHONE = (1280, 800), (1024, 768), (390, 844)
#: Of a picture's palette. The most frequent ones are kept as they are where they differ enough from each other, so that
#: a small sign keeps its own; the others are for the 3-D view and the camera's image.
COLOURS, EXACT, APART = 256, 96, 5
STILL = "view.jpg"
_PATIENCE_MS = 60_000

#: Played states: what of the page is shown. All of it where nothing is said.
PARTS = {
    "survey": "rp-bar",
    "viewer": "rp-bar",
    "paused": "rp-alarms, rp-bar",
    "fault": "rp-alarms, rp-bar",
    "stop-pressed": "rp-stop-banner, rp-bar",
    "signed-out": "rp-link-banner, rp-bar",
    "preview-expired": "rp-preview, rp-bar",
    "teleoperate-base": "rp-drive",
    "teleoperate-joints": "rp-drive",
    "held-back": "rp-drive",
    "invite": ".top, #person-menu",
    "asked-for-control": ".top, rp-lease",
    "other-has-control": ".top, rp-lease",
    "replay": ".top, rp-replay",
}
#: What is shown on a tablet, in the dark, too; and on a telephone.
DARK = ("points", "running", "stopped", "charts")
SMALL = ("points", "running", "stopped", "teleoperate-base", "report")


class Album:
    """Keeps what is on a page, or a part of it, as a small file."""

    def __init__(self, folder: Path) -> None:
        """Pictures go to `folder`."""
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def take(self, page: Any, name: str, part: str = "") -> None:
        """Keep the page as `name`; with `part`, a selector, only the least box that holds all that it finds."""
        clip = page.evaluate(_BOX, part) if part else None
        if clip is not None and clip["width"] is None:
            raise InputError(f"{name}: nothing of {part} is to be seen on the page")
        picture = Image.open(BytesIO(page.screenshot(clip=clip))).convert("RGB")
        reduced(picture).save(self.folder / f"{name}.png", optimize=True)
        print(f"{name}.png", flush=True)

    def keep_still(self, page: Any) -> None:
        """Keep the 3-D view alone, for states that are played."""
        shown = """on => { for (const each of document.querySelectorAll(".stage > :not(rp-scene)"))
          each.style.visibility = on ? "" : "hidden"; }"""
        page.evaluate(shown, False)
        page.locator("rp-scene").screenshot(path=self.folder / STILL, type="jpeg", quality=70)
        page.evaluate(shown, True)


def reduced(picture: Image.Image) -> Image.Image:
    """The picture in few colours."""
    counted = picture.getcolors(picture.width * picture.height) or []
    frequent = np.array([colour for _, colour in sorted(counted, reverse=True)[: 20 * EXACT]], dtype=np.int16)
    exact = frequent[:1]
    for colour in frequent[1:]:
        if len(exact) < EXACT and (np.abs(exact - colour).max(axis=1) >= APART).all():
            exact = np.vstack((exact, colour))
    left = COLOURS - len(exact)
    # Half of them by how much they fill, half by how much they differ.
    others = [
        *(picture.quantize(left - left // 2, Image.Quantize.MEDIANCUT).getpalette() or []),
        *(picture.quantize(left // 2, Image.Quantize.MAXCOVERAGE).getpalette() or []),
    ]
    palette = Image.new("P", (1, 1))
    palette.putpalette([*exact.reshape(-1).tolist(), *others][: 3 * COLOURS])
    small = picture.quantize(palette=palette, dither=Image.Dither.NONE)
    # Pillow looks for the nearest one only roughly.
    places = np.asarray(small).copy()
    pixels = np.asarray(picture, dtype=np.int32) @ np.array((1 << 16, 1 << 8, 1), dtype=np.int32)
    for place, (red, green, blue) in enumerate(exact.tolist()):
        places[pixels == (red << 16) + (green << 8) + blue] = place
    small.frombytes(places.tobytes())
    return small


_BOX = """part => {
  const boxes = [...document.querySelectorAll(part)].map(each => each.getBoundingClientRect()).filter(box => box.width);
  const x = Math.max(0, Math.min(...boxes.map(box => box.left)) - 8);
  const y = Math.max(0, Math.min(...boxes.map(box => box.top)) - 8);
  const right = Math.min(innerWidth, Math.max(...boxes.map(box => box.right)) + 8);
  const bottom = Math.min(innerHeight, Math.max(...boxes.map(box => box.bottom)) + 8);
  return {x, y, width: boxes.length ? right - x : null, height: bottom - y};
}"""


@contextmanager
def new_page(browser: Any, size: tuple[int, int], scheme: str = "light") -> Iterator[Any]:
    """A page of this size. The 3-D client reads the language and dies on an empty one."""
    context = browser.new_context(
        locale="en-US", viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, reduced_motion="reduce"
    )
    page = context.new_page()
    page.set_default_timeout(_PATIENCE_MS)
    yield page
    context.close()


def played(launch: Callable[[list[str]], Any], album: Album, only: Sequence[str]) -> None:
    """Pictures of the states that a server plays: those that the tests of the page bring it to.

    Args:
        launch: Starts the browser with these flags.
        album: Where they are kept.
        only: Names of those wanted; all where it is empty.

    Raises:
        InputError: The tests are not here, or a part is not on the page.
    """
    if not (ROOT / "tests" / "support" / "page_states.py").exists():
        raise InputError(f"{ROOT / 'tests'} is not there: take the pictures in a checkout of the project")
    sys.path.insert(0, str(ROOT / "tests"))
    states, server, host = (
        importlib.import_module(f"tests.support.{name}") for name in ("page_states", "played_server", "page_host")
    )
    browser = launch([*FLAT_FLAGS, *host.page_host().flags])
    still = album.folder / STILL
    wanted = [(name, DESKTOP, "light", name, PARTS.get(name, "")) for name in states.STATES]
    wanted += [(name, TABLET, "dark", f"tablet-{name}", "") for name in DARK]
    wanted += [(name, TELEPHONE, "light", f"telephone-{name}", "") for name in SMALL]
    for name, size, scheme, called, part in wanted:
        if only and called not in only:
            continue
        with new_page(browser, size, scheme) as page:
            player = server.PlayedServer(view=still.read_bytes() if still.exists() else b"")
            player.attach(page)
            page.goto(f"{server.ORIGIN}/")
            page.locator("rp-scene iframe.loaded").wait_for()
            states.STATES[name](page, player)
            # Warnings of a page that has only just begun are none of the state's.
            page.wait_for_timeout(700)
            album.take(page, called, part)
    browser.close()


def main(argv: Sequence[str]) -> int:
    """Take the pictures; returns the exit code."""
    parser = argparse.ArgumentParser(prog="rolling-panda bench pictures", description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "docs/images/page", help="folder (default: %(default)s)")
    parser.add_argument("--part", choices=("all", "live", "played"), default="all", help="which (default: all)")
    parser.add_argument("--only", nargs="*", default=(), metavar="NAME", help="these played pictures alone")
    parser.add_argument("--seed", type=int, default=0, help="row to grow (default: 0)")
    parser.add_argument("--port", type=int, default=8767, help="port of the demo's page (default: 8767)")
    arguments = parser.parse_args(argv)
    chromium = shutil.which("chromium")
    if chromium is None:
        parser.error("Chromium is not installed")
    # Here and not above: `rolling-panda bench` lists its commands where there is no browser too.
    from playwright.sync_api import sync_playwright

    album = Album(arguments.out)
    with sync_playwright() as playwright:
        if arguments.part != "played":
            browser = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
            with new_page(browser, DESKTOP) as page:
                walk_through(page, album, arguments.port, arguments.seed)
            browser.close()
        if arguments.part != "live":
            played(
                lambda flags: playwright.chromium.launch(executable_path=chromium, args=flags), album, arguments.only
            )
    return 0
