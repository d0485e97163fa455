"""The screen for decisions: one picture at a time, a press a decision."""

import time

import msgspec
import pytest
from playwright.sync_api import Page, Route, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages import page as p
from rolling_panda.messages.supervision import PointPlan
from rolling_panda.messages.types import CutKind
from rolling_panda.reasons import text_of
from server.api.responses import outcome
from tests.support.deciding_server import DecidingServer
from tests.support.drawings import CUT, METRES, SHOOTS, SIZE
from tests.support.page_parts import looking_at, mark, of_kind, ready, removal, show
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer, point
from tests.support.points import rolled_out

pytestmark = pytest.mark.browser
#: A person looks at least for so long (ms).
LOOK_MS = 260
WHERE = (1.4, 0.8, 0.9)


@pytest.fixture
def screen() -> str:
    return "review"


@pytest.fixture
def server() -> DecidingServer:
    return DecidingServer(
        points=(
            point(1, "PROPOSED"),
            point(2, "ACCEPTED", user="Ada"),
            point(3, "PROPOSED", spur=2),
            point(4, "PROPOSED", vine=2),
        ),
        undecided_sites=(
            m.UndecidedSite(reasons.wire_near_cut(6.0), "operator", 1, 4, WHERE),
            m.UndecidedSite(reasons.other_cane_left(reasons.stub_unclear()), "operator", 1, 4, WHERE),
            m.UndecidedSite(reasons.nodes_lacking(0, 2), "another look", 1, 3, WHERE),
        ),
        controller=ready(),
    )


def seen(number: int) -> dict[str, object]:
    return {"revision": 4, "digest": f"{number:08x}" * 4}


def became(row: p.PagePoint, state: m.PointState) -> p.PagePoint:
    return msgspec.structs.replace(row, entry=msgspec.structs.replace(row.entry, state=state))


# --- the picture -----------------------------------------------------------------------------------------------------


def test_the_first_cut_to_decide_is_pictured_with_what_falls_and_what_stays(page: Page, server: DecidingServer) -> None:
    review = looking_at(page, "p1")
    expect(review.locator(".review-count")).to_have_text("1 of 6")
    expect(review.locator("h2")).to_have_text("Vine 1 · spur 1")
    expect(review.locator(".review-keeps")).to_have_text("Spur cut · keeps 2 buds · sure")
    expect(review.locator(".review-why")).to_contain_text("20 mm past bud 2")
    picture = review.locator("rp-cut-picture")
    assert box_of(picture)["width"] >= 320 and box_of(picture)["height"] >= 240
    # The cane goes up: what is above the cut falls, the two nodes below it stay.
    blade = box_of(picture.locator(".blade .tips"))
    falls, stays = (picture.locator(part).bounding_box() for part in (".falls path", ".stays"))
    assert falls is not None and stays is not None
    assert falls["y"] + falls["height"] == pytest.approx(stays["y"], abs=20.0)
    assert blade["y"] < stays["y"] < blade["y"] + blade["height"]
    expect(picture.locator(".nodes circle")).to_have_count(2)
    expect(picture.locator(".others path")).to_have_count(0)
    assert "/api/points/p1/drawing" in server.pictures_fetched
    # Points of a spur share an image, which is fetched once.
    assert sum(path.endswith("picture?image=00010001") for path in server.pictures_fetched) == 1


def test_the_picture_zooms_by_wheel_and_buttons_and_the_next_one_is_whole(page: Page, server: DecidingServer) -> None:
    review = looking_at(page, "p1")
    drawing = page.locator("rp-review rp-cut-picture .outside")
    assert drawing.get_attribute("viewBox") == f"0.00 0.00 {SIZE[0]:.2f} {SIZE[1]:.2f}"
    before = box_of(review.locator(".blade .tips"))
    review.get_by_role("button", name="Zoom in").click()
    after = box_of(review.locator(".blade .tips"))
    assert after["height"] + after["width"] > 1.2 * (before["height"] + before["width"])
    box = box_of(drawing)
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.wheel(0, 900)
    expect(drawing).to_have_attribute("viewBox", f"0.00 0.00 {SIZE[0]:.2f} {SIZE[1]:.2f}")
    page.keyboard.press("+")
    assert drawing.get_attribute("viewBox") != f"0.00 0.00 {SIZE[0]:.2f} {SIZE[1]:.2f}"
    page.keyboard.press("a")
    looking_at(page, "p3")
    expect(drawing).to_have_attribute("viewBox", f"0.00 0.00 {SIZE[0]:.2f} {SIZE[1]:.2f}")


