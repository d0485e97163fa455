"""A whole vine at once: its sure cuts accepted in one press as they were shown, its places left in another."""

from collections.abc import Iterator

import msgspec
import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages import page as p
from tests.support.deciding_server import DecidingServer
from tests.support.page_host import ORIGIN
from tests.support.page_parts import looking_at, mark, ready, removal, show
from tests.support.played_page import until
from tests.support.played_server import point

pytestmark = pytest.mark.browser
WHERE = (1.4, 0.8, 0.9)


@pytest.fixture
def screen() -> str:
    return "review"


def sure(number: int, confidence: float = 0.9, **where: int) -> p.PagePoint:
    row = point(number, "PROPOSED", **{"spur": number, **where})
    return msgspec.structs.replace(row, point=msgspec.structs.replace(row.point, confidence=confidence))


@pytest.fixture
def server() -> DecidingServer:
    """Vine 1 has two sure cuts, an unsure one and two places; vine 2 has a sure one."""
    return DecidingServer(
        points=(sure(1), sure(2), sure(3, 0.62), sure(4, vine=2, spur=1)),
        undecided_sites=(
            m.UndecidedSite(reasons.wire_near_cut(6.0), "operator", 1, 5, WHERE),
            m.UndecidedSite(reasons.nodes_lacking(0, 2), "another look", 1, 6, WHERE),
        ),
        controller=ready(),
    )


def opened(page: Page) -> Locator:
    """The sheet of the vine that is looked at, once its two sure cuts have been seen."""
    page.locator("#open-vine").click()
    return seen(page)


def seen(page: Page) -> Locator:
    sheet = page.locator("rp-vine-sheet")
    expect(sheet.get_by_role("group", name="Sure cuts").locator('.vine-card[data-seen="yes"]')).to_have_count(2)
    return sheet


def card(page: Page, key: str) -> Locator:
    return page.locator(f'.vine-card[data-key="{key}"]')


def asked(server: DecidingServer, action: str) -> dict[str, object]:
    """Bodies of the requests about points that end so, by point."""
    found = [(path.split("/")[-2], body) for path, body in server.posted if path.endswith(f"/{action}")]
    assert len({name for name, _ in found}) == len(found), "each once"
    return dict(found)


def shown(row: p.PagePoint) -> dict[str, object]:
    return {"revision": row.point.revision, "digest": row.point.digest}


def test_one_press_accepts_the_sure_cuts_as_they_are_shown_and_another_leaves_the_places(
    page: Page, server: DecidingServer
) -> None:
    looking_at(page, "p1")
    sheet = opened(page)
    expect(sheet.locator("h2")).to_have_text("Vine 1")
    expect(card(page, "p3")).to_have_count(0)
    expect(card(page, "p1").locator(".blade .core")).to_have_count(1)
    expect(card(page, "p1")).to_contain_text("Spur cut · keeps 2 buds")
    assert server.posted == []
    page.get_by_role("button", name="Accept 2 cuts").click()
    until(page, lambda: asked(server, "accept") == {row.point.point_id: shown(row) for row in server.points[:2]})
    expect(mark(page, "p2")).to_have_attribute("data-status", "accepted")
    expect(mark(page, "p2")).not_to_have_class("strip-mark sent")
    expect(card(page, "p1")).to_be_hidden()
    page.get_by_role("button", name="Leave 2 places").click()
    # Nothing is left for a press here: the unsure cut is decided by itself.
    looking_at(page, "p3")
    expect(sheet).to_be_hidden()
    left = [body for path, body in server.posted if path == "/api/sites/leave"]
    assert left == [{"vine": 1, "spur": spur, "left": True} for spur in (5, 6)]
    assert [server.state_of(name) for name in ("p3", "p4")] == ["PROPOSED", "PROPOSED"]


def test_a_removal_is_accepted_with_the_other_sure_cuts(page: Page, server: DecidingServer) -> None:
    server.put(removal(server.points[1]))
    looking_at(page, "p1")
    opened(page)
    expect(card(page, "p2")).to_contain_text("Removal · last year's cane")
    page.get_by_role("button", name="Accept 2 cuts").click()
    until(page, lambda: asked(server, "accept") == {row.point.point_id: shown(row) for row in server.points[:2]})


