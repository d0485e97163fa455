"""The screen with the session's report: pictures of cuts, sums, filters, what is left, paper."""

import re
import time
from itertools import pairwise

import msgspec
import pytest
from playwright.sync_api import Page, expect

from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.messages.supervision import CutReport, RefusalReport, SessionReport, VineReport
from tests.support.page_parts import open_screen
from tests.support.page_states import a_timeline
from tests.support.played_page import box_of, until
from tests.support.played_server import PlayedServer, cut_picture, point

pytestmark = pytest.mark.browser


def cut(number: int, outcome: m.Outcome = "DONE", vine: int = 1, **changes: object) -> CutReport:
    usual = CutReport(
        cut_id=f"c{number}", point_id=f"p{number}", vine=vine, spur=number, outcome=outcome, user="Ada",
        ended_at=1.8e9 + number, seconds=4.0,
    )  # fmt: skip
    return msgspec.structs.replace(usual, **changes)


def report(*cuts: CutReport) -> SessionReport:
    vines = sorted({each.vine for each in cuts})
    return SessionReport(
        began_at=1.8e9,
        written_at=1.8e9 + 4000.0,
        cuts=cuts,
        cut_count=len(cuts),
        vines=tuple(
            VineReport(
                vine=vine,
                done=sum(each.outcome == "DONE" for each in cuts if each.vine == vine),
                unknown=sum(each.outcome == "UNKNOWN" for each in cuts if each.vine == vine),
                seconds=sum(each.seconds for each in cuts if each.vine == vine),
            )
            for vine in vines
        ),
        refusals=(RefusalReport(at=1.8e9, user="Bob", asked="Start", reason=reasons.control_held("Ada")),),
        refusal_count=1,
    )


def sum_of(page: Page, name: str) -> str:
    return page.locator(f'rp-report [data-sum="{name}"] dd').inner_text()


def test_without_a_cut_it_says_so_everywhere(page: Page, server: PlayedServer) -> None:
    server.points, server.undecided_sites = (), ()
    server.tell(server.page_points())
    open_screen(page, "report")
    told = page.locator("rp-report")
    for words in ("Nothing has been cut yet.", "Nothing is left for a person.", "Nothing was refused.", "No vine has"):
        expect(told).to_contain_text(words)
    assert sum_of(page, "vines_an_hour") == "–" and sum_of(page, "mean") == "–"
    assert server.cut_pictures_fetched == []


@pytest.mark.long
def test_a_session_lasts_until_now_and_one_that_has_ended_until_its_last_record(
    page: Page, server: PlayedServer
) -> None:
    now = time.time()
    server.report = SessionReport(began_at=now - 7210.0, written_at=now - 3600.0)
    open_screen(page, "report")
    duration = page.locator('rp-report [data-sum="duration"] dd')
    expect(duration).to_have_text("2\u00a0h 0\u00a0min")
    server.gone = {"controller": 5.0}
    expect(duration).to_have_text("1\u00a0h 0\u00a0min", timeout=8000)


def test_nothing_of_the_view_behind_shows_through(page: Page, server: PlayedServer) -> None:
    server.points = tuple(msgspec.structs.replace(each, cane_angle=0.1) for each in server.points)
    server.tell(server.page_points())
    blades = page.locator("rp-camera .mark path.ring").first
    expect(blades).to_be_visible()
    open_screen(page, "report")
    expect(blades).to_be_hidden()


@pytest.mark.long
def test_a_cut_has_its_pictures_and_says_where_one_is_missing(page: Page, server: PlayedServer) -> None:
    server.report = report(cut(1), cut(2, "UNKNOWN"), cut(3, "", ended_at=0.0), cut(4, "FAILED_NOT_CUT", cut_id=""))
    server.cut_pictures = {("c1", "before"): cut_picture(False), ("c1", "after"): cut_picture(True)}
    server.cut_pictures["c2", "before"] = cut_picture(False)
    # A file that was cut short, as a server that does not notice would give it.
    server.cut_pictures["c2", "after"] = b"\xff\xd8\xff"
    server.cut_pictures["c3", "before"] = cut_picture(False)
    open_screen(page, "report")

    def card(name: str):
        return page.locator(f'.cut-card[data-point="{name}"]')

    expect(card("p1").get_by_role("img", name="Vine 1 · spur 1: Before")).to_have_js_property("naturalWidth", 320)
    expect(card("p1").get_by_role("img", name="Vine 1 · spur 1: After")).to_have_js_property("naturalWidth", 320)
    expect(card("p2").locator(".no-picture")).to_have_text("No picture: none was taken, or it was not kept")
    expect(card("p3").locator(".no-picture")).to_have_text("Not cut yet")
    expect(card("p4").locator(".no-picture").first).to_have_text("No picture: it was given up before the cut")
    assert ("c3", "after") not in server.cut_pictures_fetched
    expect(page.locator(".cut-card h4").first).to_have_text("Vine 1 · spur 4")
    # The picture after the cut that is being made comes with its outcome.
    server.cut_pictures["c3", "after"] = cut_picture(True)
    server.report = report(cut(1), cut(3))
    expect(card("p3").get_by_role("img", name="After")).to_have_js_property("naturalWidth", 320, timeout=8000)
    expect(card("p2")).to_have_count(0)


