"""The page's words: each one is in the catalogue, with exactly its values, and stands nowhere else."""

import json
import re
from collections.abc import Iterator, Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import get_args

import pytest
from playwright.sync_api import Page, expect

from controller.motion.follower import UNNAMED
from controller.supervision.permission import HOLD
from controller.whole_body import hierarchy
from controller.whole_body.collision_geometry import GROUND, part_of, robot_geometry
from controller.whole_body.guards import axle, tipping
from controller.whole_body.task import NOT_FINITE
from labelling.from_decisions import NOT_A_CANE
from perception.dataset.dataset import VALUES
from perception.segmentation.segmenter import LabelImageSegmenter, NoSegmenter
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.commands import COMMANDS
from rolling_panda.generate.description import union_members
from rolling_panda.messages import page as page_messages
from rolling_panda.messages import types
from rolling_panda.mode_table import Event, Who
from rolling_panda.model.robot import RobotModel
from rolling_panda.resources import resource
from rolling_panda.topics import PLANT
from tests.support.played_page import until
from tests.support.played_server import PlayedServer

WEB = resource("web/index.html").parent
TEXTS: dict[str, str] = json.loads((WEB / "text" / "page.en.json").read_text(encoding="utf-8"))
#: Commands with a button of their own.
BUTTONS = ("Arm", "Survey", "Start", "Pause", "Resume", "Home", "Acknowledge")
FACTS = ("cut", "keeps", "sure", "cane", "place", "clear")
READINGS = re.findall(r'\bid: "([\w-]+)"', (WEB / "js" / "views" / "readings.js").read_text(encoding="utf-8"))
COLUMNS = (
    *("vine", "done", "not_cut", "unknown", "unreachable", "minutes", "when", "who", "asked", "why", "what", "mean"),
    *("date", "duration", "at_work", "user", "called_wrong", "vines_an_hour", "refused"),
)
PANELS = ("alarms", "processes", "telemetry", "charts", "log", "topics", "models", "camera")
TOPIC_COLUMNS = ("topic", "sender", "rate", "nominal", "age", "count", "rejected")
CHOICES = ("part.tool", "part.base", "part.joints", "part.postures", "axes.tool", "axes.base", "axes.world")
PARTS = {GROUND, *(part_of(shape.name) for shape in robot_geometry(RobotModel()).geometryObjects)}
CONSTRAINTS = (
    *(*hierarchy._BOUND_NAMES, *axle._NAMES, *tipping._NAMES, NOT_FINITE),
    *("a limit of a joint or wheel", "limits that contradict each other"),
)
#: What the page says for a person, kept as it is.
SAID = (
    *(NOT_A_CANE, "wrong cane", "wrong place", "too near a wire", "leave it"),
    *("stop button", "space bar", "seen by eye"),
)
#: What stands for `${…}` in a key.
FAMILIES: dict[str, Sequence[str]] = {
    "arrows.${}": ["move.up", "move.down", "turn.up", "turn.down"],
    "arrows.${}.label": ["move.up", "move.down", "turn.up", "turn.down"],
    "arrows.${}.${}": [f"{frame}.{axis}" for frame in ("tool", "base", "world") for axis in "xyz"],
    "arrows.step.${}": ["free", "small", "middle", "large"],
    "arrows.step.${}.hint": ["free", "small", "middle", "large"],
    "joint.name.${}": [str(number) for number in range(1, 8)],
    "posture.own.${}": ["survey", "folded"],
    "mode.${}": (*get_args(m.Mode), "none"),
    "point.${}": get_args(m.PointState),
    "phase.${}": tuple(filter(None, get_args(m.Phase))),
    "process.${}": (*m.PROCESSES, "all", "page"),
    "role.${}": get_args(types.Role),
    "stop.${}": ("idle", "sending", "sent", "failed"),
    "camera.${}": get_args(types.BridgeKind),
    "camera.${}.hint": get_args(types.BridgeKind),
    "command.${}": (*(command.name for command in COMMANDS), *(each.__name__ for each in PLANT.requests), HOLD),
    "command.${}.hint": BUTTONS,
    "teleop.how.${}": ("tool", "base", "joints", "postures"),
    "telemetry.${}": ("low", "high", ""),
    "reading.${}": READINGS,
    "reading.${}.hint": READINGS,
    "way.${}": ("x", "y", "heading", "distance", "turns"),
    "way.${}.hint": ("x", "y", "heading", "distance", "turns"),
    "label.${}": ("train", "held-out"),
    "label.${}.hint": ("train", "held-out"),
    "label.class.${}": tuple(name for name in VALUES if name != "unlabelled"),
    "report.${}": ("TakeControl", "GrantControl", "ReturnControl", "before", "after"),
    "report.table.${}": ("timeline", "cuts", "left", "kept", "vines", "refusals", "control"),
    "report.none.${}": ("vines", "refusals", "control"),
    "report.left.${}": ("DONE", "UNKNOWN", "UNREACHABLE", "PROPOSED", "undecided"),
    "panel.${}": PANELS,
    "panels.${}": ("earlier", "later", "hide"),
    "processes.${}": ("process", "version", "runs", "age"),
    "topics.${}": TOPIC_COLUMNS,
    "topics.${}.hint": TOPIC_COLUMNS,
    "models.${}": ("network", "method", "robot", "plan", "preview", "point", "revision", "state", "digest"),
    "calibration.${}": ("used", "seen", "offer", "base", "base_offer", "arm", "arm_offer", "timing", "timing_offer"),
    "calibration.${}_drawn": ("base", "arm", "timing"),
    "calibration.${}_hint": ("base", "arm"),
    "calibration.${}_use_hint": ("base", "arm", "timing"),
    "models.robot.${}": get_args(types.BridgeKind),
    "report.column.${}": COLUMNS,
    "severity.${}": get_args(types.Severity),
    "log.least.${}": get_args(types.Severity),
    "invite.role.${}": get_args(types.Role),
    "decision.${}": ("accepting", "rejecting", "reconsidering", "resolving", "moving", "moving_back"),
    "details.${}": FACTS,
    "details.${}.hint": FACTS,
    "details.kind.${}": get_args(types.CutKind),
    "details.near.${}": ("wire", "cordon", "node"),
    "review.${}": ("sure", "fairly", "unsure"),
    "review.place.${}": ("decide", "left"),
    "plan.stands.${}.${}": ("left.ahead", "left.behind", "right.ahead", "right.behind"),
    "layer.${}": get_args(page_messages.Layer),
    "preset.${}": get_args(page_messages.CameraPreset),
    "preset.${}.hint": get_args(page_messages.CameraPreset),
    "rule.${}": ("nodes_kept", "fruiting_nodes", "preferred_diameter", "offset"),
    "rule.system.${}": ("spur", "guyot"),
    "teleop.${}": ("part", "axes"),
    "teleop.${}.${}": CHOICES,
    "teleop.${}.${}.hint": CHOICES,
    "screen.${}": ("work", "review", "drive", "report", "engineer"),
    "health.${}": ("robot", "camera"),
    "bar.${}": ("preview", "approve", "reset"),
    "bar.to_${}": ("review", "preview"),
    "keys.${}": (
        *("stop", "decide", "undo", "step", "vine", "add", "look", "zoom"),
        *("camera", "measure", "hold", "drive", "close", "help"),
    ),
    "hint.${}": ("next", "screens", "stop", "person"),
    # What a message names.
    "name.${}": (
        *(event.value for event in Event),
        *get_args(types.WoodClass),
        *(part.rstrip("0123456789") for part in PARTS),
        *(name.rstrip(" 1234567") for name in CONSTRAINTS),
        *get_args(reasons.Goal),
        *get_args(reasons.Place),
        *(command.words for command in COMMANDS),
        *({*get_args(Who)} - {*get_args(types.Role)}),
        *SAID,
        *(LabelImageSegmenter.name, NoSegmenter.name),
        *("vine", "arm", UNNAMED, "the left wheel", "the right wheel"),
    ),
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
                found |= {each: names("".join(values)) for each in family(template)}
        for key, _, *values in arguments(script, "counted"):
            for form in ("one", "other"):
                found[f"{json.loads(key)}.{form}"] = names("".join(values)) | {"count"}
    return found


def family(template: str) -> list[str]:
    kind = re.sub(r"\$\{[^}]*\}", "${}", template)
    return [kind.replace("${}.${}", "${}").replace("${}", each) for each in FAMILIES[kind]]


def test_each_text_is_shown_with_exactly_its_values() -> None:
    markup = "".join(path.read_text(encoding="utf-8") for path in WEB.glob("*.html"))
    marked = re.findall(r'data-(?:text|label)="([^"]*)"', markup)
    labels = [key for kind in ("point", "command", "name", "role") for key in family(f"{kind}.${{}}")]
    made = shown() | {key: set[str]() for key in (*marked, *labels)}
    assert "stale.gone" in made and "mode.IDLE" in made
    assert {key: set(re.findall(r"\{(\w+)\}", words)) for key, words in TEXTS.items()} == made


#: Comments and literals of a script. A template holds no template.
TOKEN = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|`(?:\\.|[^`\\])*`', re.DOTALL)
#: Two words, or a value beside one, or one with a capital letter.
PROSE = re.compile(r"[A-Za-z]{2}[,.:;…]? +[A-Za-z0]|\0[ ,:;]*[A-Za-z]{3}|[A-Za-z]{3}[ ,:;]+\0|^[A-Z][a-z]+$")
#: Where one word is enough.
SHOWN = re.compile(
    r'(?:text: |ariaLabel = |title: |placeholder: |alt: |label": |\.title = |textContent = |-label", |setText\([^;]*)$'
)
#: What is compared, styled or looked up instead of being shown.
UNSEEN = re.compile(
    r"(?:class: |[!=]== |case |whyNot\(|querySelector(?:All)?\(|closest\??\.?\(|translate = |headers\.get\(|data: \{ |"
    r'-controls": |name: |cookie = |const PARTS = |const DISABLED = |getAttribute\()$'
)
PROPER = {"Rolling Panda", "\0 · Rolling Panda", "\0 min \0 s", "\0 min", "\0 s", "\0 mm", "\0 / \0 s"}
KEYS = {"H", "Esc", "Escape", "Tab", "Enter", "Space", "Arrow"}
MESSAGES = {
    struct.__name__ for struct in (*union_members(page_messages.FromServer), *union_members(page_messages.FromPage))
}
NO_TEXTS = PROPER | KEYS | MESSAGES | {*BUTTONS, *SAID}


def loose_texts(script: str) -> list[str]:
    """The texts that stand in a script itself."""
    found = []
    for token in TOKEN.finditer(script):
        if token[0][0] == "/":
            continue
        words = re.sub(r"\$\{(?:[^{}]|\{[^{}]*\})*\}", "\0", token[0][1:-1])
        before = script[: token.start()].rsplit("\n", 1)[-1]
        key = re.fullmatch(r"[a-z_\0-]+(?:\.[\w\0-]+)+", words)
        shown = SHOWN.search(before) and re.search("[A-Za-z]", words) and not key
        if (shown or PROSE.search(words)) and not UNSEEN.search(before) and words not in NO_TEXTS:
            found.append(words)
    return found


@pytest.mark.parametrize("script", sorted(WEB.rglob("*.js")), ids=lambda path: path.name)
def test_no_text_stands_in_a_script(script: Path) -> None:
    if script.name not in ("messages.js", "offscreen-framebuffer.js"):
        assert loose_texts(script.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "script",
    [
        'element("p", { text: "copied" });',
        'setText(words, "copied");',
        'setText(words, why ? "" : "copied");',
        'element("button", {}, "Copy");',
        'showToast("info", "nothing has changed");',
        'attributes: { "aria-label": "vines" }',
        "say(`moved ${point} by ${distance} mm`);",
        "const words = `${count} vines`;",
    ],
)
def test_a_text_that_stands_in_a_script_is_found(script: str) -> None:
    assert len(loose_texts(script)) == 1


class Markup(HTMLParser):
    """The words of a page's own markup, apart from those for browsers without scripts."""

    def __init__(self, markup: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self._inside: list[str] = []
        self.feed(markup)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._inside.append(tag)
        self.words.extend(value or "" for name, value in attrs if name in ("aria-label", "title", "alt", "placeholder"))

    def handle_endtag(self, tag: str) -> None:
        while self._inside and self._inside.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if data.strip() and "noscript" not in self._inside:
            self.words.append(data.strip())


def test_no_text_stands_in_the_markup() -> None:
    assert Markup("<p>Why<br><noscript>no</noscript> <i title=Who></i>").words == ["Why", "Who"]
    for path in WEB.glob("*.html"):
        markup = path.read_text(encoding="utf-8")
        assert {*Markup(markup).words} == {"Rolling Panda"}, path
        assert {*re.findall(r'data-(?:text|label)="([^"]*)"', markup)} <= TEXTS.keys()


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
