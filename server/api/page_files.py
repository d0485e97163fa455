"""The page's static files: minified scripts, one bundled stylesheet, and preloads, cached in memory at the start.

Scripts are sent without comments, types and indentation, which are a third of them. The stylesheets block the first
paint and are bundled. The page preloads all its scripts, so that the browser requests them at once. Scripts, stylesheet
and texts are compressed for browsers that take it, which is all of them: a vineyard's link is slow.
"""

import gzip
import hashlib
import re
from pathlib import Path, PurePosixPath

from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

#: A JSDoc type cast beside code; the cast expression follows in parentheses.
_TYPE = re.compile(r"/\*\* @type [^*`]*\*/ ?")
_STYLESHEET = re.compile(r'^ *<link rel="stylesheet" href="([\w./-]+\.css)">\n', re.MULTILINE)
_SCRIPT = re.compile(r'^( *)<script type="module" src="([\w./-]+\.js)"></script>\n', re.MULTILINE)
#: A static import; dynamic ones, `import(…)`, are not preloaded.
_IMPORT = re.compile(r'^(?:import|export) (?:[^"(]* from )?"(\.[\w./-]+\.js)";', re.MULTILINE)
_STYLES = "page.css"
_MEDIA_TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html", ".json": "application/json"}


class PageFiles(StaticFiles):
    """A folder of files: scripts, texts, the bundled stylesheet and the page are cached. Scripts keep their lines."""

    def __init__(self, folder: Path) -> None:
        """Read `folder`, which has the page's `index.html`."""
        super().__init__(directory=folder)
        scripts = {
            file.relative_to(folder).as_posix(): minified(file.read_text(encoding="utf-8"))
            for file in sorted(folder.rglob("*.js"))
        }
        page = (folder / "index.html").read_text(encoding="utf-8")
        styles = (folder / name for name in _STYLESHEET.findall(page))
        cached = {
            **scripts,
            **{f"text/{file.name}": file.read_text(encoding="utf-8") for file in (folder / "text").glob("*.json")},
            # It lies one folder higher than they do.
            _STYLES: "\n".join(style.read_text(encoding="utf-8") for style in styles).replace('url("../', 'url("'),
            "index.html": with_preloads(page, scripts),
        }
        self._cache = {name: text.encode() for name, text in cached.items()}
        self._compressed = {name: gzip.compress(content, mtime=0) for name, content in self._cache.items()}
        # Weak: the same for both forms.
        self._etags = {name: f'W/"{hashlib.sha256(content).hexdigest()[:32]}"' for name, content in self._cache.items()}

    async def get_response(self, path: str, scope: Scope) -> Response:
        """The file, or 304 where it has not changed."""
        if path not in self._cache or scope["method"] not in ("GET", "HEAD"):
            return await super().get_response(path, scope)
        return self.cached(path, scope)

    def cached(self, name: str, scope: Scope) -> Response:
        """A cached file, or 304 where it has not changed.

        Raises:
            KeyError: It is not cached.
        """
        asked = dict(scope["headers"])
        headers = {"ETag": self._etags[name], "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
        if asked.get(b"if-none-match", b"").decode("latin-1") == headers["ETag"]:
            return Response(status_code=304, headers=headers)
        content = self._cache[name]
        if b"gzip" in asked.get(b"accept-encoding", b""):
            headers["Content-Encoding"], content = "gzip", self._compressed[name]
        return Response(content, media_type=_MEDIA_TYPES[PurePosixPath(name).suffix], headers=headers)

    def holds(self, path: str) -> bool:
        """Whether a path of the page is that of a cached script, text or stylesheet."""
        return not path.endswith(".html") and path[1:] in self._cache


def with_preloads(page: str, scripts: dict[str, str]) -> str:
    """The page with the bundled stylesheet and a preload of each script."""
    first, found = _STYLESHEET.search(page), _SCRIPT.search(page)
    if first is None or found is None:
        return page
    indent, entry = found.groups()
    preloads = "".join(f'{indent}<link rel="modulepreload" href="{name}">\n' for name in imports_of(entry, scripts))
    bundle = f'{indent}<link rel="stylesheet" href="{_STYLES}">\n'
    bundled = page[: first.start()] + bundle + _STYLESHEET.sub("", page[first.end() :])
    return _SCRIPT.sub(lambda script: script[0] + preloads, bundled, count=1)


def imports_of(entry: str, scripts: dict[str, str]) -> list[str]:
    """The scripts that a script imports, directly and indirectly, in breadth-first order."""
    order = [entry]
    for name in order:
        for imported in _IMPORT.findall(scripts[name]):
            path = _resolved(PurePosixPath(name).parent, imported)
            if path not in order:
                order.append(path)
    return order[1:]


def _resolved(folder: PurePosixPath, path: str) -> str:
    parts = list(folder.parts)
    for part in path.split("/"):
        if part == "..":
            parts.pop()
        elif part != ".":
            parts.append(part)
    return "/".join(parts)


def minified(script: str) -> str:
    """A script without indentation and comment lines, which become empty.

    Of the comments beside code only type casts are removed. A template literal has to end on its first line.
    """
    lines, inside = [], False
    for line in script.split("\n"):
        bare = line.strip()
        starts_comment = not inside and bare.startswith("/*")
        if starts_comment and "*/" in bare and not bare.endswith("*/"):
            starts_comment = False
        comment = inside or starts_comment or bare.startswith("//")
        if inside or starts_comment:
            inside = "*/" not in bare
        lines.append("" if comment else _TYPE.sub("", bare))
    return "\n".join(lines)
