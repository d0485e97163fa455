// Runs in the frame of the 3-D view, before its client: how many pixels are drawn, and how.

{
  /** More pixels a way than this cost more than they show. */
  const LARGEST_RATIO = 1.5;
  /** Without a graphics card every pixel is work. With fewer than this the canes become dashes. */
  const LARGEST_RATIO_IN_SOFTWARE = 1;
  /** Time between two pictures drawn in software (ms). The page's buttons share the thread that waits for them. */
  const PACE_IN_SOFTWARE = 80;

  const plainContext = HTMLCanvasElement.prototype.getContext;

  /** Is WebGL drawn by the processor? The names are those of the drivers of Chromium, Mesa and Windows. */
  const drawnInSoftware = () => {
    const probe = plainContext.call(document.createElement("canvas"), "webgl2");
    if (!(probe instanceof WebGL2RenderingContext)) return false;
    const named = probe.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? probe.RENDERER;
    const renderer = String(probe.getParameter(named));
    probe.getExtension("WEBGL_lose_context")?.loseContext();
    return /swiftshader|llvmpipe|softpipe|basic render|software/i.test(renderer);
  };

  const inSoftware = drawnInSoftware();
  // At a fixed resolution: changing it with the load, as the client does by itself, stalls a slow machine for seconds,
  // and a stalled view ends a hold.
  const ratio = Math.min(window.devicePixelRatio, inSoftware ? LARGEST_RATIO_IN_SOFTWARE : LARGEST_RATIO);
  history.replaceState(null, "", `?fixedDpr=${ratio}`);

  if (inSoftware) {
    /**
     * Smoothed edges cost a graphics card next to nothing, and the processor half of its time.
     *
     * @this {HTMLCanvasElement}
     * @param {string} kind
     * @param {any} [options]
     */
    const getContext = function (kind, options) {
      return plainContext.call(this, kind, kind.startsWith("webgl") ? { ...options, antialias: false } : options);
    };
    HTMLCanvasElement.prototype.getContext = /** @type {any} */ (getContext);
    paceFrames(PACE_IN_SOFTWARE);
  }

  /**
   * Let pictures be drawn no more often than this, so that a press is handled between two of them.
   *
   * @param {number} pace In ms.
   */
  function paceFrames(pace) {
    const plainRequest = window.requestAnimationFrame.bind(window);
    const plainCancel = window.cancelAnimationFrame.bind(window);
    /** @type {Map<number, { timer: number, frame: number }>} */
    const waiting = new Map();
    let issued = 0;
    let drawn = -pace;
    window.requestAnimationFrame = (callback) => {
      const number = ++issued;
      const entry = { timer: 0, frame: 0 };
      waiting.set(number, entry);
      entry.timer = window.setTimeout(
        () => {
          entry.frame = plainRequest((now) => {
            waiting.delete(number);
            drawn = performance.now();
            callback(now);
          });
        },
        Math.max(0, drawn + pace - performance.now()),
      );
      return number;
    };
    window.cancelAnimationFrame = (number) => {
      const entry = waiting.get(number);
      if (!entry) return;
      window.clearTimeout(entry.timer);
      plainCancel(entry.frame);
      waiting.delete(number);
    };
  }
}
