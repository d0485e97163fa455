"""Pictures of the page: small, of the part that matters, and one of every state for the documents that show them."""

import re
import signal
import subprocess
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

import httpx
import numpy as np
import psutil
import pytest
from PIL import Image
from playwright.sync_api import Page

from benchmarks.page import pictures
from rolling_panda.errors import InputError
from rolling_panda.runtime.launch import child_environment, python_command
from tests.support.page_states import STATES
from tests.support.played_page import box_of
from tests.support.processes.local_router import free_port
from tests.support.waiting import until

FOLDER = pictures.ROOT / "docs/images/page"


@pytest.mark.browser
def test_a_picture_is_of_the_part_that_matters_in_few_colours(page: Page, tmp_path: Path) -> None:
    album = pictures.Album(tmp_path / "new")
    album.take(page, "all")
    album.take(page, "two", "rp-work, rp-camera")
    with Image.open(tmp_path / "new/all.png") as all_of_it, Image.open(tmp_path / "new/two.png") as part:
        assert all_of_it.size == (1280, 800)
        work, camera = box_of(page.locator("rp-work")), box_of(page.locator("rp-camera"))
        assert part.width == pytest.approx(work["x"] + work["width"] - camera["x"] + 16, abs=2)
        assert part.height == pytest.approx(work["height"] + 16, abs=2)
        assert len(part.convert("RGB").getcolors() or ()) in range(16, pictures.COLOURS + 1)


@pytest.mark.long
def test_a_small_sign_keeps_its_colour_beside_a_large_picture() -> None:
    rng = np.random.default_rng(0)
    picture = Image.fromarray(rng.integers(0, 256, (400, 600, 3), dtype=np.uint8))
    picture.paste((255, 255, 255), (0, 0, 600, 40))
    picture.paste((135, 83, 0), (10, 10, 22, 22))
    small = pictures.reduced(picture).convert("RGB")
    assert small.getpixel((300, 30)) == (255, 255, 255) and small.getpixel((15, 15)) == (135, 83, 0)


def test_every_state_is_pictured_and_the_folder_is_small() -> None:
    taken = {path.stem for path in FOLDER.glob("*.png")}
    assert set(STATES) <= taken, "take them with `rolling-panda bench pictures`"
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 5e6
    assert set(pictures.PARTS) | set(pictures.DARK) | set(pictures.SMALL) <= set(STATES)


@pytest.mark.parametrize("document", ["README.md", "docs/operator-guide.md"])
def test_what_documents_show_is_there(document: str) -> None:
    path = pictures.ROOT / document
    shown = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", path.read_text(encoding="utf-8"))
    assert shown
    assert [name for name in shown if not (path.parent / name).exists()] == []


def test_without_the_tests_it_says_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "ROOT", tmp_path)
    with pytest.raises(InputError, match="in a checkout of the project"):
        pictures.played(pytest.fail, pictures.Album(tmp_path), ())


@pytest.mark.long
@pytest.mark.browser
@pytest.mark.alone
def test_ended_while_its_demo_starts_it_leaves_nothing_behind(tmp_path: Path) -> None:
    port = str(free_port())
    words = ["pictures", "--part", "live", "--out", str(tmp_path), "--port", port]
    # A shell's background job ignores Ctrl-C, and so would what it starts.
    heed = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    command = python_command("benchmarks", words)
    bench = subprocess.Popen(command, env=child_environment(), stderr=subprocess.DEVNULL, preexec_fn=heed)
    started: list[psutil.Process] = []

    def serves() -> bool:
        time.sleep(0.2)
        started[:] = psutil.Process(bench.pid).children(recursive=True)
        with suppress(httpx.TransportError):
            return httpx.get(f"http://127.0.0.1:{port}/sign-in").is_success
        return False

    try:
        until(serves, 120.0)
        # It alone, as another program would, and not all processes of a terminal.
        bench.send_signal(signal.SIGINT)
        bench.wait(30.0)
        assert psutil.wait_procs(started, timeout=10.0)[1] == []
    finally:
        for each in (bench, *started):
            if each.poll() is None if isinstance(each, subprocess.Popen) else each.is_running():
                each.kill()
        bench.wait(10.0)
