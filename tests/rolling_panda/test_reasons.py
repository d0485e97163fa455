import ast
import json
import math
import re
from pathlib import Path
from string import Formatter
from typing import get_args

import msgspec
import pytest

from rolling_panda import reasons
from rolling_panda.errors import MessageError
from rolling_panda.messages import Reason

ROOT = Path(reasons.__file__).resolve().parents[1]


#: A reason that the page makes: its code, and its values as an object literal.
MADE_BY_PAGE = re.compile(r'\breason\(\s*"(\w+)"(?:,\s*\{([^}]*)\})?')


def made_by_page() -> dict[str, set[str]]:
    """Names of the values of each reason that the page makes itself."""
    found = {}
    for path in (ROOT / "web").rglob("*.js"):
        for code, values in MADE_BY_PAGE.findall(path.read_text(encoding="utf-8")):
            found[code] = {each.split(":")[0].strip() for each in values.split(",") if each.strip()}
    return found


def made_by_product() -> set[str]:
    """Codes that a process makes."""
    packages = ("bridge", "controller", "labelling", "perception", "recorder", "rolling_panda", "server")
    paths = [path for package in packages for path in (ROOT / package).rglob("*.py")]
    texts = (path.read_text(encoding="utf-8") for path in paths if path != Path(reasons.__file__))
    return set().union(*(made_in(text) for text in texts))


def made_in(source: str) -> set[str]:
    """Codes that a file makes: it calls them, by a name that it has given them too, or hands them to what calls them.

    A reason that is compared with another one is not made there.
    """
    tree = ast.parse(source)
    imports = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module == reasons.__name__)
    held = {each.asname or each.name: {each.name} for node in imports for each in node.names}
    compared = {id(each) for node in ast.walk(tree) if isinstance(node, ast.Compare) for each in ast.walk(node)}

    def codes(expression: ast.expr) -> set[str]:
        """The codes in an expression that are not called in it."""
        if isinstance(expression, ast.Call):
            return set()
        if isinstance(expression, ast.Attribute) and ast.unparse(expression.value) == "reasons":
            return {expression.attr}
        if isinstance(expression, ast.Name):
            return held.get(expression.id, set())
        children = (each for each in ast.iter_child_nodes(expression) if isinstance(each, ast.expr))
        return set().union(*(codes(each) for each in children))

    for node in ast.walk(tree):
        if isinstance(node, ast.Assign | ast.AnnAssign | ast.NamedExpr) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found = codes(node.value)
        elif isinstance(node, ast.For):
            targets, found = [node.target], codes(node.iter)
        else:
            continue
        for name in (each for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)):
            held[name.id] = held.get(name.id, set()) | found
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and id(node) not in compared]
    return set().union(*(codes(each) for call in calls for each in (call.func, *call.args)))


def values_of(code: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(reasons.CATALOGUE[code].text) if name}


@pytest.mark.long
def test_every_code_is_made_by_the_product():
    assert set(reasons.CATALOGUE) <= made_by_product() | set(made_by_page()), "reasons that nobody makes"


@pytest.mark.parametrize(
    ("source", "made"),
    [
        ("reasons.homing()", {"homing"}),
        ("why(reasons.done if ok else reasons.homing)", {"done", "homing"}),
        ("(reasons.done if ok else reasons.homing)(now)", {"done", "homing"}),
        ("told, other = reasons.done, reasons.homing\ntold()", {"done", "homing"}),
        ("TOLD = {1: reasons.done}\nTOLD[1]('ada')", {"done"}),
        ("for code, told in (('a', reasons.done),):\n    told()", {"done"}),
        ("from rolling_panda.reasons import said\nsaid('-')", {"said"}),
        ("from rolling_panda.reasons import said", set()),
        ("told = reasons.done", set()),
        ("reason == reasons.done()", set()),
        ("reason.code == reasons.done.__name__", set()),
    ],
)
def test_a_code_is_made_by_a_call_and_not_by_its_name(source, made):
    assert made_in(source) == made


