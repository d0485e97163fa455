"""The page's files as they are sent: read once at the start, few of them, and small.

Scripts go without comments, types and indentation, a third of them. The stylesheets, for which the first paint waits,
go as one, and the page names all its scripts, so that the browser asks for them at once and not one after the other.
"""

import hashlib
import re
from pathlib import Path, PurePosixPath

from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send

#: A type for the type checker beside code; what it is about stands in parentheses after it.
_TYPE = re.compile(r"/\*\* @type [^*`]*\*/ ?")
_STYLESHEET = re.compile(r'^ *<link rel="stylesheet" href="([\w./-]+\.css)">\n', re.MULTILINE)
_SCRIPT = re.compile(r'^( *)<script type="module" src="([\w./-]+\.js)"></script>\n', re.MULTILINE)
#: What a script needs before it runs; what it imports later, with `import(…)`, is not among it.
_IMPORT = re.compile(r'^(?:import|export) (?:[^"(]* from )?"(\.[\w./-]+\.js)";', re.MULTILINE)
_STYLES = "page.css"
_KINDS = {".js": "text/javascript", ".css": "text/css", ".html": "text/html"}


class PageFiles(StaticFiles):
    """A folder of files, of which scripts, the joined stylesheet and the page are kept. Scripts keep their lines."""

    def __init__(self, folder: Path) -> None:
        """Read `folder`, which has the page's `index.html`."""
        super().__init__(directory=folder)
        scripts = {
            file.relative_to(folder).as_posix(): as_sent(file.read_text(encoding="utf-8"))
            for file in sorted(folder.rglob("*.js"))
        }
        page = (folder / "index.html").read_text(encoding="utf-8")
        styles = (folder / name for name in _STYLESHEET.findall(page))
        self._kept = {
            **scripts,
            _STYLES: "\n".join(style.read_text(encoding="utf-8") for style in styles),
            "index.html": hastened(page, scripts),
        }
        self._tags = {name: f'"{hashlib.sha256(text.encode()).hexdigest()[:32]}"' for name, text in self._kept.items()}

    async def get_response(self, path: str, scope: Scope) -> Response:
        """The file, or that it has not changed."""
        if path not in self._kept or scope["method"] not in ("GET", "HEAD"):
            return await super().get_response(path, scope)
        return self.kept(path, scope)

    def kept(self, name: str, scope: Scope) -> Response:
        """One of the files that are kept, or that it has not changed.

        Raises:
            KeyError: It is none of them.
        """
        headers = {"ETag": self._tags[name], "Cache-Control": "no-cache"}
        asked = dict(scope["headers"]).get(b"if-none-match", b"").decode("latin-1")
        if asked == headers["ETag"]:
            return Response(status_code=304, headers=headers)
        return Response(self._kept[name], media_type=_KINDS[PurePosixPath(name).suffix], headers=headers)

    def before(self, app: ASGIApp) -> ASGIApp:
        """`app`, which is not asked for scripts and stylesheet: its many routes cost more than the file."""
        quick = {f"/{name}" for name in self._kept if not name.endswith(".html")}

        async def either(scope: Scope, receive: Receive, send: Send) -> None:
            if scope["type"] == "http" and scope["method"] in ("GET", "HEAD") and scope["path"] in quick:
                await self.kept(scope["path"][1:], scope)(scope, receive, send)
            else:
                await app(scope, receive, send)

        return either


def hastened(page: str, scripts: dict[str, str]) -> str:
    """The page with one stylesheet in place of its several, and with its scripts named in the order of their need."""
    first, found = _STYLESHEET.search(page), _SCRIPT.search(page)
    if first is None or found is None:
        return page
    indent, entry = found.groups()
    preloads = "".join(f'{indent}<link rel="modulepreload" href="{name}">\n' for name in needed(entry, scripts))
    one = f'{indent}<link rel="stylesheet" href="{_STYLES}">\n'
    joined = page[: first.start()] + one + _STYLESHEET.sub("", page[first.end() :])
    return _SCRIPT.sub(lambda script: script[0] + preloads, joined, count=1)


def needed(entry: str, scripts: dict[str, str]) -> list[str]:
    """What a script imports, and what that imports, without itself: the nearest first."""
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


def as_sent(script: str) -> str:
    """A script in which lines that are nothing but comment are empty, and no line is indented.

    Of comments beside code only types go. A template literal has to end on the line where it begins.
    """
    lines, inside = [], False
    for line in script.split("\n"):
        bare = line.strip()
        begins = not inside and bare.startswith("/*")
        if begins and "*/" in bare and not bare.endswith("*/"):
            begins = False
        comment = inside or begins or bare.startswith("//")
        if inside or begins:
            inside = "*/" not in bare
        lines.append("" if comment else _TYPE.sub("", bare))
    return "\n".join(lines)