def test_it_sums_up_and_tells_who_accepted_what_was_refused_and_what_is_left(page: Page, server: PlayedServer) -> None:
    server.points = (
        point(1, "DONE", cut_id="c1"),
        point(2, "UNKNOWN", spur=2, reason=reasons.interrupted()),
        point(4, "DONE", spur=4, cut_id="c4", reason=reasons.cut_and_hangs(21.0)),
        point(3, "UNREACHABLE", spur=3, user="Ada", reason=reasons.control_held("Ada")),
        point(5, "PROPOSED", vine=2, spur=5),
    )
    server.tell(server.page_points())
    server.report = report(
        cut(1), cut(2, "UNKNOWN"), cut(3, vine=2, user="Bob", seconds=7.0), cut(4, vine=2, wrong_by="Eve")
    )
    open_screen(page, "report")
    expect(page.locator(".cut-card")).to_have_count(4)
    # Vine 1 is done with, and of vine 2 two cuts of three: 1.67 vines in 19 s.
    assert sum_of(page, "vines_an_hour") == f"{(1 + 2 / 3) / (19 / 3600):.1f}"
    assert [sum_of(page, name) for name in ("done", "unknown", "called_wrong", "mean", "refused")] == [
        "3", "1", "1", "4.8", "1",
    ]  # fmt: skip
    assert sum_of(page, "user") == "Ada, Bob"
    assert "2027" in sum_of(page, "date")
    expect(page.locator(".left-over li")).to_have_text(
        [
            "Vine 1 · spur 4: cut, but it hangs: pull it out",
            re.compile(r"Vine 1\s· spur 2: look whether it was cut – "),
            re.compile(r"Vine 1\s· spur 3: out of the robot's reach – "),
            "Vine 2 · spur 5: no decision yet",
            re.compile(r"Vine 1\s· spur 3: decide by eye – "),
            re.compile(r"Vine 1\s· spur 4: decide by eye – "),
        ]
    )
    expect(page.locator('[data-section="refusals"] tbody tr')).to_contain_text(["Bob"])
    expect(page.locator('[data-section="refusals"]')).to_contain_text("Ada holds control")
    expect(page.locator('a[download="cuts.csv"]')).to_have_attribute("href", "api/report.csv")
    expect(page.locator('a[download="report.json"]')).to_have_attribute("href", "api/report")


def test_what_a_person_left_as_it_is_is_listed_with_the_reason(page: Page, server: PlayedServer) -> None:
    open_screen(page, "report")
    kept = page.locator('[data-section="kept"]')
    expect(kept).to_be_hidden()
    server.points = (
        point(1, "PROPOSED"),
        point(2, "REJECTED", spur=2, user="Ada", reason=reasons.said("a tie is there")),
    )
    place = m.UndecidedSite(reasons.wire_near_cut(6.0), "nothing", 1, 5, (1.4, 0.8, 0.9))
    server.undecided_sites = (place,)
    server.tell(server.page_points())
    expect(kept.locator("li")).to_have_text(
        ["Vine 1 · spur 2 – Ada – a tie is there", f"Vine 1 · spur 5 – {reasons.text_of(place.reason)}"]
    )


