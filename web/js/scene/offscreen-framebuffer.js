// Offscreen rendering of the 3-D view in software.
//
// A browser without a graphics card copies a canvas at the end of the frame and blocks the page's thread until all of
// it is rendered, 0.1 s and more, in which no button reacts. So the client renders into an offscreen framebuffer, and
// only a finished frame is copied into the canvas.

/** Period of polling for a finished frame (ms). */
const ASK_MS = 4;
/** After this time a frame is shown although it does not report to be finished (ms). */
const LONGEST_MS = 1000;

/** Calls that draw. */
const DRAWING = /** @type {const} */ (["drawArrays", "drawElements", "drawArraysInstanced", "drawElementsInstanced"]);

export class OffscreenFramebuffer {
  /** Is a frame rendered but not shown? */
  busy = false;
  drawn = false;
  /** Is nothing to be drawn, so that the last frame stays? */
  idle = false;
  width = 0;
  height = 0;

  /** @param {WebGL2RenderingContext} gl Draws into the framebuffer from now on. */
  constructor(gl) {
    this.gl = gl;
    this.picture = gl.createFramebuffer();
    this.color = gl.createRenderbuffer();
    this.depth = gl.createRenderbuffer();
    this.bind = gl.bindFramebuffer.bind(gl);
    /** What the client has bound; null is what it believes to be the canvas. @type {WebGLFramebuffer | null} */
    this.forDrawing = null;
    /** @type {WebGLFramebuffer | null} */
    this.forReading = null;
    this.bind(gl.FRAMEBUFFER, this.picture);
    this.fit();
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, this.color);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_STENCIL_ATTACHMENT, gl.RENDERBUFFER, this.depth);
    this.interceptCanvas();
  }

  /** Redirect the client's calls for the canvas. */
  interceptCanvas() {
    const { gl } = this;
    gl.bindFramebuffer = (target, framebuffer) => {
      if (target !== gl.READ_FRAMEBUFFER) this.forDrawing = framebuffer;
      if (target !== gl.DRAW_FRAMEBUFFER) this.forReading = framebuffer;
      this.bind(target, framebuffer ?? this.picture);
    };
    const drawBuffers = gl.drawBuffers.bind(gl);
    gl.drawBuffers = (buffers) => drawBuffers(this.forDrawing === null ? [gl.COLOR_ATTACHMENT0] : buffers);
    const readBuffer = gl.readBuffer.bind(gl);
    gl.readBuffer = (buffer) => readBuffer(this.forReading === null ? gl.COLOR_ATTACHMENT0 : buffer);
    const viewport = gl.viewport.bind(gl);
    gl.viewport = (x, y, width, height) => {
      // The client calls this after each change of the canvas's size.
      this.fit();
      viewport(x, y, width, height);
    };
    const clear = gl.clear.bind(gl);
    gl.clear = (mask) => {
      if (this.idle) return;
      if (this.forDrawing === null) this.drawn = true;
      clear(mask);
    };
    const { prototype } = WebGL2RenderingContext;
    for (const name of DRAWING) {
      // Not bound before: what counts triangles comes and goes.
      gl[name] = (/** @type {any[]} */ ...values) => {
        if (!this.idle) /** @type {any} */ (prototype[name]).apply(gl, values);
      };
    }
  }

  /** As large as the canvas. */
  fit() {
    const { gl } = this;
    const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
    if (width === this.width && height === this.height) return;
    [this.width, this.height] = [width, height];
    const before = gl.getParameter(gl.RENDERBUFFER_BINDING);
    gl.bindRenderbuffer(gl.RENDERBUFFER, this.color);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, width, height);
    gl.bindRenderbuffer(gl.RENDERBUFFER, this.depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH24_STENCIL8, width, height);
    gl.bindRenderbuffer(gl.RENDERBUFFER, before);
  }

  /**
   * After the client has drawn: show the frame as soon as it is finished.
   *
   * @param {(shown: () => void) => void} nextFrame Calls at the browser's next frame.
   * @param {() => void} shown
   */
  finish(nextFrame, shown) {
    if (!this.drawn || this.busy) return;
    const { gl } = this;
    this.drawn = false;
    const done = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (done === null) return;
    this.busy = true;
    gl.flush();
    const began = performance.now();
    const ask = () => {
      const late = performance.now() - began > LONGEST_MS;
      if (!late && !gl.isContextLost() && gl.getSyncParameter(done, gl.SYNC_STATUS) !== gl.SIGNALED) {
        window.setTimeout(ask, ASK_MS);
        return;
      }
      gl.deleteSync(done);
      nextFrame(() => {
        this.show();
        this.busy = false;
        shown();
      });
    };
    window.setTimeout(ask, ASK_MS);
  }

  /** Copy the frame into the canvas. */
  show() {
    const { gl, width, height } = this;
    const cut = gl.isEnabled(gl.SCISSOR_TEST);
    if (cut) gl.disable(gl.SCISSOR_TEST);
    this.bind(gl.READ_FRAMEBUFFER, this.picture);
    this.bind(gl.DRAW_FRAMEBUFFER, null);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    if (cut) gl.enable(gl.SCISSOR_TEST);
    this.bind(gl.READ_FRAMEBUFFER, this.forReading ?? this.picture);
    this.bind(gl.DRAW_FRAMEBUFFER, this.forDrawing ?? this.picture);
  }
}
