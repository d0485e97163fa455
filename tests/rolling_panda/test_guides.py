"""The operator's short guide: a page beside the operator's page, in every language of the page."""

from pathlib import Path

import pytest

from rolling_panda.errors import MessageError
from rolling_panda.generate import __main__ as generate
from rolling_panda.generate.guides import guides, problems


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "docs").mkdir()
    source = "# Kurz\n\n1. **Stopp** & <b>Halt</b>\n\n| a | b |\n|---|---|\n| 1 | 2 |\n"
    (tmp_path / "docs" / "guide-short.de.md").write_text(source, encoding="utf-8")
    return tmp_path


def test_a_guide_is_a_page_in_its_language(root: Path) -> None:
    ((path, text),) = guides(root).items()
    assert path == root / "web" / "guide" / "de.html"
    assert '<html lang="de">' in text and "<title>Kurz · Rolling Panda</title>" in text
    assert "<strong>Stopp</strong> &amp; &lt;b&gt;Halt&lt;/b&gt;" in text and "<td>1</td>" in text


def test_a_guide_begins_with_its_title(root: Path) -> None:
    (root / "docs" / "guide-short.de.md").write_text("Kurz\n", encoding="utf-8")
    with pytest.raises(MessageError, match=r"guide-short.de.md begins with 'Kurz'"):
        guides(root)


def test_every_language_of_the_page_needs_a_guide(root: Path) -> None:
    assert problems(root, ("de",)) == []
    assert problems(root, ("de", "it")) == ["docs/guide-short.it.md is missing"]
    assert problems(root, ()) == ["docs/guide-short.de.md: the page has no de"]


def test_make_check_fails_for_a_missing_guide(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("rolling_panda.generate.languages.languages", lambda folder: ("en", "pl"))
    monkeypatch.setattr("rolling_panda.generate.__main__.stale", lambda: [])
    assert generate.main(["--check"]) == 1
    assert "docs/guide-short.pl.md is missing" in capsys.readouterr().err
