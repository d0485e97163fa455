import asyncio

import pytest
from starlette.exceptions import HTTPException

from rolling_panda.resources import resource
from server.page_files import PageFiles, as_sent

SCRIPT = """\
// What this is for.
const words = "// not a comment"; // beside code

/**
 * @param {number} x
 */
export function twice(x) {
  /** @type {number} */
  const two = 2;
  /** @type {any} */ (globalThis).seen = `a
*b`;
  /* plain */
  return two * x;
}
"""
SENT = """\

const words = "// not a comment"; // beside code




export function twice(x) {

const two = 2;
(globalThis).seen = `a
*b`;

return two * x;
}
"""


def test_lines_of_comment_alone_are_left_out_and_every_other_line_keeps_its_number():
    assert as_sent(SCRIPT) == SENT


def ask(files, path, **headers):
    wire = [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()]
    scope = {"type": "http", "method": "GET", "path": "/" + path, "headers": wire}
    return asyncio.run(files.get_response(path, scope))


def test_every_script_of_the_page_is_sent_and_nothing_outside_the_folder():
    folder = resource("web/index.html").parent
    files = PageFiles(folder)
    for script in folder.rglob("*.js"):
        name = script.relative_to(folder).as_posix()
        answer = ask(files, name)
        assert answer.status_code == 200 and answer.headers["content-type"].startswith("text/javascript")
        assert answer.body == as_sent(script.read_text(encoding="utf-8")).encode()
        assert ask(files, name, if_none_match=answer.headers["etag"]).status_code == 304
        assert ask(files, name, if_none_match='"another"').status_code == 200
    assert ask(files, "style.css").status_code == 200
    for path in ("nothing.js", "../server/app.js", "components/../../server/app.js"):
        with pytest.raises(HTTPException):
            ask(files, path)
