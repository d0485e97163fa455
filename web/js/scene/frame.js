// Runs in the iframe of the 3-D view, before its client: limits resolution and frame rate, reports the first drawing.

import { OffscreenFramebuffer } from "./offscreen-framebuffer.js";

/** The robot has about 20 000; axes and ground, which come first, 1 000. */
const FEWEST_TRIANGLES = 4000;

/**
 * Marks the document `data-view="loading"`, and `data-view="drawn"` once the robot is on the screen.
 *
 * @param {(callback: () => void) => void} nextFrame Calls at the browser's next frame.
 * @param {() => boolean} shown Is everything drawn on the screen?
 */
const reportWhenDrawn = (nextFrame, shown) => {
  document.documentElement.dataset.view ??= "loading";
  const { prototype } = WebGL2RenderingContext;
  const { drawElements } = prototype;
  let triangles = 0;
  prototype.drawElements = function (mode, count, type, offset) {
    triangles += count / 3;
    drawElements.call(this, mode, count, type, offset);
  };
  const tell = () => {
    if (shown()) document.documentElement.dataset.view = "drawn";
    else nextFrame(tell);
  };
  const look = () => {
    if (triangles < FEWEST_TRIANGLES) {
      triangles = 0;
      nextFrame(look);
      return;
    }
    prototype.drawElements = drawElements;
    tell();
  };
  nextFrame(look);
};

/** Higher device pixel ratios cost more than they show. */
const LARGEST_RATIO = 1.5;
/** The same without a graphics card. Below this the canes become dashes. */
const LARGEST_RATIO_IN_SOFTWARE = 1;
/** Shortest frame period in software (ms). The page's buttons share the thread. */
const PACE_IN_SOFTWARE = 80;
/** Frame period in software behind a screen that hides the view (ms). The client reads its messages, and draws nothing. */
const PACE_HIDDEN = 300;
/** After a frame the processor is left to the robot for as long as the frame took, this at most (ms). */
const LONGEST_REST = 250;

const plainContext = HTMLCanvasElement.prototype.getContext;
const plainRequest = window.requestAnimationFrame.bind(window);

/** Is WebGL rendered in software? By the driver names of Chromium, Mesa and Windows. */
const drawnInSoftware = () => {
  const probe = plainContext.call(document.createElement("canvas"), "webgl2");
  if (!(probe instanceof WebGL2RenderingContext)) return false;
  const named = probe.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? probe.RENDERER;
  const renderer = String(probe.getParameter(named));
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|basic render|software/i.test(renderer);
};

const inSoftware = drawnInSoftware();
/**
 * Of each canvas: the client makes one to see whether it can, before the one that it draws in.
 *
 * @type {OffscreenFramebuffer[]}
 */
const behind = [];
// A fixed resolution: the client's adaptive one stalls a slow machine for seconds, and a stalled view ends a hold.
const ratio = Math.min(window.devicePixelRatio, inSoftware ? LARGEST_RATIO_IN_SOFTWARE : LARGEST_RATIO);
history.replaceState(null, "", `?fixedDpr=${ratio}`);
// The client tells the server the size of the view in pixels alone, and markers have to be large enough for a finger.
document.cookie = `view-ratio=${ratio}; path=/; samesite=strict`;
reportWhenDrawn(plainRequest, () => behind.every((each) => !each.busy && !each.drawn));

if (inSoftware) {
  /**
   * Without antialiasing, which takes half of the processor's time.
   *
   * @this {HTMLCanvasElement}
   * @param {string} kind
   * @param {any} [options]
   */
  const getContext = function (kind, options) {
    if (!kind.startsWith("webgl")) return plainContext.call(this, kind, options);
    const gl = plainContext.call(this, kind, { ...options, antialias: false });
    if (gl instanceof WebGL2RenderingContext && !behind.some((each) => each.gl === gl))
      behind.push(new OffscreenFramebuffer(gl));
    return gl;
  };
  HTMLCanvasElement.prototype.getContext = /** @type {any} */ (getContext);
  paceFrames();
}

/** Is the view hidden behind another screen of the page? */
function hidden() {
  const place = window.frameElement;
  return place !== null && getComputedStyle(place).visibility === "hidden";
}

/** Limit the frame rate and never overlap frames, so that presses are handled in between. */
function paceFrames() {
  /** @type {Map<number, FrameRequestCallback>} */
  const waiting = new Map();
  let issued = 0;
  let planned = false;
  let began = 0;
  let took = 0;
  const plan = () => {
    if (planned || behind.some((each) => each.busy) || waiting.size === 0) return;
    planned = true;
    const pace = hidden() ? PACE_HIDDEN : Math.max(PACE_IN_SOFTWARE, took + Math.min(took, LONGEST_REST));
    window.setTimeout(() => plainRequest(draw), Math.max(0, began + pace - performance.now()));
  };
  const shown = () => {
    took = performance.now() - began;
    plan();
  };
  /** @param {number} now */
  const draw = (now) => {
    began = performance.now();
    took = 0;
    const idle = hidden() && document.documentElement.dataset.view === "drawn";
    for (const each of behind) each.idle = idle;
    for (const number of [...waiting.keys()]) {
      const callback = waiting.get(number);
      waiting.delete(number);
      try {
        callback?.(now);
      } catch (error) {
        window.reportError(error);
      }
    }
    for (const each of behind) each.finish(plainRequest, shown);
    // Frames requested meanwhile wait until this one is shown.
    planned = false;
    plan();
  };
  window.requestAnimationFrame = (callback) => {
    issued += 1;
    waiting.set(issued, callback);
    plan();
    return issued;
  };
  window.cancelAnimationFrame = (number) => void waiting.delete(number);
}
