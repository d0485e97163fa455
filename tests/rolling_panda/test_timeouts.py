"""Time limits of several processes that do not fit together are refused at the start of each."""

import json
import math
import re
import tomllib
from operator import attrgetter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from controller.__main__ import main as controller_main
from rolling_panda import topics
from rolling_panda.bounds import numbers
from rolling_panda.errors import ConfigError
from rolling_panda.generate.__main__ import ROOT
from rolling_panda.generate.safety import section
from rolling_panda.resources import resource
from rolling_panda.timeouts import LIMITS, RELATIONS, Limit, Relation, broken, check, usual_values, values_in

KEYS = [limit for limit in LIMITS.values() if limit.configurable]
CONSTANTS = [limit for limit in LIMITS.values() if not limit.configurable]


def parts(limit: Limit) -> tuple[str, str]:
    """Section and key of a limit of the configuration."""
    name, _, key = limit.name.partition(".")
    return name, key


def written(path: Path, values: dict[str, float]) -> Path:
    """A configuration with these values of limits, by name."""
    tables: dict[str, list[str]] = {}
    for name, value in values.items():
        table, _, key = name.rpartition(".")
        tables.setdefault(table, []).append(f"{key} = {json.dumps(float(value))}\n")
    path.write_text("".join(f"[{table}]\n{''.join(lines)}" for table, lines in tables.items()), encoding="utf-8")
    return path


def span(limit: Limit) -> tuple[float, float]:
    """Smallest and largest value that the program itself allows; a wide span for a value without such a bound."""
    name, key = parts(limit)
    for number in numbers(section(name)()):
        if number.name == key:
            return max(number.bound.low, 1e-3), number.bound.high
    return 1e-2, 1e2


@pytest.mark.parametrize("limit", KEYS, ids=[limit.name for limit in KEYS])
def test_a_key_has_the_usual_value_of_its_section(limit: Limit) -> None:
    name, key = parts(limit)
    assert attrgetter(key)(section(name)()) == limit.usual


@pytest.mark.parametrize("limit", CONSTANTS, ids=[limit.name for limit in CONSTANTS])
def test_a_constant_has_the_value_that_stands_in_the_program(limit: Limit) -> None:
    file, _, name = limit.source.partition(":")
    text = (ROOT / file).read_text(encoding="utf-8")
    if file.endswith("topics.py"):
        entry = getattr(topics, name)
        assert limit.usual == (entry.timeout_s if isinstance(entry, topics.Service) else 1.0 / entry.rate_hz)
    else:
        found = re.search(rf"^(?:const )?{name}(?:: Final)? = ([0-9.]+)", text, re.MULTILINE)
        assert found is not None, f"{file} has no {name}"
        assert limit.usual == float(found[1]) / (1000.0 if name.endswith("_MS") else 1.0)


def test_every_limit_is_in_a_relation_and_every_relation_names_limits() -> None:
    assert {name for relation in RELATIONS for name in (relation.smaller, relation.larger)} == set(LIMITS)


@pytest.mark.parametrize("name", ["sim", "real", "fakes"])
def test_what_is_shipped_fits_together(name: str) -> None:
    check(resource(f"assets/config/{name}.toml"))
    assert broken(usual_values()) == []


def violating(relation: Relation) -> list[dict[str, float]]:
    """Values that break a relation, each by one key alone."""
    values = usual_values()
    smaller, larger = LIMITS[relation.smaller], LIMITS[relation.larger]
    out = []
    if smaller.configurable:
        seconds = 1.01 * larger.seconds(values[larger.name]) / relation.times
        out.append({smaller.name: 1.0 / seconds if smaller.rate else seconds})
    if larger.configurable:
        seconds = 0.99 * relation.times * smaller.seconds(values[smaller.name])
        out.append({larger.name: 1.0 / seconds if larger.rate else seconds})
    if relation.strict and smaller.configurable and larger.configurable:
        out.append({smaller.name: values[larger.name]})
    return out


@pytest.mark.parametrize("relation", RELATIONS, ids=[str(relation) for relation in RELATIONS])
def test_each_violation_is_refused_by_name_with_values_reason_and_remedy(relation: Relation, tmp_path: Path) -> None:
    cases = violating(relation)
    if not cases:
        assert not relation.holds(usual_values() | {relation.smaller: 10.0 * LIMITS[relation.larger].usual})
    for values in cases:
        path = written(tmp_path / "robot.toml", values)
        assert relation in broken(values_in(tomllib.loads(path.read_text(encoding="utf-8"))))
        with pytest.raises(ConfigError) as caught:
            check(path)
        first = broken(usual_values() | values)[0]
        told = str(caught.value)
        (changed,) = values
        assert str(first) in told and first.why in told and changed in told and "To do: " in told


@pytest.mark.long
@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_configuration_within_the_bounds_is_refused_exactly_where_a_relation_does_not_hold(
    data: st.DataObject, tmp_path: Path
) -> None:
    chosen = data.draw(st.lists(st.sampled_from(KEYS), unique_by=lambda limit: limit.name, max_size=6))
    values: dict[str, float] = {}
    for limit in chosen:
        low, high = span(limit)
        values[limit.name] = math.exp(data.draw(st.floats(math.log(low), math.log(high))))
    path = written(tmp_path / "robot.toml", values)

    def seconds(name: str) -> float:
        value = values.get(name, LIMITS[name].usual)
        return 1.0 / value if LIMITS[name].rate else value

    slack = [seconds(each.larger) - each.times * seconds(each.smaller) for each in RELATIONS]
    wrong = any(room < (1e-8 if each.strict else -1e-8) for each, room in zip(RELATIONS, slack, strict=True))
    if wrong:
        with pytest.raises(ConfigError):
            check(path)
    else:
        check(path)


@pytest.mark.parametrize("line", ['fade_s = "soon"', "fade_s = true", "fade_s = -1.0", "fade_s = []"])
def test_what_is_no_time_at_all_is_left_to_the_owner_of_its_section(tmp_path: Path, line: str) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(f"[bridge]\n{line}\n", encoding="utf-8")
    check(path)


def test_a_process_does_not_start_with_limits_of_others_that_do_not_fit(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(
        "[transport]\nconnect_timeout_s = 0.2\n[bridge]\nfade_s = 0.1\ndeadline_s = 0.1\n", encoding="utf-8"
    )
    wire = ["--connect", "tcp/127.0.0.1:9", "--plain-wire", "--state", str(tmp_path)]
    assert controller_main(["--config", str(path), *wire]) == 1
    error: Any = capsys.readouterr().err
    assert "bridge.fade_s < bridge.deadline_s" in error and error.count("\n") == 1
