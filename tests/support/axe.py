"""axe-core, fetched from the package registry for tests alone: what assistive technology would stumble over."""

import shutil
import subprocess
import tarfile
from pathlib import Path

import pytest
from playwright.sync_api import Page

PACKAGE = "axe-core@4.10.3"
#: What keeps somebody from using the page; the lesser impacts are matters of taste.
GRAVE = ("serious", "critical")
_RUN = """async only => (await axe.run(document, {
    iframes: false, resultTypes: ["violations"], ...(only.length && {runOnly: {type: "rule", values: only}})
})).violations.map(
    found => [found.impact, found.id, found.nodes.map(node => node.html.slice(0, 120) + " " + node.failureSummary)])"""


@pytest.fixture(scope="session")
def axe(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Its source. Where it cannot be fetched, tests that need it are skipped."""
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("npm is not installed, so axe-core cannot be fetched")
    folder = tmp_path_factory.mktemp("axe")
    try:
        subprocess.run([npm, "pack", PACKAGE, "--silent"], cwd=folder, check=True, capture_output=True, timeout=60)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired):
        pytest.skip(f"{PACKAGE} cannot be fetched from npm")
    (packed,) = folder.glob("*.tgz")
    with tarfile.open(packed) as archive:
        archive.extractall(folder, filter="data")
    return Path(folder / "package" / "axe.min.js").read_text(encoding="utf-8")


def grave(page: Page, source: str, *rules: str) -> list[str]:
    """Serious and critical violations on the page as it is now, of these rules alone where any are named."""
    page.evaluate(source)
    found = page.evaluate(_RUN, list(rules))
    return [f"{rule}: {' | '.join(nodes[:3])}" for impact, rule, nodes in found if impact in GRAVE]
