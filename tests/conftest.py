"""What tests share."""

import shutil
from pathlib import Path

import pytest
from hypothesis import settings
from playwright.sync_api import sync_playwright

# A time limit for each example would judge how busy the machine is, not the code.
settings.register_profile("rolling-panda", deadline=None)
settings.load_profile("rolling-panda")


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