def test_the_page_makes_only_reasons_of_the_catalogue_with_all_of_their_values():
    made = made_by_page()
    assert "no_link" in made
    scripts = [path.read_text(encoding="utf-8") for path in (ROOT / "web").rglob("*.js")]
    # Not by a variable, which would be found neither here nor by a search. One is the function itself.
    assert sum(len(re.findall(r'\breason\((?!")', script)) for script in scripts) == 1
    for code, values in made.items():
        assert values == values_of(code), code


def test_the_page_has_every_reason():
    rows = json.loads((ROOT / "web" / "text" / "reasons.en.json").read_text(encoding="utf-8"))
    assert rows == {entry.code: [entry.severity, entry.text, entry.act] for entry in reasons.CATALOGUE.values()}


@pytest.mark.parametrize("entry", reasons.CATALOGUE.values(), ids=reasons.CATALOGUE)
def test_a_reason_has_a_severity_a_text_and_advice_or_explicitly_none(entry):
    assert entry.severity in get_args(reasons.Severity)
    assert re.fullmatch(r"[a-z][a-z0-9_]*", entry.code)
    assert re.match(r"[A-Z{]", entry.text) and not entry.text.endswith((".", ":", " "))
    assert entry.act == entry.act.strip() and not entry.act.endswith(".")


def test_a_text_names_exactly_the_values():
    def lacks(user: str) -> None:
        """Somebody holds control."""

    def invents() -> None:
        """{user} holds control."""

    for wrong in (lacks, invents):
        with pytest.raises(MessageError, match=wrong.__name__):
            reasons.entry_of("info", "wait", wrong)


def test_a_reason_survives_the_wire_and_has_its_values_in_the_text():
    reason = reasons.wrong_mode("Home", "READY", mode="IDLE")
    assert reason == Reason(code="wrong_mode", values=(("command", "Home"), ("modes", "READY"), ("mode", "IDLE")))
    assert msgspec.json.decode(msgspec.json.encode(reason), type=Reason) == reason
    text = reasons.text_of(reason)
    assert all(str(value) in text for _, value in reason.values)


def test_words_go_with_their_number():
    one, three = (reasons.text_of(reasons.renewal_cut(others)) for others in (1, 3))
    assert "with 1 other cane, just" in one and "with 3 other canes, just" in three


def test_a_cause_is_data_too_and_its_text_stands_in_the_place_of_the_value():
    reason = reasons.said(reasons.control_held("ada"))
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(reason), type=Reason) == reason
    assert reasons.text_of(reason) == reasons.text_of(reasons.control_held("ada"))


def test_values_are_kept_within_the_bounds_of_the_wire():
    for value in ("x" * 999, math.inf, -math.inf, math.nan):
        reason = reasons.said(value)
        assert msgspec.json.decode(msgspec.json.encode(reason), type=Reason) == reason


@pytest.mark.parametrize("reason", [Reason(code="of-tomorrow", values=(("n", 3.0),)), Reason(code="control_held")])
def test_a_reason_of_another_version_is_shown_as_it_is(reason):
    assert reason.code in reasons.text_of(reason)


def test_a_number_has_a_format_and_nothing_else_has_one():
    tree = ast.parse(Path(reasons.__file__).read_text(encoding="utf-8"))
    made = [each for each in tree.body if isinstance(each, ast.FunctionDef) and each.name in reasons.CATALOGUE]
    assert len(made) == len(reasons.CATALOGUE)
    for function in made:
        found = [
            (name, form or "") for _, name, form, _ in Formatter().parse(reasons.CATALOGUE[function.name].text) if name
        ]
        formats = {name: form for name, form in found if "|" not in form}
        # Words for one and for several go with a number that is told.
        assert {name for name, form in found if "|" in form} <= {name for name, form in formats.items() if form}
        for argument in function.args.args:
            is_number = ast.unparse(argument.annotation) == "float"
            assert bool(re.fullmatch(r"\.\df|g", formats[argument.arg])) == is_number, (function.name, argument.arg)
            assert is_number or not formats[argument.arg], (function.name, argument.arg)
        assert not any(conversion for _, _, _, conversion in Formatter().parse(reasons.CATALOGUE[function.name].text))
