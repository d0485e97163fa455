"""The page's languages: nothing left in English, the plural forms that browsers ask for, and the choice on the page."""

import json
import re

import pytest
from playwright.sync_api import Browser, Page, expect

from rolling_panda.generate.guides import language_of
from rolling_panda.generate.languages import languages
from rolling_panda.resources import resource
from tests.support.page_parts import open_screen, queue, working
from tests.support.played_server import ORIGIN, PlayedServer

TEXTS = resource("web/text/page.en.json").parent
OTHERS = languages(TEXTS)[1:]
#: English words that are none of the other languages', unlike "camera", "base" and "was".
ENGLISH = re.compile(r"\b(the|of|and|is|with|you|your|this|that|cane|press|wait|been)\b", re.IGNORECASE)
#: What stays as it is: command lines and configuration.
AS_IT_IS = re.compile(r"rolling-panda [\w -]+|\[[\w.]+\]|--[\w-]+|GET /[\w/]+")


def texts(language: str) -> dict[str, str]:
    page = json.loads((TEXTS / f"page.{language}.json").read_text(encoding="utf-8"))
    rows = json.loads((TEXTS / f"reasons.{language}.json").read_text(encoding="utf-8"))
    return page | {f"reasons {code}": f"{text} {act}" for code, (_, text, act) in rows.items()}


def test_the_page_is_in_the_languages_of_five_wine_countries() -> None:
    assert set(languages(TEXTS)) >= {"en", "it", "fr", "es", "de"}


@pytest.mark.parametrize("language", OTHERS)
def test_nothing_is_left_in_english(language: str) -> None:
    kept = {key: AS_IT_IS.sub("", re.sub(r"\{[^}]*\}", "", text)) for key, text in texts(language).items()}
    assert {key: text for key, text in kept.items() if ENGLISH.search(text)} == {}
    english = texts("en")
    assert ENGLISH.search(english["stop.hint"]) and ENGLISH.search(english["reasons viewer_only"])
    # Two long words in a row are never the same.
    long = {key for key, text in kept.items() if len(re.findall(r"\w{5,}", text.replace("Rolling Panda", ""))) > 1}
    assert [key for key in sorted(long) if kept[key] == english.get(key)] == []


@pytest.mark.parametrize(("language", "wrong"), [("it", r"\w'\w"), ("fr", r"\w'\w| [:;?!]")])
def test_apostrophes_and_spaces_are_those_of_the_language(language: str, wrong: str) -> None:
    assert {key: text for key, text in texts(language).items() if re.search(wrong, text)} == {}


@pytest.mark.long
@pytest.mark.browser
@pytest.mark.parametrize("language", OTHERS)
def test_each_counted_text_has_the_plural_forms_that_browsers_ask_for(page: Page, language: str) -> None:
    asked = page.evaluate("code => new Intl.PluralRules(code).resolvedOptions().pluralCategories", language)
    found = set(re.findall(r"^(.+)\.(zero|one|two|few|many|other)$", "\n".join(texts(language)), re.MULTILINE))
    for group in {group for group, form in found if form == "other"}:
        assert {form for each, form in found if each == group} == set(asked), group


@pytest.mark.parametrize("language", languages(TEXTS))
def test_the_guide_names_buttons_as_the_page_does(language: str) -> None:
    guides = resource("web/index.html").parents[1] / "docs"
    (guide,) = (path for path in guides.glob("guide-short.*.md") if language_of(path) == language)
    named = set(re.findall(r"\*\*([^*?]+)\*\*", guide.read_text(encoding="utf-8")))
    assert len(named) >= 15
    assert named - set(texts(language).values()) == set()


@pytest.mark.long
@pytest.mark.browser
def test_a_language_is_chosen_on_the_page_and_remembered(page: Page, server: PlayedServer) -> None:
    page.locator("#person").click()
    page.locator("#open-settings").click()
    expect(page.locator("#setting-language")).to_be_visible()
    names = page.locator("#setting-language option").all_inner_texts()
    assert names[0] == "As the browser" and {"English", "Deutsch", "italiano", "français", "español"} <= {*names}
    page.locator("#setting-language").select_option("de")
    expect(page.locator("html")).to_have_attribute("lang", "de")
    expect(page.locator("#stop")).to_contain_text("Stopp")
    page.reload()
    expect(page.locator("html")).to_have_attribute("lang", "de")
    page.locator("#person").click()
    page.locator("#open-settings").click()
    page.locator("#setting-language").select_option("")
    expect(page.locator("html")).to_have_attribute("lang", "en")


@pytest.mark.long
@pytest.mark.browser
def test_numbers_and_reasons_are_in_the_language_of_the_browser(browser: Browser, server: PlayedServer) -> None:
    context = browser.new_context(locale="de-DE")
    page = context.new_page()
    server.attach(page)
    page.goto(f"{ORIGIN}/")
    expect(page.locator("#mode")).to_have_text("Bereit")
    shown = """async reason => {
      const { reasonText } = await import("/js/state/reasons.js");
      return reasonText(reason);
    }"""
    values = [["age_s", 0.5], ["limit_s", 0.25]]
    told = page.evaluate(shown, {"code": "joints_stale", "values": values})
    assert told == "Die Gelenkzustände sind 0,50 s alt; die Grenze ist 0,25 s"
    for others, words in ((1, "mit 1 weiteren Rute ab"), (2, "mit 2 weiteren Ruten ab")):
        assert words in page.evaluate(shown, {"code": "renewal_cut", "values": [["others", others]]})
    (row,) = server.points[2:]
    for code in ("point_unseen", "revised"):
        told = page.evaluate(shown, {"code": code, "values": [["point", row.point.point_id]]})
        assert "Stock 1, Zapfen 2" in told
    context.close()


#: Controls and headings that are narrower than their words and do not say so.
CUT_OFF = """() => [...document.querySelectorAll("button, a, select, h2, summary, label")].flatMap(each => {
  const shown = each.checkVisibility({ visibilityProperty: true }) && each.clientWidth > 0;
  const cut = shown && each.scrollWidth > each.clientWidth + 1 && getComputedStyle(each).textOverflow !== "ellipsis";
  return cut ? [each.id || each.className || each.textContent] : [];
})"""


@pytest.mark.long
@pytest.mark.browser
@pytest.mark.parametrize("language", OTHERS)
@pytest.mark.parametrize("size", [(1280, 800), (390, 844)])
def test_no_control_of_a_translated_page_is_cut_off(
    browser: Browser, subtests: pytest.Subtests, language: str, size: tuple[int, int]
) -> None:
    context = browser.new_context(locale=language, viewport={"width": size[0], "height": size[1]})
    page = context.new_page()
    server = PlayedServer(points=queue())
    server.attach(page)
    page.goto(f"{ORIGIN}/")
    expect(page.locator("#mode")).to_have_attribute("data-mode", "READY")
    working(page, server)
    for name in ("work", "review", "drive", "report", "engineer"):
        with subtests.test(name):
            open_screen(page, name)
            assert page.evaluate(CUT_OFF) == []
            assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    context.close()