@pytest.mark.long
def test_it_is_filtered_by_vine_and_outcome(page: Page, server: PlayedServer) -> None:
    server.report = report(cut(1), cut(2, "UNKNOWN"), cut(3, vine=2), cut(4, "UNKNOWN", vine=2, wrong_by="Eve"))
    open_screen(page, "report")
    shown = page.locator(".cut-card:visible h4")
    expect(shown).to_have_count(4)
    page.locator("#report-vine").select_option(label="Vine 2")
    expect(shown).to_have_text(["Vine 2 · spur 4", "Vine 2 · spur 3"])
    page.locator("#report-outcome").select_option(label="Unknown")
    expect(shown).to_have_text(["Vine 2 · spur 4"])
    expect(page.locator('[data-section="cuts"] > .hint')).to_have_text("1 of 4 cuts")
    page.locator("#report-outcome").select_option(label="Not cut")
    expect(page.locator('[data-section="cuts"] > .hint')).to_have_text("No cut is like that.")
    page.locator("#report-vine").select_option("")
    page.locator("#report-outcome").select_option(label="Called wrong")
    expect(shown).to_have_text(["Vine 2 · spur 4"])
    # A new cut that does not fit stays out.
    server.report = report(*server.report.cuts, cut(5, vine=3))
    expect(page.locator("#report-vine option")).to_have_count(4, timeout=8000)
    expect(shown).to_have_text(["Vine 2 · spur 4"])


def test_a_cut_is_called_wrong_and_right_again(page: Page, server: PlayedServer) -> None:
    cuts = (cut(1), cut(2, "UNKNOWN"))
    server.report = report(*cuts)
    server.answers["/api/points/p1/judge"] = (200, {"ok": True})
    open_screen(page, "report")
    wrong = page.get_by_role("button", name="The cut at Vine 1 · spur 1 was wrong")
    expect(page.locator(".judgement")).to_have_count(1)
    expect(wrong).to_have_attribute("aria-pressed", "false")
    server.report = report(msgspec.structs.replace(cuts[0], wrong_by="Bob"), cuts[1])
    wrong.press("Enter")
    expect(wrong).to_have_attribute("aria-pressed", "true")
    expect(wrong).to_be_focused()
    expect(wrong).to_have_attribute("title", "Bob called it wrong; press to call it right")
    wrong.click()
    until(page, lambda: len(server.posted) == 2)
    assert server.posted == [("/api/points/p1/judge", {"wrong": True}), ("/api/points/p1/judge", {"wrong": False})]


def test_a_second_press_takes_nothing_back_that_the_report_does_not_show_yet(page: Page, server: PlayedServer) -> None:
    server.report = report(cut(1))
    server.answers["/api/points/p1/judge"] = (200, {"ok": True})
    open_screen(page, "report")
    wrong = page.get_by_role("button", name="The cut at Vine 1 · spur 1 was wrong")
    expect(wrong).to_have_attribute("aria-pressed", "false")
    page.evaluate("() => { const button = document.querySelector('.judgement'); button.click(); button.click(); }")
    until(page, lambda: len(server.posted) > 0)
    page.wait_for_timeout(300)
    assert server.posted == [("/api/points/p1/judge", {"wrong": True})]


@pytest.mark.long
def test_it_goes_on_without_the_server_with_what_it_has(page: Page, server: PlayedServer) -> None:
    server.report = report(cut(1))
    open_screen(page, "report")
    expect(page.locator(".cut-card")).to_have_count(1)
    server.online = False
    expect(page.locator("rp-report > .hint")).to_contain_text("The server cannot be reached", timeout=10_000)
    expect(page.locator(".cut-card")).to_have_count(1)


def test_the_timeline_of_a_session_tells_modes_and_events(page: Page, server: PlayedServer) -> None:
    server.timeline = a_timeline(time.time() - 600.0)
    open_screen(page, "report")
    expect(page.locator("rp-report .time-mode")).to_have_text(
        [re.compile("Idle|"), "Ready", "Automatic", "Paused", re.compile("Ready|"), "Automatic", "Stopped", "Idle"]
    )
    marks = page.locator("rp-report .time-mark")
    kinds = marks.evaluate_all("all => all.map(each => each.dataset.kind)")
    assert {"cut", "failed_cut", "refusal", "PAUSED", "ESTOP_LATCHED"} == set(kinds)
    # The session goes on: its last event is not at its end.
    lefts = marks.evaluate_all("all => all.map(each => parseFloat(each.style.left))")
    assert lefts and max(lefts) < 80.0
    marks.and_(page.locator('[data-kind="ESTOP_LATCHED"]')).hover()
    expect(page.locator("rp-report .time-words")).to_contain_text("Automatic → Stopped: stop button")
    # One stop of the Tab key, and arrows from there.
    marks.first.focus()
    first = page.locator("rp-report .time-words").inner_text()
    page.keyboard.press("ArrowRight")
    expect(page.locator("rp-report .time-words")).not_to_have_text(first)
    expect(page.locator('rp-report .time-mark[tabindex="0"]')).to_have_count(1)
    marks.nth(1).click()
    assert [path for path, _ in server.posted if path == "/api/replay"] == []


