"""The page's files as they are sent: scripts without comments, types and indentation, a third of them."""

import hashlib
import re
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

#: A type for the type checker beside code; what it is about stands in parentheses after it.
_TYPE = re.compile(r"/\*\* @type [^*`]*\*/ ?")


class PageFiles(StaticFiles):
    """A folder of files. A script is read once and keeps its line numbers."""

    def __init__(self, folder: Path) -> None:
        """Serve `folder`."""
        super().__init__(directory=folder)
        self._scripts: dict[str, tuple[bytes, str]] = {}

    async def get_response(self, path: str, scope: Scope) -> Response:
        """The file, or that it has not changed."""
        if not path.endswith(".js") or scope["method"] not in ("GET", "HEAD"):
            return await super().get_response(path, scope)
        script, tag = self._script(path)
        headers = {"ETag": tag, "Cache-Control": "no-cache"}
        asked = dict(scope["headers"]).get(b"if-none-match", b"").decode("latin-1")
        if asked == tag:
            return Response(status_code=304, headers=headers)
        return Response(script, media_type="text/javascript", headers=headers)

    def _script(self, path: str) -> tuple[bytes, str]:
        if path not in self._scripts:
            full, found = self.lookup_path(path)
            if found is None:
                raise HTTPException(404)
            script = as_sent(Path(full).read_text(encoding="utf-8")).encode()
            self._scripts[path] = script, f'"{hashlib.sha256(script).hexdigest()[:32]}"'
        return self._scripts[path]


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
