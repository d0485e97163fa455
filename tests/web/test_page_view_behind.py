"""Where the processor draws the 3-D view, its client draws behind the canvas, and finished pictures are shown."""

import io

import pytest
from PIL import Image
from playwright.sync_api import Frame, Page, expect

from tests.support.page_parts import open_screen
from tests.support.played_server import ORIGIN, PlayedServer

pytestmark = pytest.mark.browser

#: A client as the 3-D view's: it draws into a buffer of its own and then, cut to a part, into the canvas.
CLIENT = """() => {
  const canvas = document.createElement("canvas");
  canvas.style = "position: fixed; left: 0; top: 100px; width: 80px; height: 40px";
  document.body.append(canvas);
  // One more before and after, as the view's client makes to see whether it can.
  document.createElement("canvas").getContext("webgl2");
  const gl = canvas.getContext("webgl2", { antialias: true });
  document.createElement("canvas").getContext("webgl2");
  const own = gl.createFramebuffer();
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 4, 4, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
  gl.bindFramebuffer(gl.FRAMEBUFFER, own);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  const fill = (...color) => { gl.clearColor(...color, 1); gl.clear(gl.COLOR_BUFFER_BIT); };
  window.client = { canvas, gl, left: [1, 0, 0], right: [0, 0, 1], frames: 0, troubles: [] };
  const draw = () => {
    const { width, height } = canvas;
    gl.viewport(0, 0, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, own);
    gl.drawBuffers([gl.COLOR_ATTACHMENT0]);
    fill(0, 1, 1);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.drawBuffers([gl.BACK]);
    gl.disable(gl.SCISSOR_TEST);
    fill(...client.left);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(width / 2, 0, width / 2, height);
    fill(...client.right);
    client.frames += 1;
    const trouble = gl.getError();
    if (trouble) client.troubles.push(trouble);
    requestAnimationFrame(draw);
    if (client.frames === 2) throw new Error("in one picture");
  };
  requestAnimationFrame(draw);
}"""


@pytest.fixture
def view(tab: Page, server: PlayedServer) -> Frame:
    server.attach(tab)
    tab.goto(f"{ORIGIN}/")
    expect(tab.locator("rp-scene iframe")).to_have_class("loaded")
    return tab.frames[1]


def colors(view: Frame) -> list[tuple[int, int, int]]:
    """What stands on the screen near the canvas's left and right end."""
    image = Image.open(io.BytesIO(view.locator("canvas").screenshot())).convert("RGB")
    return [image.getpixel((image.width * x // 8, image.height * 7 // 8)) for x in (1, 7)]


def until_shown(view: Frame, *wanted: tuple[int, int, int]) -> None:
    shown = None
    for _ in range(40):
        shown = colors(view)
        if shown == list(wanted):
            return
        view.page.wait_for_timeout(50)
    assert shown == list(wanted)


#: The canvas's pixel near its corner, and the error.
READ = """() => new Promise((done) => {
  setTimeout(() => done("nothing is drawn any more"), 5000);
  requestAnimationFrame(() => {
    const { gl } = client, pixel = new Uint8Array(4);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.readBuffer(gl.BACK);
    gl.readPixels(1, 1, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    done([...pixel, gl.getError()]);
  });
})"""
RED, GREEN, BLUE, WHITE = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)


def test_what_the_client_draws_is_shown_whole_whatever_it_has_bound(view: Frame) -> None:
    view.evaluate(CLIENT)
    until_shown(view, RED, BLUE)
    view.evaluate("() => { client.left = [0, 1, 0]; client.right = [1, 1, 1]; }")
    until_shown(view, GREEN, WHITE)
    # As the client does when its window grows.
    view.evaluate("() => { client.canvas.width = 640; client.canvas.height = 320; client.left = [1, 1, 1]; }")
    until_shown(view, WHITE, WHITE)
    view.evaluate("() => { client.left = [1, 0, 0]; client.right = [0, 1, 0]; }")
    until_shown(view, RED, GREEN)
    assert view.evaluate("client.troubles") == []
    count = view.evaluate("client.frames")
    view.wait_for_function(f"client.frames > {count + 3}")


def test_what_is_read_back_is_what_was_drawn(view: Frame) -> None:
    view.evaluate(CLIENT)
    until_shown(view, RED, BLUE)
    assert view.evaluate(READ) == [255, 0, 0, 255, 0]


def frames_in(view: Frame, milliseconds: int) -> int:
    before = view.evaluate("client.frames")
    view.page.wait_for_timeout(milliseconds)
    return int(view.evaluate("client.frames")) - int(before)


@pytest.mark.long
@pytest.mark.alone  # It counts frames in a time.
def test_behind_another_screen_the_client_goes_on_slowly_and_draws_nothing_until_it_is_seen(view: Frame) -> None:
    view.evaluate(CLIENT)
    until_shown(view, RED, BLUE)
    assert frames_in(view, 2000) >= 10
    # As after the first frame of the true client.
    view.evaluate("document.documentElement.dataset.view = 'drawn'")
    open_screen(view.page, "report")
    view.page.wait_for_timeout(400)
    view.evaluate("() => { client.left = [0, 1, 0]; }")
    assert 3 <= frames_in(view, 3000) <= 12
    assert view.evaluate(READ) == [255, 0, 0, 255, 0]
    open_screen(view.page, "work")
    until_shown(view, GREEN, BLUE)
    assert frames_in(view, 2000) >= 10


@pytest.mark.long
@pytest.mark.alone  # It counts frames in a time.
def test_slow_frames_leave_as_much_time_to_the_robot_as_they_take(view: Frame) -> None:
    view.evaluate(CLIENT)
    until_shown(view, RED, BLUE)
    view.evaluate("""() => {
      const { gl } = client, { getSyncParameter } = gl;
      const finished = new WeakMap();
      gl.getSyncParameter = (sync, name) => {
        if (!finished.has(sync)) finished.set(sync, performance.now() + 200);
        return performance.now() < finished.get(sync) ? gl.UNSIGNALED : getSyncParameter.call(gl, sync, name);
      };
    }""")
    view.page.wait_for_timeout(500)
    # One each 0.4 s, and not each 0.2 s.
    assert 6 <= frames_in(view, 4000) <= 11
