"""Until the 3-D view has something to show, the page says what is going on in its place."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.page_parts import open_screen
from tests.support.played_page import box_of, until
from tests.support.played_server import ORIGIN, VIEW, PlayedServer

pytestmark = pytest.mark.browser

#: A client that draws so many triangles in each picture, each of no size.
CLIENT = """(triangles) => {
  const gl = document.body.appendChild(document.createElement("canvas")).getContext("webgl2");
  const program = gl.createProgram();
  for (const [kind, text] of [
    [gl.VERTEX_SHADER, "#version 300 es\\nvoid main() { gl_Position = vec4(0.0); }"],
    [gl.FRAGMENT_SHADER, "#version 300 es\\nprecision lowp float; out vec4 c; void main() { c = vec4(1.0); }"],
  ]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  gl.useProgram(program);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  window.pictures = 0;
  window.draw = (count) => {
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(3 * count), gl.STATIC_DRAW);
    const again = () => {
      gl.clear(gl.COLOR_BUFFER_BIT);
      gl.drawElements(gl.TRIANGLES, 3 * count, gl.UNSIGNED_SHORT, 0);
      window.pictures += 1;
      window.next = requestAnimationFrame(again);
    };
    cancelAnimationFrame(window.next);
    again();
  };
  window.draw(triangles);
}"""


@pytest.fixture
def page(browser: Browser, server: PlayedServer) -> Iterator[Page]:
    """The page, with a 3-D view that has drawn nothing yet."""
    context = browser.new_context(locale="en-US")
    page = context.new_page()
    server.frame = VIEW.replace(" data-view=drawn", "")
    server.attach(page)
    page.clock.install()
    page.goto(f"{ORIGIN}/")
    expect(page.locator("rp-scene iframe")).to_have_class("loaded")
    yield page
    context.close()


def test_words_stand_in_its_place_until_the_robot_is_drawn(page: Page) -> None:
    words, view = page.locator("rp-scene .empty"), page.frames[1]
    expect(words).to_have_text("Loading the 3-D view…Load it again")
    view.evaluate(CLIENT, 1200)
    # The axes alone, in many pictures.
    view.wait_for_function("pictures > 5")
    expect(words).to_be_visible()
    view.evaluate("draw(20000)")
    expect(words).to_be_hidden()
    page.clock.fast_forward(30_000)
    expect(words).to_be_hidden()


def test_a_press_on_the_words_moves_nothing(page: Page, server: PlayedServer) -> None:
    box = box_of(page.locator("rp-scene iframe"))
    open_screen(page, "drive")
    page.locator("#teleop").click()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.wait_for_timeout(300)
    assert server.holds() == []
    page.mouse.up()
    page.frames[1].evaluate(CLIENT, 20000)
    expect(page.locator("rp-scene .empty")).to_be_hidden()
    page.mouse.down()
    until(page, lambda: server.holds()[-1:] == [True])
    page.mouse.up()


def test_who_waits_for_long_is_told_what_may_be_the_matter_and_may_load_it_again(page: Page) -> None:
    words, again = page.locator("rp-scene .empty"), page.get_by_role("button", name="Load it again")
    expect(again).to_be_hidden()
    page.clock.fast_forward(30_000)
    expect(words).to_contain_text("shows nothing yet; this browser may lack WebGL. Everything else works without it.")
    again.click()
    expect(words).to_contain_text("Loading the 3-D view…")
    expect(again).to_be_hidden()
