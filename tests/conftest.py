"""What tests share."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import Phase, settings
from playwright.sync_api import sync_playwright

from tests.support.played_page import browser, close_browser, page, screen, server, tab
from tests.support.processes.local_router import local_router

__all__ = ["browser", "page", "screen", "server", "tab"]

# A time limit for each example would judge how busy the machine is, not the code. The same examples each time, so that
# a change fails for what it changed; `HYPOTHESIS_PROFILE=explore make test` looks for new ones; `make fast` uses few.
settings.register_profile("same", deadline=None, derandomize=True, max_examples=40)
settings.register_profile("explore", deadline=None, max_examples=500)
settings.register_profile("fast", deadline=None, derandomize=True, max_examples=8)
# A mutant is killed by the first example that fails; the smallest one is not looked for.
_NO_SHRINKING = (Phase.explicit, Phase.reuse, Phase.generate)
settings.register_profile("mutation", deadline=None, derandomize=True, max_examples=40, phases=_NO_SHRINKING)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """Successive tests share a browser. Other tests find neither it nor its event loop."""
    yield
    if nextitem is None or "browser" not in getattr(nextitem, "fixturenames", ()):
        close_browser()


def pytest_xdist_auto_num_workers() -> int:
    """Two workers a core: half of their time tests wait, for a browser or a time limit."""
    return 2 * len(os.sched_getaffinity(0))


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """The stages of `make test` that run few tests import only the files with their marker."""
    stage = str(config.getoption("markexpr")).partition(" ")[0]
    if stage in ("paced", "alone") and collection_path.name.startswith("test_"):
        return f"mark.{stage}" not in collection_path.read_text(encoding="utf-8") or None
    return None


@pytest.fixture(autouse=True, scope="session")
def state_of_the_tests_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Processes that a test starts keep their state apart from that of this machine's user."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(autouse=True)
def ordinary_scheduling(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A process's `main` that is called in the tests' own process leaves their scheduling as it is.

    Otherwise every program that a later test starts would inherit real-time priority, a browser for instance, and keep
    the processor from the server that it waits for.
    """
    for module in ("runtime.process", "cli.router"):
        monkeypatch.setattr(f"rolling_panda.{module}.set_priority", lambda priority: None)
    before = os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)
    yield
    assert (os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)) == before, "a test changed its own priority"


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """Of a router without encryption, one for a file of tests."""
    with local_router() as endpoint:
        yield endpoint


@pytest.fixture(scope="session")
def chromium_path() -> str:
    """The browser to drive: the system's, or else the one that Playwright has installed. Without one, tests fail."""
    found = shutil.which("chromium")
    if found is None:
        with sync_playwright() as playwright:
            found = playwright.chromium.executable_path
    if not Path(found).exists():
        pytest.fail(
            "Chromium is not installed. Debian: sudo apt-get install chromium. "
            "Elsewhere: .venv/bin/playwright install --with-deps chromium",
            pytrace=False,
        )
    return found
