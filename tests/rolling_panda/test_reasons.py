import ast
import math
import re
from pathlib import Path
from string import Formatter

import msgspec
import pytest

from rolling_panda import reasons
from rolling_panda.errors import MessageError
from rolling_panda.messages import Reason

ROOT = Path(reasons.__file__).resolve().parents[1]


def test_every_code_is_used_by_the_product():
    used = set()
    for package in ("bridge", "controller", "perception", "recorder", "rolling_panda", "server"):
        for path in (ROOT / package).rglob("*.py"):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            used |= {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
            used |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert reasons.CATALOGUE and set(reasons.CATALOGUE) <= used


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
        formats = {name: form for _, name, form, _ in Formatter().parse(reasons.CATALOGUE[function.name].text) if name}
        for argument in function.args.args:
            is_number = ast.unparse(argument.annotation) == "float"
            assert bool(re.fullmatch(r"\.\df|g", formats[argument.arg])) == is_number, (function.name, argument.arg)
            assert is_number or not formats[argument.arg], (function.name, argument.arg)
        assert not any(conversion for _, _, _, conversion in Formatter().parse(reasons.CATALOGUE[function.name].text))