def test_two_fingers_zoom_the_picture(page: Page, server: DecidingServer) -> None:
    review = looking_at(page, "p1")
    drawing = review.locator("rp-cut-picture .outside")
    box = box_of(drawing)
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 4
    client = page.context.new_cdp_session(page)

    def touch(kind: str, apart: float | None) -> None:
        points = (
            []
            if apart is None
            else [{"x": middle[0] + side * apart, "y": middle[1], "id": side + 1} for side in (-1, 1)]
        )
        client.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", 40.0)
    for apart in (60.0, 90.0, 120.0):
        touch("touchMove", apart)
    touch("touchEnd", None)
    width = float(str(drawing.get_attribute("viewBox")).split()[2])
    assert SIZE[0] / 3.6 < width < SIZE[0] / 2.4
    assert server.posted == []


def test_a_picture_that_is_missing_is_told_asked_for_again_and_keeps_nobody_from_deciding(
    page: Page, server: DecidingServer
) -> None:
    looking_at(page, "p1")
    crop, server.crop = server.crop, b""
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    review = page.locator('rp-review[data-key="p3"]')
    expect(review.locator(".picture-words")).to_contain_text("No picture shows this place")
    page.wait_for_timeout(LOOK_MS)
    page.keyboard.press("r")
    until(page, lambda: server.state_of("p3") == "REJECTED")
    page.keyboard.press("ArrowLeft")
    server.crop = crop
    mark(page, "p3").click()
    looking_at(page, "p3")


@pytest.mark.long
def test_a_picture_of_an_older_cut_shows_no_cut(page: Page, server: DecidingServer) -> None:
    server.drawn_revisions["p3"] = 3
    looking_at(page, "p1")
    mark(page, "p3").click()
    review = page.locator('rp-review[data-key="p3"][data-pictured="older"]')
    expect(review.locator(".review-why")).to_contain_text("does not show the newest cut yet")
    expect(review.locator(".blade path")).to_have_count(0)
    server.drawn_revisions.clear()
    looking_at(page, "p3")
    expect(page.locator("rp-review .blade .core")).to_have_count(1)


# --- deciding --------------------------------------------------------------------------------------------------------


