"""The page's words: each text that a script shows is in the catalogue, with exactly its values, and no other is."""

import json
import re
from collections.abc import Iterator, Sequence
from typing import get_args

import pytest
from playwright.sync_api import Page, expect

from perception.dataset.dataset import VALUES
from rolling_panda import messages as m
from rolling_panda.messages import types
from rolling_panda.resources import resource
from tests.support.played_page import until
from tests.support.played_server import PlayedServer

WEB = resource("web/index.html").parent
TEXTS: dict[str, str] = json.loads((WEB / "text" / "page.en.json").read_text(encoding="utf-8"))
READINGS = re.findall(r'\bid: "([\w-]+)"', (WEB / "js" / "views" / "readings.js").read_text(encoding="utf-8"))
#: What stands for `${…}` in a key.
FAMILIES: dict[str, Sequence[str]] = {
    "mode.${}": (*get_args(m.Mode), "none"),
    "point.${}": get_args(m.PointState),
    "phase.${}": tuple(filter(None, get_args(m.Phase))),
    "process.${}": m.PROCESSES,
    "role.${}": get_args(types.Role),
    "stop.${}": ("idle", "sending", "sent", "failed"),
    "camera.${}": get_args(types.BridgeKind),
    "camera.${}.hint": get_args(types.BridgeKind),
    "command.${}": ("Arm", "Survey", "Start", "Pause", "Resume", "Home", "Acknowledge"),
    "command.${}.hint": ("Arm", "Survey", "Start", "Pause", "Resume", "Home", "Acknowledge"),
    "teleop.how.${}": ("tool", "base", "joints"),
    "telemetry.${}": ("low", "high", ""),
    "reading.${}": READINGS,
    "reading.${}.hint": READINGS,
    "label.${}": ("train", "held-out"),
    "label.${}.hint": ("train", "held-out"),
    "label.class.${}": tuple(name for name in VALUES if name != "unlabelled"),
    "report.${}": ("TakeControl", "GrantControl", "ReturnControl"),
}


def arguments(script: str, function: str) -> Iterator[list[str]]:
    """The arguments of each call of a function."""
    for call in re.finditer(rf"(?<![\w.]){function}\(", script):
        found, depth, at = [""], 0, call.end()
        while depth >= 0:
            letter = script[at]
            depth += (letter in "([{") - (letter in ")]}")
            if letter == "," and depth == 0:
                found.append("")
            elif depth >= 0:
                found[-1] += letter
            at += 1
        yield [each.strip() for each in found if each.strip()]


def names(values: str) -> set[str]:
    """The keys of an object literal."""
    while re.search(r"\([^()]*\)", values):
        values = re.sub(r"\([^()]*\)", "", values)
    return {each.split(":")[0].strip() for each in values.strip("{ }").split(",") if each.strip()}


def shown() -> dict[str, set[str]]:
    """Names of the values of each text that a script shows; a key in a template stands for its family."""
    found = {}
    for path in WEB.rglob("*.js"):
        if path.name == "texts.js":
            continue
        script = path.read_text(encoding="utf-8")
        for key, *values in arguments(script, "text"):
            templates = re.findall(r"`([^`]*)`", key)
            for each in re.findall(r'(?:^|[?:])\s*"([^"]*)"', re.sub(r"`[^`]*`", "", key)):
                found[each] = names("".join(values))
            for template in templates:
                found |= {each: set() for each in family(template)}
        for key, _, *values in arguments(script, "counted"):
            for form in ("one", "other"):
                found[f"{json.loads(key)}.{form}"] = names("".join(values)) | {"count"}
    return found


def family(template: str) -> list[str]:
    kind = re.sub(r"\$\{[^}]*\}", "${}", template)
    return [kind.replace("${}", each) for each in FAMILIES[kind]]


def test_each_text_is_shown_with_exactly_its_values() -> None:
    made = shown() | {key: set[str]() for key in family("point.${}")}
    assert "stale.gone" in made and "mode.IDLE" in made
    assert {key: set(re.findall(r"\{(\w+)\}", words)) for key, words in TEXTS.items()} == made


@pytest.mark.browser
def test_without_its_words_the_page_still_stops_the_robot(page: Page, server: PlayedServer) -> None:
    texts = "**/text/*.json"
    page.route(texts, lambda route: route.abort())
    try:
        page.reload()
        expect(page.locator("#mode")).to_have_text("mode.READY")
        page.locator("#stop").click()
        until(page, lambda: len(server.stops()) == 1)
    finally:
        # The tab is the next test's too.
        page.unroute(texts)
