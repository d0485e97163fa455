import asyncio
import gzip
import re

import pytest
from starlette.exceptions import HTTPException

from rolling_panda.resources import resource
from server.api.page_files import PageFiles, imports_of, minified, with_preloads

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
    assert minified(SCRIPT) == SENT


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
        assert answer.body == minified(script.read_text(encoding="utf-8")).encode()
        assert ask(files, name, if_none_match=answer.headers["etag"]).status_code == 304
        assert ask(files, name, if_none_match='"another"').status_code == 200
    assert ask(files, "css/base.css").status_code == 200
    for path in ("nothing.js", "../server/app.js", "js/../../server/app.js"):
        with pytest.raises(HTTPException):
            ask(files, path)


@pytest.mark.parametrize("name", ["js/app.js", "page.css", "index.html", "text/page.en.json", "text/reasons.en.json"])
def test_a_browser_that_takes_it_gets_a_file_compressed(name):
    files = PageFiles(resource("web/index.html").parent)
    plain, sent = ask(files, name), ask(files, name, accept_encoding="gzip, deflate, br")
    assert "content-encoding" not in plain.headers and sent.headers["content-encoding"] == "gzip"
    assert gzip.decompress(sent.body) == plain.body and len(sent.body) < 0.5 * len(plain.body)
    assert sent.headers["content-length"] == str(len(sent.body)) and sent.headers["content-type"]
    assert {plain.headers["vary"], sent.headers["vary"]} == {"Accept-Encoding"}
    assert ask(files, name, if_none_match=sent.headers["etag"], accept_encoding="gzip").status_code == 304


def test_the_page_asks_for_one_stylesheet_in_the_order_of_its_several_and_for_every_script_at_once():
    folder = resource("web/index.html").parent
    files, written = PageFiles(folder), (folder / "index.html").read_text(encoding="utf-8")
    sent = ask(files, "index.html").body.decode()
    assert re.findall(r'"stylesheet" href="(.*?)"', sent) == ["page.css"]
    styles = [(folder / name).read_text(encoding="utf-8") for name in re.findall(r'"stylesheet" href="(.*?)"', written)]
    joined = ask(files, "page.css")
    assert len(styles) > 10 and joined.body.decode() == "\n".join(styles).replace("../", "")
    pictures = re.findall(r'url\("(.*?)"\)', joined.body.decode())
    assert pictures and all((folder / each).is_file() for each in pictures)
    assert joined.headers["content-type"].startswith("text/css")
    named = re.findall(r'"modulepreload" href="(.*?)"', sent)
    later = {f"components/rp-{name}.js" for name in ("review", "drive", "report", "engineer", "preview", "replay")}
    assert "js/state/signals.js" in named and "components/rp-bar.js" in named and len(named) == len(set(named))
    assert not later & set(named), "what is fetched when it is wanted does not hold up what is seen first"
    without = re.sub(r' *<link rel="(stylesheet|modulepreload)".*\n', "", sent)
    assert without == re.sub(r' *<link rel="stylesheet".*\n', "", written), "and nothing else of it is changed"


def test_scripts_are_named_with_what_they_need_and_not_what_they_fetch_later():
    scripts = {
        "app.js": 'import "./components/a.js";\nimport {\nb,\n} from "./b.js";\nvoid import("./late.js");\n',
        "components/a.js": 'import { b } from "../b.js";\n',
        "b.js": 'export { c } from "./c.js";\nimport "./app.js";\n',
        "c.js": "export const c = 1;\n",
        "late.js": "",
    }
    assert imports_of("app.js", scripts) == ["components/a.js", "b.js", "c.js"]
    assert with_preloads("<p>no scripts</p>", scripts) == "<p>no scripts</p>"