def test_a_press_decides_and_the_next_one_to_decide_comes_by_itself(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    page.locator("#review-accept").click()
    until(page, lambda: server.posted == [("/api/points/p1/accept", seen(1))])
    review = looking_at(page, "p3")
    expect(mark(page, "p1")).to_have_attribute("data-status", "accepted")
    page.locator("#review-leave").click()
    until(page, lambda: server.posted[-1] == ("/api/points/p3/reject", {"reason": ""}))
    # A place to decide about stands where it is along the row; one that another look may settle comes last.
    looking_at(page, "place-1-4")
    page.keyboard.press("r")
    looking_at(page, "p4")
    page.keyboard.press("a")
    looking_at(page, "place-1-3")
    expect(review.locator(".review-done")).to_have_count(0)
    page.keyboard.press("r")
    expect(page.locator(".review-done")).to_have_text("All is decided: 3 to cut, 3 to leave.")
    left = [body for path, body in server.posted if path == "/api/sites/leave"]
    assert left == [{"vine": 1, "spur": spur, "left": True} for spur in (4, 3)]


def test_why_it_was_left_can_be_said_and_need_not(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    page.keyboard.press("r")
    expect(page.locator(".review-reasons")).to_contain_text("Left: vine 1, spur 1. Why?")
    looking_at(page, "p3")
    page.get_by_role("button", name="wrong cane").click()
    until(page, lambda: server.posted[-1] == ("/api/points/p1/reject", {"reason": "wrong cane"}))
    expect(page.locator(".review-reasons")).to_be_hidden()
    page.keyboard.press("r")
    page.locator("#reject-reason").fill("a tie is there")
    assert server.stops() == []
    page.keyboard.press("Enter")
    until(page, lambda: server.posted[-1] == ("/api/points/p3/reject", {"reason": "a tie is there"}))
    looking_at(page, "place-1-4")
    assert len(server.posted) == 4


@pytest.mark.long
def test_everything_is_undone_step_by_step_and_is_looked_at_again(page: Page, server: DecidingServer) -> None:
    expect(page.locator("#undo")).to_be_disabled()
    looking_at(page, "p1")
    page.keyboard.press("a")
    looking_at(page, "p3")
    page.keyboard.press("r")
    looking_at(page, "place-1-4")
    page.keyboard.press("r")
    looking_at(page, "p4")
    page.keyboard.press("z")
    looking_at(page, "place-1-4")
    expect(mark(page, "place-1-4")).to_have_attribute("data-status", "decide")
    page.locator("#undo").click()
    looking_at(page, "p3")
    assert server.state_of("p3") == "PROPOSED"
    expect(page.locator(".review-reasons")).to_be_hidden()
    page.keyboard.press("z")
    looking_at(page, "p1")
    assert server.state_of("p1") == "PROPOSED"
    expect(page.locator("#undo")).to_be_disabled()


def test_an_undo_before_the_answer_takes_back_that_decision_and_none_before_it(
    page: Page, server: DecidingServer
) -> None:
    looking_at(page, "p1")
    page.keyboard.press("a")
    looking_at(page, "p3")
    until(page, lambda: server.state_of("p1") == "ACCEPTED")
    held: list[Route] = []
    page.route("**/api/points/p3/accept", lambda route: held.append(route), times=1)
    page.keyboard.press("a")
    until(page, lambda: len(held) == 1)
    page.keyboard.press("z")
    held[0].continue_()
    until(page, lambda: server.posted[-1][0] == "/api/points/p3/reconsider")
    assert [server.state_of(name) for name in ("p1", "p3")] == ["ACCEPTED", "PROPOSED"]


def test_what_was_decided_before_a_cut_is_not_offered_to_undo(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    page.keyboard.press("a")
    looking_at(page, "p3")
    expect(page.locator("#undo")).to_be_enabled()
    row = server.points[0]
    server.put(msgspec.structs.replace(row, entry=msgspec.structs.replace(row.entry, state="FAILED_NOT_CUT")))
    expect(page.locator("#undo")).to_be_disabled()
    page.keyboard.press("r")
    looking_at(page, "place-1-4")
    page.locator("#undo").click()
    looking_at(page, "p3")
    assert server.posted[-1][0] == "/api/points/p3/reconsider"


def test_a_cut_that_changes_while_one_looks_at_it_is_told_and_waits_for_another_look(
    page: Page, server: DecidingServer
) -> None:
    looking_at(page, "p1")
    row = server.points[0]
    x, y, z = row.point.position
    changed = msgspec.structs.replace(row.point, revision=5, digest="ab" * 16, position=(x, y, z + 0.006), nodes_kept=3)
    server.put(msgspec.structs.replace(row, point=changed))
    expect(page.locator(".review-changed")).to_have_text(
        "This cut has changed: look again. It moved by 6 mm. It keeps 3 buds instead of 2."
    )
    page.keyboard.press("a")
    assert server.posted == [], "a press at that moment was meant for the cut before"
    expect(page.locator("#review-accept")).to_be_enabled()
    looking_at(page, "p1")
    page.keyboard.press("a")
    until(page, lambda: server.posted == [("/api/points/p1/accept", {"revision": 5, "digest": "ab" * 16})])


def test_a_refused_decision_is_told_and_nothing_jumps_under_the_next_press(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    # The robot has another one already, and the page does not know yet.
    row = server.points[0]
    server.points = (
        msgspec.structs.replace(row, point=msgspec.structs.replace(row.point, digest="cd" * 16)),
        *server.points[1:],
    )
    page.keyboard.press("a")
    review = looking_at(page, "p3")
    expect(page.locator(".toast")).to_contain_text("it has changed since")
    expect(review.locator(".review-refusals")).to_contain_text("Vine 1 · spur 1: the decision was refused.")
    expect(page.locator("#undo")).to_be_disabled()
    review.get_by_role("button", name="Show").click()
    looking_at(page, "p1")
    expect(page.locator(".review-refusals")).to_be_empty()


@pytest.mark.long
def test_a_point_that_vanishes_while_one_looks_at_it_cannot_be_decided(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    server.points = server.points[1:]
    server.tell(server.page_points())
    expect(page.locator(".review-state")).to_contain_text("This point is gone")
    page.keyboard.press("a")
    expect(page.locator(".toast")).to_contain_text("This point is gone")
    assert server.posted == []
    # It can be read for a while; then the next to decide comes by itself.
    looking_at(page, "p3")


def test_what_another_person_decides_is_shown_and_not_asked_again(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    server.put(became(server.points[2], "REJECTED"))
    expect(mark(page, "p3")).to_have_attribute("data-status", "left")
    page.keyboard.press("a")
    looking_at(page, "place-1-4")


def test_a_held_key_and_a_second_press_at_once_decide_once(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    # In one go, since a loaded machine takes longer from press to press than a person.
    page.evaluate(
        "() => [false, true, true, false].forEach("
        "repeat => document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 'a', repeat, bubbles: true })))"
    )
    looking_at(page, "p3")
    assert server.posted == [("/api/points/p1/accept", seen(1))]


def test_a_cut_of_unknown_outcome_is_answered_by_who_has_looked(page: Page, server: DecidingServer) -> None:
    show(server, point(1, "UNKNOWN", cut_id="c1"), point(2, "UNKNOWN", spur=2, cut_id="c2"))
    looking_at(page, "p1")
    expect(page.locator(".review-keeps")).to_have_text("Look at the vine: is this cane cut?")
    expect(page.locator("#review-accept")).to_have_text("It is cut")
    page.locator("#review-accept").click()
    until(page, lambda: server.posted == [("/api/points/p1/resolve", {"outcome": "DONE", "reason": "seen by eye"})])
    looking_at(page, "p2")
    page.locator("#review-leave").click()
    until(page, lambda: len(server.posted) == 2)
    assert server.posted[1] == ("/api/points/p2/resolve", {"outcome": "FAILED_NOT_CUT", "reason": "seen by eye"})
    expect(page.locator(".review-reasons")).to_be_hidden()


@pytest.mark.long
@pytest.mark.alone  # It is about time: how long the page keeps a person waiting.
def test_thirty_four_cuts_take_thirty_four_presses_and_forty_seconds_at_a_second_each(
    page: Page, server: DecidingServer
) -> None:
    server.undecided_sites = ()
    show(server, *(point(number, "PROPOSED", vine=1 + number // 9, spur=1 + number % 9) for number in range(1, 35)))
    expect(page.locator(".strip-mark")).to_have_count(34)
    looking_at(page, "p1")
    waited = 0.0
    for press in range(34):
        key = page.locator("rp-review").get_attribute("data-key")
        page.keyboard.press("r" if press % 5 == 4 else "a")
        began = time.perf_counter()
        if press < 33:
            page.wait_for_selector(f'rp-review:not([data-key="{key}"])[data-pictured="shown"]')
        waited += time.perf_counter() - began
        page.wait_for_timeout(LOOK_MS)
    until(page, lambda: all(row.entry.state != "PROPOSED" for row in server.points))
    assert len(server.posted) == 34
    print(f"34 presses for 34 cuts; the page kept its person waiting for {waited:.1f} s in all")
    assert waited < 6.0


# --- places ----------------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_place_to_decide_has_its_picture_its_reasons_and_a_cut_where_it_is_tapped(
    page: Page, server: DecidingServer
) -> None:
    server.answers["/api/points/by-hand-in-image"] = (200, outcome(True, reasons.point_placed("p9")))
    looking_at(page, "p1")
    mark(page, "place-1-4").click()
    review = looking_at(page, "place-1-4")
    assert any(path.startswith("/api/spurs/1/4/picture") for path in server.pictures_fetched)
    expect(review.locator(".review-why p")).to_have_count(2)
    expect(review.locator(".review-why")).to_contain_text(text_of(reasons.wire_near_cut(6.0)))
    expect(page.locator("#review-accept")).to_be_hidden()
    inside = box_of(review.locator("rp-cut-picture image"))
    page.mouse.click(inside["x"] + 0.5 * inside["width"], inside["y"] + 0.25 * inside["height"])
    until(page, lambda: bool(server.posted))
    path, body = server.posted[0]
    assert path == "/api/points/by-hand-in-image" and body["sequence"] == 7
    assert body["u"] == pytest.approx((300 + 120) / 848, abs=0.003)
    assert body["v"] == pytest.approx((100 + 45) / 480, abs=0.004)
    # The new point is looked at when it comes, and is decided about as any other.
    assert page.locator("rp-review").get_attribute("data-key") == "place-1-4"
    server.points = (*server.points, point(9, "PROPOSED", spur=4))
    server.tell(server.page_points())
    looking_at(page, "p9")
    page.keyboard.press("z")
    until(page, lambda: server.state_of("p9") == "REJECTED")


def test_another_look_is_asked_for_at_a_place(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    mark(page, "place-1-3").click()
    looking_at(page, "place-1-3")
    page.keyboard.press("l")
    until(page, lambda: server.posted == [("/api/look-again", {"vine": 1, "spur": 3})])


def test_a_place_that_cannot_be_left_is_told_and_is_still_to_be_decided(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    mark(page, "place-1-4").click()
    looking_at(page, "place-1-4")
    server.gone = {"perception": 5.0}
    expect(page.locator("#review-leave")).to_be_disabled()
    page.keyboard.press("r")
    expect(page.locator(".toast")).to_contain_text("perception")
    expect(mark(page, "place-1-4")).to_have_attribute("data-status", "decide")
    assert server.posted == []


def test_a_place_that_was_left_is_to_be_decided_again_when_another_matter_comes_up_there(
    page: Page, server: DecidingServer
) -> None:
    looking_at(page, "p1")
    mark(page, "place-1-4").click()
    looking_at(page, "place-1-4")
    page.keyboard.press("r")
    expect(mark(page, "place-1-4")).to_have_attribute("data-status", "left")
    # On another device, or after a reload, it is left too.
    page.reload()
    expect(mark(page, "place-1-4")).to_have_attribute("data-status", "left")
    server.undecided_sites = (m.UndecidedSite(reasons.cane_crosses_cut(), "operator", 1, 4, WHERE),)
    server.tell(server.page_points())
    expect(mark(page, "place-1-4")).to_have_attribute("data-status", "decide")


# --- adjusting -------------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_cut_is_dragged_along_its_cane_and_put_back_where_that_is_refused(page: Page, server: DecidingServer) -> None:
    review = looking_at(page, "p1")
    before = box_of(review.locator(".blade .tips"))
    inside = box_of(review.locator("rp-cut-picture image"))
    scale = inside["height"] / SIZE[1]
    x, y = inside["x"] + 120.0 * scale, inside["y"] + CUT * scale

    def drag(pixels: float) -> None:
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 20, y - pixels * scale / 2)
        page.mouse.move(x + 30, y - pixels * scale)

    drag(6)
    expect(page.locator("rp-review .picture-moved")).to_have_text(f"+{1000 * 6 * METRES:.0f} mm")
    page.mouse.up()
    until(page, lambda: server.posted == [("/api/points/p1/move", {"along": 0.012})])
    # Where no other cut comes of it, the old one is shown again.
    expect(page.locator("rp-review .picture-moved")).to_be_hidden()
    page.locator("#undo").click()
    until(page, lambda: server.posted[-1] == ("/api/points/p1/move", {"along": -0.012}))
    server.answers["/api/points/p1/move"] = (409, {"ok": False, "reason": "4 mm from a bud: the blades need 10 mm"})
    drag(-4)
    page.mouse.up()
    expect(page.locator(".toast").last).to_contain_text("4 mm from a bud")
    expect(page.locator("rp-review .picture-moved")).to_be_hidden()
    assert box_of(review.locator(".blade .tips"))["y"] == pytest.approx(before["y"], abs=1.0)
    assert server.state_of("p1") == "PROPOSED" and len(server.posted) == 3


def test_a_point_is_moved_by_millimetres_and_an_accepted_one_is_not(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    page.locator(".adjust summary").click()
    page.get_by_role("button", name="+5").click()
    until(page, lambda: ("/api/points/p1/move", {"along": 0.005}) in server.posted)
    page.locator("#undo").click()
    until(page, lambda: ("/api/points/p1/move", {"along": -0.005}) in server.posted)
    for words in ("Spur cut, 20 mm past bud 2", "8.0 mm, ≈ 470 N", "± 3.0 mm, ± 2°", "wire 141 · cordon 62"):
        expect(page.locator("rp-adjust")).to_contain_text(words)
    mark(page, "p2").click()
    looking_at(page, "p2")
    expect(page.get_by_role("button", name="+1")).to_have_attribute(
        "title", text_of(reasons.acceptance_stands("Vine 1, spur 1"))
    )
    expect(page.locator("rp-review .handle")).to_have_attribute("visibility", "hidden")


@pytest.mark.parametrize(
    ("kind", "why"), [("renewal cut", reasons.renewal_cut_fixed()), ("removal", reasons.removal_fixed())]
)
def test_a_renewal_cut_and_a_removal_are_not_moved_and_say_why(
    page: Page, server: DecidingServer, kind: CutKind, why: m.Reason
) -> None:
    row = server.points[0]
    server.put(removal(row) if kind == "removal" else of_kind(row, kind, reasons.renewal_cut(1)))
    looking_at(page, "p1")
    page.locator(".adjust summary").click()
    for step in ("−5", "−1", "+1", "+5"):
        button = page.get_by_role("button", name=step)
        expect(button).to_be_disabled()
        expect(button).to_have_attribute("title", text_of(why))
    expect(page.locator("rp-review .handle")).to_have_attribute("visibility", "hidden")
    page.get_by_role("button", name="+1").click(force=True)
    assert server.posted == []


def test_a_removal_names_last_years_cane_and_counts_no_buds(page: Page, server: DecidingServer) -> None:
    server.put(removal(server.points[0]))
    review = looking_at(page, "p1")
    expect(review.locator(".review-keeps")).to_have_text("Removal · last year's cane · sure")
    picture = review.locator("rp-cut-picture")
    # The wood that lies falls beyond the cut, with the shoots on it.
    expect(picture.locator(".falls path")).to_have_count(1 + len(SHOOTS))
    expect(picture.locator(".nodes circle")).to_have_count(0)
    facts = page.locator("rp-adjust dl")
    page.locator(".adjust summary").click()
    expect(facts.locator("div:visible dt")).to_have_text(["Cut", "Sure", "Cane", "Place", "Clear of"])
    expect(facts.locator("dd").first).to_have_text("Removal")
    # Another cut tells of its buds again.
    mark(page, "p3").click()
    looking_at(page, "p3")
    expect(facts).to_contain_text("2 of 9 buds")


@pytest.mark.parametrize(("language", "width"), [("de", 1024), ("es", 390)])
def test_the_words_beside_the_approach_leave_each_other_room(
    page: Page, server: DecidingServer, language: str, width: int
) -> None:
    page.evaluate("language => localStorage.setItem('setting.language', language)", language)
    page.set_viewport_size({"width": width, "height": 800})
    page.reload()
    looking_at(page, "p1")
    page.locator(".adjust summary").click()
    row = page.locator("rp-adjust .approach > :not(input)")
    expect(row).to_have_count(3)
    boxes = [box_of(row.nth(k)) for k in range(3)]
    # The words, not only their boxes, end where they should.
    assert row.evaluate_all("all => all.filter(each => each.scrollWidth > each.clientWidth + 1).length") == 0
    for k, one in enumerate(boxes):
        for other in boxes[k + 1 :]:
            beside = one["x"] + one["width"] <= other["x"] or other["x"] + other["width"] <= one["x"]
            below = one["y"] + one["height"] <= other["y"] or other["y"] + other["height"] <= one["y"]
            assert beside or below


def test_where_the_robot_would_stand_is_told(page: Page, server: DecidingServer) -> None:
    row = server.points[1]
    base = m.PlanarPose(x=row.point.position[0] - 0.3, y=row.point.position[1] - 0.9, phi=0.0)
    plan = PointPlan(point_id="p2", revision=4, order=2, base=base, rollout=rolled_out("p2", 4))
    server.put(msgspec.structs.replace(row, plan=plan))
    looking_at(page, "p1")
    expect(page.locator(".review-robot")).to_be_empty()
    mark(page, "p2").click()
    expect(page.locator(".review-robot")).to_have_text(
        "The robot stands 0.9 m from it, with the row on its left and the cut 0.3 m ahead. "
        "Cut no. 2 of the work: 5.0 s, 60 mm between link 5 and camera."
    )


# --- the strip -------------------------------------------------------------------------------------------------------


def test_the_strip_shows_every_state_by_shape_and_a_press_looks_at_one(page: Page, server: PlayedServer) -> None:
    states: tuple[m.PointState, ...] = (
        "PROPOSED", "ACCEPTED", "CUTTING", "UNREACHABLE", "DONE", "FAILED_NOT_CUT", "UNKNOWN", "REJECTED",
    )  # fmt: skip
    show(server, *(point(number, state, spur=number) for number, state in enumerate(states, 1)))
    shapes = page.locator('.strip-mark[data-key^="p"]:not([data-key^="place"])')
    expect(shapes).to_have_count(8)
    statuses = [shapes.nth(k).get_attribute("data-status") for k in range(8)]
    assert statuses == ["proposed", "accepted", "accepted", "unreachable", "done", "decide", "decide", "left"]
    drawn = {shapes.nth(k).locator(".body").get_attribute("d") for k in range(8)}
    assert len(drawn) == 6, "each has a shape of its own"
    mark(page, "p5").click()
    looking_at(page, "p5")
    until(page, lambda: p.Select(point_id="p5") in server.said)
    expect(mark(page, "p5")).to_have_attribute("aria-current", "true")


def test_a_point_chosen_in_the_view_is_looked_at(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    server.tell(p.Selected(point_id="p4"))
    looking_at(page, "p4")


def test_the_work_takes_no_picture_away_from_who_decides(page: Page, server: DecidingServer) -> None:
    looking_at(page, "p1")
    server.controller = msgspec.structs.replace(ready(), mode="AUTO", active_point_id="p2")
    expect(mark(page, "p2")).to_have_class("strip-mark active")
    page.wait_for_timeout(500)
    expect(page.locator("rp-review")).to_have_attribute("data-key", "p1")


@pytest.mark.long
@pytest.mark.alone  # It is about time: how long the page keeps a person waiting.
def test_two_thousand_points_are_walked_through_without_a_standstill(page: Page, server: DecidingServer) -> None:
    rows = (point(number, "PROPOSED", vine=1 + number // 20, spur=1 + number // 2 % 10) for number in range(1, 2001))
    show(server, *(msgspec.structs.replace(row, pixel=None) for row in rows))
    expect(page.locator('.strip-mark[data-key^="p"]:not([data-key^="place"])')).to_have_count(2000, timeout=20_000)
    page.evaluate(
        "() => { window.longest = 0; new PerformanceObserver((list) => { for (const each of list.getEntries())"
        " window.longest = Math.max(window.longest, each.duration); }).observe({ type: 'longtask' }); }"
    )
    for _ in range(6):
        page.keyboard.press("ArrowRight")
        page.wait_for_timeout(100)
    walking = page.evaluate("window.longest")
    page.evaluate("() => { window.longest = 0; }")
    for state in ("ACCEPTED", "REJECTED", "PROPOSED"):
        server.put(became(server.points[1000], state))  # type: ignore[arg-type]
        page.wait_for_timeout(400)
    changing = page.evaluate("window.longest")
    print(f"2,000 points: longest task {walking:.0f} ms while walking, {changing:.0f} ms while a point changes")
    assert walking < 400
    assert changing < 1000
