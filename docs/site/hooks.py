"""Pages of the site: the documents of the repository, and an API reference with a page for each folder of code.

MkDocs knows a document by its path in the repository, so that one relative link is right in both places. Its address on
the site is shorter.
"""

import ast
import logging
import posixpath
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from mode_diagram import draw

ROOT = Path(__file__).resolve().parents[2]
#: In the order of the API reference. Benchmarks and tests are no interface.
PACKAGES = ("rolling_panda", "bridge", "controller", "perception", "server", "recorder", "labelling")
#: Folders whose files a text may name only if they exist.
NAMED = {*PACKAGES, "assets", "benchmarks", "deploy", "docs", "tests", "web"}
#: Where documents outside `docs/` are on the site.
OUTSIDE = {
    "README.md": "index.html",
    "ARCHITECTURE.md": "architecture.html",
    "CONTRIBUTING.md": "contributing.html",
    "CHANGELOG.md": "changelog.html",
    "SECURITY.md": "security.html",
    "assets/network/vine.md": "network.html",
    "benchmarks/README.md": "benchmarks/index.html",
    "web/icon.svg": "icon.svg",
}
#: A file or folder of code, named in a text and not in a link.
_MENTION = re.compile(r"(?<!<a href=.)<code>((?:\w+/)+(?:\w+\.py)?)</code>")

#: What a page loads, unlike what it links to.
_LOADED = re.compile(r"""<(?:script|img|iframe|link)\b[^>]*\b(?:src|href)=["']?(https?:)?//([^"'\s>]+)""")

log = logging.getLogger("mkdocs.hooks.pages")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Names every document by its path in the repository, adds the API reference, and fills the navigation."""
    for file in [file for file in files if file.src_dir == config.docs_dir]:
        files.remove(file)
        address = file.dest_uri.removeprefix("site/").replace("README.html", "index.html")
        files.append(_document(f"docs/{file.src_uri}", address, config))
    measured = {name: name.replace(".md", ".html") for name in _texts("benchmarks")}
    for name, address in (measured | OUTSIDE).items():
        files.append(_document(name, address, config))
    files.append(File.generated(config, "reference/index.md", content="".join(_contents())))
    for package in PACKAGES:
        for folder in _folders(package):
            files.append(File.generated(config, _uri(folder), content="".join(_reference(folder))))
    _fill(config.nav)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Hides the list of pages beside the first one, and draws diagrams.

    In the search, texts come before the API reference.
    """
    if page.is_homepage:
        page.meta["hide"] = ["navigation"]
    if not page.file.src_uri.startswith("reference/"):
        page.meta["search"] = {"boost": 3}

    def drawn(diagram: re.Match[str]) -> str:
        svg, missing = draw(diagram[1])
        if missing:
            log.warning("'%s': docs/site/mode_diagram.py has no place for %s", page.file.src_uri, sorted(missing))
        return f'<div class="diagram">{svg}</div>'

    return re.sub(r"^```mermaid\n(.*?)^```$", drawn, markdown, flags=re.DOTALL | re.MULTILINE)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links the files and folders of code that a text names to the API reference."""

    def linked(mention: re.Match[str]) -> str:
        name = mention[1]
        path = ROOT / name
        if name.split("/")[0] in NAMED and not path.exists() and page.file.src_uri != "CHANGELOG.md":
            log.warning("'%s' names '%s', which the repository does not have", page.file.src_uri, name)
        folder = path if name.endswith("/") else path.parent
        target = files.get_file_from_path(_uri(folder)) if ROOT in folder.parents else None
        if target is None or target == page.file:
            return mention[0]
        address = target.url_relative_to(page.file)
        if path != folder and not path.stem.startswith("__"):
            address += "#" + name.removesuffix(".py").replace("/", ".")
        return f'<a class="code" href="{address}">{mention[0]}</a>'

    return _MENTION.sub(linked, html)


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Warns of what a page would load from a foreign host."""
    for loaded in _LOADED.finditer(output):
        log.warning("'%s' loads from '%s'", page.file.src_uri, loaded[2])
    return output


def _document(name: str, address: str, config: MkDocsConfig) -> File:
    return File(name, str(ROOT), config.site_dir, use_directory_urls=False, dest_uri=address)


def _texts(folder: str) -> list[str]:
    """The documents of a folder, its README first."""
    paths = sorted((ROOT / folder).glob("*.md"), key=lambda path: (path.stem != "README", path))
    return [f"{folder}/{path.name}" for path in paths]


def _folders(package: str) -> Iterator[Path]:
    for module in sorted((ROOT / package).rglob("__init__.py")):
        yield module.parent


def _uri(folder: Path) -> str:
    name = folder.relative_to(ROOT).as_posix()
    return f"reference/{name}.md" if "/" in name else f"reference/{name}/index.md"


def _fill(nav: list[Any]) -> None:
    """Puts the pages that are not listed one by one into the empty sections of the navigation."""
    for entry in nav:
        for title, pages in entry.items():
            if title == "Decisions":
                pages += _texts("docs/decisions")
            elif title == "Measure":
                pages += _texts("benchmarks")
            elif title == "API reference":
                pages += ["reference/index.md"]
                pages += [{package: [_entry(folder, package) for folder in _folders(package)]} for package in PACKAGES]
            elif isinstance(pages, list):
                _fill(pages)


def _entry(folder: Path, package: str) -> str | dict[str, str]:
    """The page of a package is that of its section; the others are named without the package."""
    name = _name(folder)
    return _uri(folder) if name == package else {name.removeprefix(f"{package}."): _uri(folder)}


def _contents() -> Iterator[str]:
    yield "# API reference\n\n"
    yield "Each page has the modules of one folder. `rolling_panda` is what the other packages share.\n\n"
    for package in PACKAGES:
        yield f"## {package}\n\n"
        yield from _table("folder", [(_name(path), _uri(path), path / "__init__.py") for path in _folders(package)])


def _reference(folder: Path) -> Iterator[str]:
    name = _name(folder)
    modules = [path for path in sorted(folder.glob("*.py")) if not path.stem.startswith("__")]
    yield f"# {name}\n\n{_docstring(folder / '__init__.py')}\n\n"
    inner = sorted(folder.glob("*/__init__.py"))
    if inner:
        yield from _table("folder", [(_name(path.parent), _uri(path.parent), path) for path in inner], _uri(folder))
    if modules:
        yield from _table("module", [(path.stem, f"#{name}.{path.stem}", path) for path in modules])
    for path in modules:
        yield f"::: {name}.{path.stem}\n\n"


def _table(kind: str, rows: list[tuple[str, str, Path]], here: str = "reference/index.md") -> Iterator[str]:
    yield f"| {kind} | content |\n|---|---|\n"
    for name, target, path in rows:
        link = target if target.startswith("#") else posixpath.relpath(target, posixpath.dirname(here))
        summary = " ".join(_docstring(path).split("\n\n")[0].split()).replace("|", "\\|")
        yield f"| [`{name}`]({link}) | {summary} |\n"
    yield "\n"


def _name(folder: Path) -> str:
    return ".".join(folder.relative_to(ROOT).parts)


def _docstring(path: Path) -> str:
    return ast.get_docstring(ast.parse(path.read_text())) or ""
