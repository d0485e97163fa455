"""The languages of the page: found from their files, which `make check` compares with the English ones."""

import json
from pathlib import Path
from typing import Any

import pytest

from rolling_panda.generate import __main__ as generate
from rolling_panda.generate.languages import languages, languages_module, problems

PAGE = {"home": "Home", "asks": "{user} asks", "points.one": "{count} point", "points.other": "{count} points"}
REASONS = {"stale": ["error", "{age:.1f} s old", "wait"], "done": ["info", "Done", ""]}
THEIR_PAGE = {
    "home": "Dom",
    "asks": "prosi {user}",
    "points.one": "jeden punkt",
    "points.few": "{count} punkty",
    "points.other": "{count} punktu",
}
THEIR_REASONS = {"stale": ["error", "sprzed {age:.1f} s", "czekaj"], "done": ["info", "Gotowe", ""]}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, rows in (("page", PAGE), ("reasons", REASONS)):
        (tmp_path / f"{name}.en.json").write_text(json.dumps(rows), encoding="utf-8")
    return tmp_path


def translated(folder: Path, page: dict[str, Any], reasons: dict[str, Any]) -> list[str]:
    for name, rows in (("page", THEIR_PAGE | page), ("reasons", THEIR_REASONS | reasons)):
        kept = {key: row for key, row in rows.items() if row is not None}
        (folder / f"{name}.pl.json").write_text(json.dumps(kept), encoding="utf-8")
    return problems(folder)


def test_a_language_is_one_that_has_files(folder: Path) -> None:
    assert languages(folder) == ("en",) and problems(folder) == []
    assert translated(folder, {}, {}) == []
    assert languages(folder) == ("en", "pl")
    assert '["en", "pl"]' in languages_module(folder)


def test_a_language_needs_both_files(folder: Path) -> None:
    translated(folder, {}, {})
    (folder / "reasons.pl.json").unlink()
    assert problems(folder) == ["reasons.pl.json is missing"]


@pytest.mark.parametrize(
    ("page", "reasons", "problem"),
    [
        ({"home": None}, {}, "page.pl.json: home is missing"),
        ({"house": "Dom"}, {}, "page.pl.json: house is not in English"),
        ({"home": "Dom {user}"}, {}, "page.pl.json: home: it has {user} too many"),
        ({"asks": "prosi"}, {}, "page.pl.json: asks: it lacks {user}"),
        ({"home": ""}, {}, "page.pl.json: home: a text is empty"),
        ({"points.other": None}, {}, "page.pl.json: points.other is missing"),
        ({}, {"done": None}, "reasons.pl.json: done is missing"),
        ({}, {"gone": ["info", "Nie ma", ""]}, "reasons.pl.json: gone is not in English"),
        ({}, {"done": ["error", "Gotowe", ""]}, "reasons.pl.json: done: its severity is info"),
        (
            {},
            {"stale": ["error", "sprzed {age:.1f} s", "{age:.1f}"]},
            "reasons.pl.json: stale: it has {age:.1f} too many",
        ),
        ({}, {"stale": ["error", "sprzed {age:.1f} s", ""]}, "reasons.pl.json: stale: a text is empty"),
        *(
            (
                {},
                {"stale": ["error", f"sprzed {{age:.1f}} {words}", "czekaj"]},
                f"reasons.pl.json: stale: it has {words}, which are not one and several of a value",
            )
            for words in ("{ages:sekundy|sekund}", "{age:a|b|c}")
        ),
    ],
)
def test_what_differs_from_english_is_told(
    folder: Path, page: dict[str, Any], reasons: dict[str, Any], problem: str
) -> None:
    assert translated(folder, page, reasons) == [problem]


def test_a_language_has_words_for_one_and_several_where_it_needs_them(folder: Path) -> None:
    assert translated(folder, {}, {"stale": ["error", "sprzed {age:.1f} {age:sekundy|sekund}", "czekaj"]}) == []


def test_another_format_of_a_number_is_told(folder: Path) -> None:
    found = translated(folder, {}, {"stale": ["error", "sprzed {age} s", "czekaj"]})
    assert found == ["reasons.pl.json: stale: it lacks {age:.1f}", "reasons.pl.json: stale: it has {age} too many"]


def test_every_counted_text_has_the_same_plural_forms(folder: Path) -> None:
    rows = PAGE | {"vines.one": "{count} vine", "vines.other": "{count} vines"}
    (folder / "page.en.json").write_text(json.dumps(rows), encoding="utf-8")
    vines = {"vines.one": "{count} krzew", "vines.other": "{count} krzewu"}
    assert translated(folder, vines, {}) == ["page.pl.json: vines.few is missing"]


def test_make_check_fails_for_a_difference(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("rolling_panda.generate.languages.problems", lambda folder: ["page.pl.json: home is missing"])
    assert generate.main(["--check"]) == 1
    assert "web/text/page.pl.json: home is missing" in capsys.readouterr().err