@pytest.mark.long
def test_all_is_taken_back_by_one_press_each_but_not_what_was_cut_since(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    opened(page)
    page.keyboard.press("r")
    expect(mark(page, "place-1-5")).to_have_attribute("data-status", "left")
    page.keyboard.press("a")
    looking_at(page, "p3")
    row = server.points[1]
    server.put(msgspec.structs.replace(row, entry=msgspec.structs.replace(row.entry, state="DONE")))
    expect(mark(page, "p2")).to_have_attribute("data-status", "done")
    page.keyboard.press("z")
    until(page, lambda: server.state_of("p1") == "PROPOSED")
    assert asked(server, "reconsider").keys() == {"p1"}
    page.keyboard.press("z")
    expect(mark(page, "place-1-5")).to_have_attribute("data-status", "decide")
    expect(mark(page, "place-1-6")).to_have_attribute("data-status", "decide")
    expect(page.locator("#undo")).to_be_disabled()


def test_what_is_accepted_can_be_taken_back_before_the_robot_tells_of_it(
    page: Page, server: DecidingServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    looking_at(page, "p1")
    opened(page)
    monkeypatch.setattr(server, "tell", lambda message: None)
    page.keyboard.press("a")
    until(page, lambda: [server.state_of(name) for name in ("p1", "p2")] == ["ACCEPTED"] * 2)
    page.keyboard.press("z")
    until(page, lambda: [server.state_of(name) for name in ("p1", "p2")] == ["PROPOSED"] * 2)


@pytest.mark.long
def test_what_is_taken_out_is_not_decided_about_and_comes_next(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    opened(page)
    card(page, "p1").click(position={"x": 120, "y": 100})
    expect(card(page, "p1")).to_have_attribute("data-out", "yes")
    card(page, "place-1-5").get_by_role("button", name="Take out").click()
    card(page, "p2").get_by_role("button", name="Take out").click()
    expect(page.locator("#vine-accept")).to_be_disabled()
    card(page, "p2").get_by_role("button", name="Put back").click()
    page.get_by_role("button", name="Accept 1 cut").click()
    page.get_by_role("button", name="Leave 1 place").click()
    looking_at(page, "p1")
    assert asked(server, "accept").keys() == {"p2"}
    assert [body["spur"] for path, body in server.posted if path == "/api/sites/leave"] == [6]


def test_a_cut_that_changes_in_between_is_seen_anew_or_refused_with_its_reason(
    page: Page, server: DecidingServer
) -> None:
    looking_at(page, "p1")
    opened(page)
    first, second = server.points[:2]
    moved = msgspec.structs.replace(first.point, revision=5, digest="ab" * 16)
    server.put(msgspec.structs.replace(first, point=moved))
    expect(card(page, "p1")).to_contain_text("This cut has changed: look again.")
    # The robot has another one already, and the page does not know yet.
    unknown = msgspec.structs.replace(second.point, digest="cd" * 16)
    server.points = (server.points[0], msgspec.structs.replace(second, point=unknown), *server.points[2:])
    expect(card(page, "p1")).to_have_attribute("data-seen", "yes")
    page.locator("#vine-accept").click()
    until(page, lambda: server.state_of("p1") == "ACCEPTED" and len(asked(server, "accept")) == 2)
    assert asked(server, "accept") == {"p1": {"revision": 5, "digest": "ab" * 16}, "p2": shown(second)}
    assert server.state_of("p2") == "PROPOSED"
    expect(page.locator(".toast")).to_contain_text("vine 1, spur 2 refused: it has changed since")
    # It is still here, with its new content, to be seen and accepted.
    server.tell(server.page_points())
    expect(card(page, "p2")).to_be_visible()
    expect(card(page, "p2")).to_have_attribute("data-seen", "yes")
    page.locator("#undo").evaluate("each => each.click()")
    until(page, lambda: server.state_of("p1") == "PROPOSED")
    assert asked(server, "reconsider").keys() == {"p1"}


@pytest.mark.long
def test_a_press_right_after_a_cut_has_changed_does_not_accept_it(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    opened(page)
    row = server.points[0]
    server.drawn_revisions["p1"] = 4
    server.put(msgspec.structs.replace(row, point=msgspec.structs.replace(row.point, revision=5, digest="ab" * 16)))
    expect(card(page, "p1")).to_contain_text("This cut has changed: look again.")
    page.wait_for_timeout(1000)
    expect(page.locator("#vine-accept")).to_have_text("Accept 1 cut")
    page.keyboard.press("a")
    until(page, lambda: asked(server, "accept").keys() == {"p2"})


@pytest.mark.long
def test_only_what_was_in_sight_is_accepted(page: Page, server: DecidingServer) -> None:
    server.undecided_sites = ()
    show(server, *(sure(number) for number in range(1, 21)))
    looking_at(page, "p1")
    page.keyboard.press("v")
    cards = page.locator(".vine-card")
    expect(cards).to_have_count(20)
    expect(page.locator('.vine-card[data-seen="yes"]').first).to_be_visible()
    page.wait_for_timeout(1000)
    first = page.locator('.vine-card[data-seen="yes"]').evaluate_all("all => all.map(each => each.dataset.key)")
    assert 0 < len(first) < 20
    expect(page.locator(".vine-head")).to_contain_text(f"{20 - len(first)} pictures not seen yet")
    page.keyboard.press("a")
    until(page, lambda: asked(server, "accept").keys() == {*first})
    # The others come into sight as those leave.
    while page.locator("rp-vine-sheet").is_visible():
        page.wait_for_timeout(900)
        page.keyboard.press("a")
    expect(page.locator("rp-vine-sheet")).to_be_hidden()
    assert asked(server, "accept").keys() == {row.point.point_id for row in server.points}


@pytest.mark.long
def test_a_cut_without_a_picture_is_not_accepted_with_the_others(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    server.crop = b""
    page.reload()
    page.locator("#open-vine").click()
    expect(card(page, "p2")).to_contain_text("No picture shows this place")
    page.wait_for_timeout(1000)
    expect(page.locator("#vine-accept")).to_be_disabled()
    page.keyboard.press("a")
    page.keyboard.press("Escape")
    expect(page.locator("rp-vine-sheet")).to_be_hidden()
    assert server.posted == []


def test_keys_and_the_large_picture(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    page.keyboard.press("v")
    seen(page)
    expect(page.locator("rp-vine-sheet h2")).to_be_focused()
    card(page, "p2").get_by_role("button", name="Show").press("Enter")
    looking_at(page, "p2")
    expect(page.locator("#open-vine")).to_be_focused()
    page.keyboard.press("v")
    seen(page)
    page.keyboard.press("Escape")
    expect(page.locator("rp-vine-sheet")).to_be_hidden()
    assert server.posted == []
    # The next vine comes when nothing of this one is left.
    page.keyboard.press("v")
    seen(page)
    page.keyboard.press("a")
    page.keyboard.press("r")
    looking_at(page, "p3")
    page.keyboard.press("v")
    expect(page.locator("rp-vine-sheet h2")).to_have_text("Vine 2")


@pytest.mark.long
def test_a_viewer_sees_the_vine_and_decides_nothing(page: Page, server: DecidingServer) -> None:
    server.role = "viewer"
    page.reload()
    looking_at(page, "p1")
    opened(page)
    for button in ("#vine-accept", "#vine-leave"):
        expect(page.locator(button)).to_be_disabled()
        page.locator(button).click(force=True)
    page.keyboard.press("a")
    page.keyboard.press("r")
    page.wait_for_timeout(300)
    assert server.posted == []


@pytest.fixture
def touched(browser: Browser, server: DecidingServer) -> Iterator[Page]:
    """The page on a telephone."""
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True, locale="en-US")
    context.add_init_script("localStorage.setItem('setting.hints', 'seen')")
    page = context.new_page()
    server.attach(page)
    page.goto(f"{ORIGIN}/#review")
    yield page
    context.close()


@pytest.mark.long
def test_fingers_do_the_same_on_a_telephone(touched: Page, server: DecidingServer) -> None:
    page = touched
    looking_at(page, "p1")
    page.locator("#open-vine").tap()
    expect(card(page, "p1")).to_have_attribute("data-seen", "yes")
    card(page, "p1").tap(position={"x": 120, "y": 100})
    expect(card(page, "p1")).to_have_attribute("data-out", "yes")
    card(page, "p2").evaluate("each => each.scrollIntoView({ block: 'center' })")
    expect(card(page, "p2")).to_have_attribute("data-seen", "yes")
    page.locator("#vine-accept").tap()
    until(page, lambda: asked(server, "accept").keys() == {"p2"})
