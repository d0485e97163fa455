"""The page in another language: all that it shows comes from the language's files."""

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect
from starlette.responses import JSONResponse, Response

from rolling_panda.generate.languages import problems
from rolling_panda.resources import resource
from tests.support.page_host import PlayedRequest
from tests.support.page_parts import queue
from tests.support.page_states import STATES
from tests.support.played_server import ORIGIN, PlayedServer

pytestmark = pytest.mark.browser

TEXTS = resource("web/text/page.en.json").parent
#: A language that has no files of its own; here its words are the English ones in other letters.
LANGUAGE = "eo"
LETTERS = str.maketrans(
    "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ", "αвсδεғցнιјκℓмηορqяѕтυνωχуzΑВСΔΕҒGНΙЈΚLМΗΟΡQЯЅТΥΝΩΧΥZ"
)
#: What is the same in every language: names, also of languages and keys, units and formats of files.
SAME = {"English", "esperanto", "Esc", "nullspace", "Rolling", "Panda", "Ada", "Bob", "mm", "ms", "min", "JSON", "CSV"}
#: Words for people: visible text, and the attributes that are read out or shown on hover.
WORDS = """() => {
  const shown = [document.title];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const parent = walker.currentNode.parentElement;
    // Names on the wire stay as they are.
    const said = parent.localName !== "noscript" && !parent.closest('[translate="no"]');
    if (said && parent.checkVisibility({ visibilityProperty: true }))
      shown.push(walker.currentNode.data);
  }
  const attributes = ["title", "placeholder", "alt", "aria-label", "aria-description", "aria-valuetext"];
  for (const each of document.querySelectorAll("body *"))
    for (const name of attributes) if (each.hasAttribute(name)) shown.push(each.getAttribute(name));
  return shown.filter((text) => text.trim());
}"""


def translated(text: str) -> str:
    """A text in other letters, apart from its values; what a person has said is put in quotes."""
    # A number's words for one and for several are no value.
    parts = re.split(r"(\{\w+:(?=[^}]*\|)|\{[^}|]*\})", text)
    return "".join(part if part.startswith("{") else part.translate(LETTERS) for part in parts)


def files() -> dict[str, Any]:
    page = json.loads((TEXTS / "page.en.json").read_text(encoding="utf-8"))
    reasons = json.loads((TEXTS / "reasons.en.json").read_text(encoding="utf-8"))
    rows = {code: [severity, translated(text), translated(act)] for code, (severity, text, act) in reasons.items()}
    return {
        f"page.{LANGUAGE}.json": {key: translated(text) for key, text in page.items()},
        f"reasons.{LANGUAGE}.json": rows | {"said": ["info", "„{text}“", ""]},
    }


class TranslatedServer(PlayedServer):
    """A server with the files of one more language."""

    def answer(self, request: PlayedRequest) -> Response | None:
        name = request.path.rsplit("/", 1)[-1]
        if name == "languages.js":
            return Response(f'export const LANGUAGES = ["en", "{LANGUAGE}"];', media_type="text/javascript")
        return JSONResponse(found) if (found := files().get(name)) else super().answer(request)


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    context = browser.new_context(locale=LANGUAGE, viewport={"width": 1280, "height": 800})
    yield context
    context.close()


def english(page: Page) -> dict[str, str]:
    """Words that the page shows in Latin letters, with a text of each; not what people have said, and no names."""
    shown = [re.sub(r"„[^“]*“|\w+\.(json|csv|mcap)", "", text) for text in page.evaluate(WORDS)]
    assert len(shown) > 5
    return {word: text for text in shown for word in re.findall(r"[A-Za-z]{2,}", text) if word not in SAME}


def test_the_files_of_the_made_up_language_would_pass_the_check(tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("text")
    for path in TEXTS.glob("*.en.json"):
        (folder / path.name).write_bytes(path.read_bytes())
    for name, rows in files().items():
        (folder / name).write_text(json.dumps(rows), encoding="utf-8")
    assert problems(folder) == []


@pytest.mark.long
def test_every_word_of_every_state_is_in_the_language_of_the_browser(
    context: BrowserContext, subtests: pytest.Subtests
) -> None:
    page = context.new_page()
    for name, state in STATES.items():
        with subtests.test(name):
            server = TranslatedServer(points=queue())
            server.attach(page)
            page.goto(f"{ORIGIN}/")
            expect(page.locator("#mode")).to_have_attribute("data-mode", "READY")
            state(page, server)
            assert page.locator("html").get_attribute("lang") == LANGUAGE
            assert english(page) == {}


def test_the_sign_in_page_is_in_the_language_of_the_browser(context: BrowserContext) -> None:
    page = context.new_page()
    server = TranslatedServer()
    server.answers["/api/sign-in"] = (401, {"ok": False, "code": "not_signed_in", "values": {}})
    server.attach(page)
    page.goto(f"{ORIGIN}/sign-in")
    expect(page.locator("#token-form")).to_be_visible()
    assert english(page) == {}
    page.locator("#token").fill("no")
    page.locator("#token-form button").click()
    expect(page.locator("#progress.problem")).to_be_visible()
    assert english(page) == {}


@pytest.mark.parametrize(("preferred", "shown"), [("eo", "eo"), ("eo-US", "eo"), ("de", "en"), ("en-GB", "en")])
def test_a_language_without_files_is_shown_in_english(browser: Browser, preferred: str, shown: str) -> None:
    context = browser.new_context(locale=preferred)
    page = context.new_page()
    TranslatedServer().attach(page)
    page.goto(f"{ORIGIN}/sign-in")
    expect(page.locator("html")).to_have_attribute("lang", shown)
    expect(page.locator("#token-form button")).to_have_text("Sign in" if shown == "en" else translated("Sign in"))
    context.close()
