import json
import re
import shutil
from typing import Annotated, Any

import msgspec
import pytest

from rolling_panda import messages as m
from rolling_panda.errors import MessageError
from rolling_panda.generate import markdown, safety
from rolling_panda.generate.__main__ import ROOT, generated, main, stale
from rolling_panda.generate.description import describe, reachable
from rolling_panda.generate.javascript import js_type, messages_module, messages_types
from rolling_panda.messages import page
from rolling_panda.mode_table import ROWS, SEVERITY, Event
from rolling_panda.reasons import CATALOGUE
from rolling_panda.topics import SERVICES, TOPICS


def test_generated_files_are_current() -> None:
    assert stale() == [], "run: python -m rolling_panda.generate --write"
    assert main(["--check"]) == 0


def test_an_edited_file_is_noticed(tmp_path: Any) -> None:
    for path in generated():
        copy = tmp_path / path.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    for path in (ROOT / "web" / "text").glob("*.json"):
        shutil.copy(path, tmp_path / "web" / "text")
    for path in (ROOT / "docs").glob("guide-short.*.md"):
        shutil.copy(path, tmp_path / "docs")
    assert stale(tmp_path) == []
    (tmp_path / "web" / "js" / "link" / "messages.js").write_text("// edited\n", encoding="utf-8")
    wire = tmp_path / "docs" / "wire.md"
    wire.write_text(wire.read_text(encoding="utf-8").replace("`command/motion`", "`command/other`"), encoding="utf-8")
    assert [path.name for path in stale(tmp_path)] == ["messages.js", "wire.md"]


def test_every_topic_service_and_field_is_in_the_wire_document() -> None:
    text = (ROOT / "docs" / "wire.md").read_text(encoding="utf-8")
    for row in (*TOPICS, *SERVICES):
        assert f"| `{row.name}` |" in text
    requests = [request for service in SERVICES for request in service.requests]
    for struct in reachable([*(topic.message for topic in TOPICS), *requests, m.Answer]):
        section = text.split(f"\n### {struct.__name__}\n")[1].split("\n### ")[0]
        for field in msgspec.structs.fields(struct):
            assert f"| `{field.encode_name}` |" in section, f"{struct.__name__}.{field.name}"


def test_every_link_of_the_wire_document_leads_somewhere() -> None:
    text = (ROOT / "docs" / "wire.md").read_text(encoding="utf-8")
    headings = {heading.lower() for heading in re.findall(r"^### (\w+)$", text, re.MULTILINE)}
    assert set(re.findall(r"\]\(#(\w+)\)", text)) <= headings


def test_the_page_knows_every_message_of_its_socket() -> None:
    text = messages_types()
    state = text.split("export interface PageState {")[1].split("\n}")[0]
    assert '\n  type: "PageState";' in state
    assert "\n  controller: ControllerState|null;" in state
    assert "\n  controller_age_s: number|null;" in state
    for union in (page.FromServer, page.FromPage):
        for member in union.__args__:
            assert f"\nexport interface {member.__name__} {{" in text


def test_a_browser_fetches_words_and_no_types() -> None:
    text = messages_module()
    listed = re.search(r"PROCESSES = Object.freeze\((\[.*\])\)", text)
    assert listed is not None
    assert "controller" in json.loads(listed[1])
    assert "typedef" not in text and "interface" not in text
    declared = set(re.findall(r"^export const (\w+)", messages_types(), re.MULTILINE))
    assert set(re.findall(r"^export const (\w+)", text, re.MULTILINE)) == declared


def test_docstrings_give_each_attribute_its_words() -> None:
    fields = {field.name: field for field in describe(m.MotionCommand).fields}
    assert fields["xi"].about == "[θ̇_l, θ̇_r, q̇₁…q̇₇] in rad/s."
    assert fields["echo"].about.endswith("so it judges the command's age on its own clock.")
    assert describe(m.Header).fields[0].default == 0.0


def test_bounds_are_spelled_out() -> None:
    assert markdown.spelled_out(m.Fraction) == "float, 0 … 1"
    assert markdown.spelled_out(Annotated[float, msgspec.Meta(gt=0.0, le=0.1)]) == "float, more than 0, at most 0.1"
    assert markdown.spelled_out(m.Vector3) == "array of 3 `Metre`"
    assert markdown.spelled_out(tuple[m.Vector3, ...]) == "array of `Vector3`"


def test_what_json_cannot_hold_is_refused() -> None:
    with pytest.raises(MessageError, match="cannot hold"):
        js_type(bytes)


def test_a_document_without_its_blocks_is_refused() -> None:
    with pytest.raises(MessageError, match="lacks the blocks"):
        markdown.fill("# The wire\n")
    with pytest.raises(MessageError, match="asks for the block colours"):
        markdown.fill("<!-- generated: colours -->\n<!-- end -->\n")


def test_the_safety_document_shows_every_transition_and_who_may_cause_it() -> None:
    text = (ROOT / "docs" / "safety.md").read_text(encoding="utf-8")
    for row in ROWS:
        if row.event not in (Event.STOP, Event.FAULT):
            assert f"    {row.before} --> {row.after}: {row.event.value} ({row.who})\n" in text
            assert f"| {row.before} → {row.after} | {row.event.value} | {row.who} |" in text
    assert "| any but ESTOP_LATCHED → ESTOP_LATCHED | stop | anyone |" in text
    assert "| any but FAULT, ESTOP_LATCHED → FAULT | fault | system |" in text


def test_the_document_of_reasons_has_every_text_with_its_values_as_code() -> None:
    text = (ROOT / "docs" / "reasons.md").read_text(encoding="utf-8").split("<!-- generated: reasons -->")[1]
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", text, re.MULTILINE))
    assert list(rows) == sorted(CATALOGUE)
    for code, entry in CATALOGUE.items():
        severity, told, act = rows[code].split(" | ")
        words = re.sub(r"\{\w+:[^}]*\|([^}]*)\}", r"\1", entry.text)
        assert (severity, told.replace("`", ""), act) == (entry.severity, words, entry.act)
        assert not re.search(r"(?<!`)\{|\}(?!`)", told), told


def test_the_diagram_has_every_mode() -> None:
    for mode in SEVERITY:
        assert mode in safety.mode_diagram()
