"""axe-core, which a locked package brings for tests alone: what assistive technology would stumble over."""

from importlib.resources import files

import pytest
from playwright.sync_api import Page

#: What keeps somebody from using the page; the lesser impacts are matters of taste.
GRAVE = ("serious", "critical")
_RUN = """async only => (await axe.run(document, {
    iframes: false, resultTypes: ["violations"], ...(only.length && {runOnly: {type: "rule", values: only}})
})).violations.map(
    found => [found.impact, found.id, found.nodes.map(node => node.html.slice(0, 120) + " " + node.failureSummary)])"""


@pytest.fixture(scope="session")
def axe() -> str:
    """Its source."""
    return (files("axe_playwright_python") / "axe.min.js").read_text(encoding="utf-8")


def grave(page: Page, source: str, *rules: str) -> list[str]:
    """Serious and critical violations on the page as it is now, of these rules alone where any are named."""
    return violations(page, source, *rules, impacts=GRAVE)


def violations(page: Page, source: str, *rules: str, impacts: tuple[str, ...] = ()) -> list[str]:
    """Violations on the page as it is now, of these rules and impacts alone where any are named."""
    page.evaluate(source)
    found = page.evaluate(_RUN, list(rules))
    return [f"{rule}: {' | '.join(nodes[:3])}" for impact, rule, nodes in found if not impacts or impact in impacts]
