"""The operator's short guide as pages beside the operator's page: from `docs/guide-short.LANGUAGE.md`."""

from pathlib import Path
from typing import Final

from markdown_it import MarkdownIt

from rolling_panda.errors import MessageError

_PAGE: Final = """\
<!doctype html>
<!-- Made by `python -m rolling_panda.generate --write` from docs/guide-short.{language}.md. -->
<html lang="{language}">
  <head>
    <meta charset="utf-8">
    <meta name="viewport" content="width=device-width, initial-scale=1">
    <meta name="color-scheme" content="light dark">
    <title>{title} · Rolling Panda</title>
    <link rel="icon" href="../icon.svg" type="image/svg+xml">
    <link rel="stylesheet" href="../css/base.css">
    <link rel="stylesheet" href="../css/guide.css">
  </head>
  <body class="guide">
{content}  </body>
</html>
"""


def guides(root: Path) -> dict[Path, str]:
    """The text of the guide's page in each language that a checkout has it in."""
    sources = sorted((root / "docs").glob("guide-short.*.md"))
    return {root / "web" / "guide" / f"{language_of(path)}.html": _page(path) for path in sources}


def problems(root: Path, languages: tuple[str, ...]) -> list[str]:
    """Languages of the page that the guide lacks, and the reverse."""
    written = {language_of(path) for path in (root / "docs").glob("guide-short.*.md")}
    found = [f"docs/guide-short.{each}.md is missing" for each in languages if each not in written]
    return found + [f"docs/guide-short.{each}.md: the page has no {each}" for each in sorted(written - {*languages})]


def language_of(path: Path) -> str:
    """The language of a guide's source."""
    return path.name.split(".")[1]


def _page(path: Path) -> str:
    # Markup in the source is shown as text.
    markdown, text = MarkdownIt("commonmark", {"html": False}).enable("table"), path.read_text(encoding="utf-8")
    first, _, _ = text.partition("\n")
    if not first.startswith("# "):
        raise MessageError(f"{path.name} begins with {first!r}; it has to begin with its title, `# …`")
    return _PAGE.format(language=language_of(path), title=first.removeprefix("# "), content=markdown.render(text))