def test_a_session_in_which_nothing_has_happened_has_an_empty_timeline(page: Page, server: PlayedServer) -> None:
    open_screen(page, "report")
    expect(page.locator("rp-report .time-words")).to_have_text("Nothing has happened yet.")
    expect(page.locator("rp-report .time-track")).to_be_hidden()


def test_it_prints_on_a4_with_the_pictures_and_nothing_else_of_the_page(page: Page, server: PlayedServer) -> None:
    cuts = [cut(number, vine=1 + number // 9) for number in range(1, 31)]
    server.report = report(*cuts)
    server.timeline = a_timeline(time.time() - 600.0)
    for each in cuts:
        # Each its own, so that they can be counted on paper.
        tail = each.cut_id.encode()
        server.cut_pictures[each.cut_id, "before"] = cut_picture(False) + tail
        server.cut_pictures[each.cut_id, "after"] = cut_picture(True) + tail
    open_screen(page, "report")
    expect(page.locator(".cut-card")).to_have_count(30)
    page.evaluate("() => { window.printed = 0; window.print = () => { window.printed += 1; }; }")
    page.locator("#print").click()
    until(page, lambda: page.evaluate("printed") == 1, 20.0)
    # All have come before it printed, those out of sight too.
    assert page.locator(".shot img").evaluate_all("all => all.every(each => each.complete && each.naturalWidth)")
    assert page.locator(".shot img").count() == 60
    page.emulate_media(media="print")
    try:
        for part in ("#stop", "rp-bar", ".top", "#print", ".judgement", ".filters", "rp-toasts"):
            expect(page.locator(part).first).to_be_hidden()
        expect(page.locator("rp-report h2")).to_be_visible()
        paper = page.pdf(prefer_css_page_size=True)
    finally:
        page.emulate_media(media="null")
    boxes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", paper)
    sheets = len(re.findall(rb"/Type /Page\b(?!s)", paper))
    assert 4 <= sheets <= 9
    assert {(round(float(w)), round(float(h))) for w, h in boxes} <= {(595, 842), (594, 841), (596, 842)}
    # Everything of the report is on paper: its end as well as its beginning.
    assert page.locator("rp-report").evaluate("each => getComputedStyle(each).display") == "grid"


def test_on_paper_the_times_of_the_timeline_stand_apart(page: Page, server: PlayedServer) -> None:
    page.set_viewport_size({"width": 1440, "height": 900})
    server.timeline = a_timeline(time.time() - 600.0)
    open_screen(page, "report")
    ticks = page.locator("rp-report .time-axis span")
    expect(ticks.nth(8)).to_be_visible()
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    try:
        page.set_viewport_size({"width": 680, "height": 960})
        boxes = [box_of(each) for each in ticks.all()]
        assert len(boxes) >= 2
        assert all(left["x"] + left["width"] < right["x"] for left, right in pairwise(boxes))
    finally:
        page.emulate_media(media="null")
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    page.set_viewport_size({"width": 1440, "height": 900})
    expect(ticks.nth(8)).to_be_visible()


def test_what_is_unclear_of_the_whole_picture_is_told_without_a_vine(page: Page, server: PlayedServer) -> None:
    why = reasons.picture_unfamiliar(1.4, 1.2)
    usual = server.undecided_sites[0]
    server.undecided_sites = (msgspec.structs.replace(usual, needs="operator", vine=0, spur=0, reason=why),)
    server.points = ()
    server.tell(server.page_points())
    open_screen(page, "report")
    expect(page.locator(".left-over li")).to_have_text([reasons.text_of(why)])


def test_no_cut_is_divided_between_two_sheets(page: Page, server: PlayedServer) -> None:
    server.report = report(*(cut(number) for number in range(1, 20)))
    open_screen(page, "report")
    expect(page.locator(".cut-card")).to_have_count(19)
    page.emulate_media(media="print")
    try:
        inside = page.locator(".cut-card").evaluate_all("all => all.map(each => getComputedStyle(each).breakInside)")
        assert set(inside) == {"avoid"}
        # What scrolls on the screen would end with the first sheet.
        for part in ("html", "body", "main", "rp-report"):
            style = page.locator(part).first.evaluate("each => getComputedStyle(each).overflow")
            assert style == "visible", (part, style)
    finally:
        page.emulate_media(media="null")
