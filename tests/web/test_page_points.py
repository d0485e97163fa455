"""The pruning rule: what another one would change, applied, and undone."""

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from tests.support.page_parts import choose, mark
from tests.support.played_page import until
from tests.support.played_server import PlayedServer

pytestmark = pytest.mark.browser


@pytest.fixture
def screen() -> str:
    return "review"


ASKED = {"system": "spur", "nodes_kept": 2, "fruiting_nodes": 8, "preferred_diameter": 0.006, "offset": 0.025}
WORDS = "17 move, 3 go, 5 come, 4 acceptances would be void"


def of(server: PlayedServer, path: str) -> list[object]:
    return [body for asked, body in server.posted if asked == path]


def test_a_step_of_a_rules_slider_says_what_it_would_change_and_changes_nothing(
    page: Page, server: PlayedServer
) -> None:
    server.answers["/api/rule/what-if"] = (200, {"ok": True, "reason": WORDS})
    expect(page.locator("rp-rule summary")).to_have_text("Rule: Spur · 2 buds · ≥ 6 mm · 20 mm past")
    page.locator("rp-rule summary").click()
    expect(page.locator("#rule-fruiting_nodes")).to_be_hidden()
    page.locator("#rule-offset").focus()
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    expect(page.locator(".rule-outcome")).to_have_text(f"If applied: {WORDS}")
    assert of(server, "/api/rule/what-if")[-1] == ASKED and of(server, "/api/rule") == []
    expect(page.locator("rp-rule summary")).to_contain_text("20 mm past · another one is tried")
    # What is tried is forgotten, and the slider goes back.
    page.locator("#rule-discard").click()
    expect(page.locator("#rule-offset")).to_have_value("20")
    expect(page.locator("#rule-apply")).to_be_hidden()
    expect(page.locator("#undo")).to_be_disabled()
    assert {path for path, _ in server.posted} == {"/api/rule/what-if"}


def test_an_applied_rule_is_taken_back_with_its_acceptances_by_undo(page: Page, server: PlayedServer) -> None:
    server.answers["/api/rule/what-if"] = (200, {"ok": True, "reason": WORDS})
    page.locator("rp-rule summary").click()
    page.locator("#rule-offset").focus()
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    expect(page.locator("#rule-apply")).to_be_enabled()
    page.locator("#rule-apply").click()
    until(page, lambda: of(server, "/api/rule") == [ASKED])
    # What comes of it is on the rows, with the rule as the cause.
    first, second, third = server.points
    rule = reasons.spur_rule(2.0, 6.0, 25.0)
    cause = reasons.acceptance_void(reasons.rule_cuts_elsewhere(rule, 5.0))
    server.rule = m.PruningRule(offset=0.025)
    server.points = (
        first,
        msgspec.structs.replace(second, entry=msgspec.structs.replace(second.entry, state="PROPOSED", reason=cause)),
        third,
    )
    server.tell(server.page_points())
    expect(choose(page, "p2").locator(".review-why")).to_contain_text("The rule is now: Spur, buds kept: 2")
    expect(page.locator("rp-rule summary")).to_have_text("Rule: Spur · 2 buds · ≥ 6 mm · 25 mm past")
    expect(page.locator("#rule-apply")).to_be_hidden()
    undo = page.locator("#undo")
    expect(undo).to_have_attribute("title", "Take back: the rule Spur · 2 buds · ≥ 6 mm · 25 mm past (Z)")
    undo.click()
    until(page, lambda: of(server, "/api/rule/undo") == [ASKED])
    server.rule, server.points = m.PruningRule(), (first, second, third)
    server.tell(server.page_points())
    expect(page.locator("#rule-offset")).to_have_value("20")
    expect(mark(page, "p2")).to_have_attribute("data-state", "ACCEPTED")
    expect(undo).to_be_disabled()


def test_guyot_asks_for_the_nodes_of_the_fruiting_cane(page: Page, server: PlayedServer) -> None:
    page.locator("rp-rule summary").click()
    page.locator("#system-guyot").click(force=True)
    until(page, lambda: bool(server.posted))
    path, body = server.posted[-1]
    assert path == "/api/rule/what-if" and body["system"] == "guyot"
    expect(page.locator("#rule-fruiting_nodes")).to_be_visible()
    # Somebody else has set the same: there is nothing left to be applied.
    server.rule = m.PruningRule(system="guyot")
    server.tell(server.page_points())
    expect(page.locator("#rule-apply")).to_be_hidden()
    expect(page.locator("#rule-fruiting_nodes")).to_be_visible()


def test_a_rule_that_is_refused_is_not_applied_and_says_why(page: Page, server: PlayedServer) -> None:
    busy = "perception is busy with a frame"
    server.answers["/api/rule/what-if"] = (409, {"ok": False, "reason": busy})
    page.locator("rp-rule summary").click()
    page.locator("#rule-nodes_kept").press("ArrowRight")
    expect(page.locator(".rule-outcome")).to_have_text(f"Not known: {busy}")
    expect(page.locator("#rule-apply")).to_be_disabled()
    # It is asked again by itself.
    del server.answers["/api/rule/what-if"]
    server.answers["/api/rule"] = (409, {"ok": False, "reason": busy})
    expect(page.locator("#rule-apply")).to_be_enabled()
    page.locator("#rule-apply").click()
    expect(page.locator(".toast").last).to_contain_text(f"The rule refused: {busy}")
    expect(page.locator("rp-rule summary")).to_contain_text("2 buds")
    expect(page.locator("#undo")).to_be_disabled()
    server.role = "viewer"
    expect(page.locator("#rule-nodes_kept")).to_be_disabled()
