"""Languages of the page: those that `web/text/` has files of, and what one lacks that English has, or the reverse."""

import json
import re
from pathlib import Path
from typing import Final

ENGLISH: Final = "en"
#: Both files of a language: `page.en.json` and `reasons.en.json`.
_FILES: Final = ("page", "reasons")
#: Plural forms of CLDR. A language has those of `Intl.PluralRules`, at least `other`.
_FORM: Final = re.compile(r"\.(zero|one|two|few|many|other)$")


def languages(folder: Path) -> tuple[str, ...]:
    """The languages that a folder has files of, English first."""
    found = {path.name.split(".")[1] for name in _FILES for path in folder.glob(f"{name}.*.json")}
    return (ENGLISH, *sorted(found - {ENGLISH}))


def languages_module(folder: Path) -> str:
    """Text of `web/js/state/languages.js`."""
    return (
        "// Made by `python -m rolling_panda.generate --write` from the files in `web/text/`.\n\n"
        "/** Languages of the page; the first is the one without a preference. @type {readonly string[]} */\n"
        f"export const LANGUAGES = Object.freeze({json.dumps(languages(folder))});\n"
    )


def problems(folder: Path) -> list[str]:
    """Where the files of a language have another key, severity or placeholder than the English ones."""
    found: list[str] = []
    for language in languages(folder)[1:]:
        for name in _FILES:
            file = f"{name}.{language}.json"
            if (folder / file).exists():
                english, other = (_read(folder / f"{name}.{each}.json") for each in (ENGLISH, language))
                found.extend(f"{file}: {problem}" for problem in _differences(english, other))
            else:
                found.append(f"{file} is missing")
    return found


def _read(path: Path) -> dict[str, list[str]]:
    rows = json.loads(path.read_text(encoding="utf-8"))
    return {key: ["", row, ""] if isinstance(row, str) else row for key, row in rows.items()}


def _differences(english: dict[str, list[str]], other: dict[str, list[str]]) -> list[str]:
    groups = {_FORM.sub("", key) for key in english}
    counted = {group for group in groups if {f"{group}.one", f"{group}.other"} <= english.keys()}
    forms = {match[1] for key in other if (match := _FORM.search(key)) and _FORM.sub("", key) in counted} | {"other"}
    # What each key has to correspond to in English.
    wanted = {key: key for key in english if _FORM.sub("", key) not in counted}
    wanted |= {f"{group}.{form}": f"{group}.other" for group in counted for form in forms}
    found = [f"{key} is missing" for key in sorted(wanted.keys() - other.keys())]
    found += [f"{key} is not in English" for key in sorted(other.keys() - wanted.keys())]
    for key in sorted(wanted.keys() & other.keys()):
        # A plural form may say the count in words.
        unsaid = {"{count}"} if _FORM.sub("", key) in counted else set[str]()
        found += [f"{key}: {why}" for why in _changes(english[wanted[key]], other[key], unsaid)]
    return found


def _changes(english: list[str], other: list[str], unsaid: set[str]) -> list[str]:
    (severity, *texts), (their_severity, *their_texts) = english, other
    found = [] if severity == their_severity else [f"its severity is {severity}"]
    for text, theirs in zip(texts, their_texts, strict=True):
        found += [f"it lacks {name}" for name in sorted(_placeholders(text) - _placeholders(theirs) - unsaid)]
        found += [f"it has {name} too many" for name in sorted(_placeholders(theirs) - _placeholders(text))]
        found += [f"it has {words}, which are not one and several of a value" for words in _wrong_words(text, theirs)]
        found += ["a text is empty"] if bool(text) and not theirs else []
    return found


def _placeholders(text: str) -> set[str]:
    return {found for found in re.findall(r"\{[^}]*\}", text) if "|" not in found}


def _wrong_words(english: str, theirs: str) -> list[str]:
    """Words that go with a number, as `{canes:tralcio|tralci}`; a language has its own."""
    values = {re.split(r"\W", found[1:])[0] for found in _placeholders(english)}
    words = [found for found in re.findall(r"\{[^}]*\}", theirs) if "|" in found]
    return [each for each in words if each[1:].split(":")[0] not in values or each.count("|") != 1]
