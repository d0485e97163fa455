// The picture with its labels, on which the brush paints. The wheel zooms; the right or middle button, Shift, or two
// fingers move the picture.

import { CLASSES, REST, UNLABELLED } from "../js/label/classes.js";
import {
  brush,
  changes,
  labelsShown,
  listed,
  noteChange,
  open,
  problem,
  proposalShown,
  SIZES,
  sizeStep,
  strength,
  tool,
  valueOf,
} from "../js/label/session.js";
import { fitView, move, setPicture, setWindow, view, zoomView } from "../js/label/view.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setText } from "../js/views/dom.js";

/** Opacity of the classes that are the rest of a picture, as a part of that of wood. */
const REST_OPACITY = 0.45;

/** @typedef {import("../js/label/mask.js").Box} Box */

class RpLabelCanvas extends HTMLElement {
  constructor() {
    super();
    this.canvas = element("canvas", { attributes: { role: "img", "aria-label": text("label.picture") } });
    this.paper = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    /** Labels and proposal in the picture's own pixels. */
    this.layer = element("canvas");
    /** @type {ImageData|null} */
    this.colours = null;
    /** Colour of each value with its opacity, of labels and of the proposal: red, green, blue, alpha. */
    this.palette = new Uint8ClampedArray(4 * 256);
    /** @type {Map<number, readonly [number, number]>} Pointers that are down, by their number. */
    this.down = new Map();
    /** @type {"paint"|"move"|""} */
    this.doing = "";
    /** @type {readonly [number, number]|null} */
    this.pointer = null;
    /** @type {import("../js/label/session.js").Open|null} */
    this.shown = null;
  }

  connectedCallback() {
    const empty = element("p", { class: "empty", attributes: { role: "status" } });
    const zoom = element("output", { class: "number" });
    const buttons = element(
      "div",
      { class: "label-zoom" },
      viewButton("−", text("label.zoom_out"), () => zoomView(1 / 1.5)),
      zoom,
      viewButton("+", text("label.zoom_in"), () => zoomView(1.5)),
      viewButton(text("label.fit"), text("label.fit_hint"), fitView),
    );
    this.append(this.canvas, empty, buttons);
    new ResizeObserver(() => this.resize()).observe(this);
    this.resize();

    drawOn([open, problem], () => {
      const now = open.get();
      setText(empty, now ? "" : problem.get() || text("label.loading"));
      empty.hidden = now !== null;
      buttons.hidden = now === null;
    });
    drawOn([open], () => {
      const now = open.get();
      if (now && now.mask !== this.shown?.mask) {
        this.layer.width = now.mask.width;
        this.layer.height = now.mask.height;
        this.colours = new ImageData(now.mask.width, now.mask.height);
        setPicture(now.mask.width, now.mask.height);
      }
      this.shown = now;
    });
    drawOn([open, changes, proposalShown, labelsShown, strength, listed], () => {
      this.choosePalette();
      const now = open.get();
      if (now) this.colour([0, 0, now.mask.width, now.mask.height]);
      this.draw();
    });
    drawOn([view, sizeStep, tool], () => {
      setText(zoom, text("label.percent", { percent: Math.round(100 * view.get().scale) }));
      this.draw();
    });
    this.listen();
  }

  resize() {
    const { width, height } = this.getBoundingClientRect();
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.max(1, Math.round(width * ratio));
    this.canvas.height = Math.max(1, Math.round(height * ratio));
    setWindow(width, height);
    this.draw();
  }

  choosePalette() {
    for (const { name, colour } of CLASSES) {
      const alpha = 255 * strength.get() * (REST.includes(name) ? REST_OPACITY : 1);
      this.palette.set([...colour, alpha], 4 * valueOf(name));
    }
  }

  /**
   * Colour a part of the layer anew.
   *
   * @param {Box} box
   */
  colour([left, top, right, bottom]) {
    const now = this.shown;
    if (!now || !this.colours || right <= left || bottom <= top) return;
    const { labels, width } = now.mask;
    const proposal = proposalShown.get() ? now.proposal : null;
    const own = labelsShown.get();
    const rest = REST.map((name) => valueOf(name));
    const out = this.colours.data;
    for (let y = top; y < bottom; y++) {
      for (let x = left; x < right; x++) {
        const at = y * width + x;
        let value = labels[at] ?? UNLABELLED;
        // Proposed wood is dotted, so that it is told from labels.
        let share = own ? 1 : 0;
        if (value === UNLABELLED) {
          value = proposal?.[at] ?? UNLABELLED;
          share = value !== UNLABELLED && !rest.includes(value) ? (((x >> 1) + (y >> 1)) & 1 ? 1.25 : 0.35) : 0;
        }
        const from = 4 * value;
        out[4 * at] = this.palette[from] ?? 0;
        out[4 * at + 1] = this.palette[from + 1] ?? 0;
        out[4 * at + 2] = this.palette[from + 2] ?? 0;
        out[4 * at + 3] = value === UNLABELLED ? 0 : (this.palette[from + 3] ?? 0) * share;
      }
    }
    const ink = /** @type {CanvasRenderingContext2D} */ (this.layer.getContext("2d"));
    ink.putImageData(this.colours, 0, 0, left, top, right - left, bottom - top);
  }

  draw() {
    const { paper, canvas, shown } = this;
    const ratio = window.devicePixelRatio || 1;
    paper.setTransform(1, 0, 0, 1, 0, 0);
    paper.clearRect(0, 0, canvas.width, canvas.height);
    if (!shown) return;
    const { scale, x, y } = view.get();
    paper.setTransform(ratio * scale, 0, 0, ratio * scale, ratio * x, ratio * y);
    paper.imageSmoothingEnabled = scale * ratio < 2;
    paper.imageSmoothingQuality = "medium";
    paper.drawImage(shown.image, 0, 0);
    paper.drawImage(this.layer, 0, 0);
    if (!this.pointer || this.doing === "move") return;
    const [px, py] = this.pointer;
    const radius = (SIZES[sizeStep.get()] ?? 1) / 2;
    paper.setTransform(ratio, 0, 0, ratio, 0, 0);
    for (const [colour, width] of /** @type {const} */ ([["rgb(0 0 0 / 0.75)", 3], [this.brushColour(), 1.5]])) {
      paper.beginPath();
      paper.arc(px, py, Math.max(2, radius * scale), 0, 2 * Math.PI);
      paper.strokeStyle = colour;
      paper.lineWidth = width;
      paper.stroke();
    }
  }

  brushColour() {
    const found = CLASSES.find((each) => each.name === tool.get());
    return found ? `rgb(${found.colour.join(" ")})` : "#ffffff";
  }

  /**
   * @param {PointerEvent|WheelEvent} event
   * @returns {readonly [number, number]} In the window on the picture.
   */
  place(event) {
    const { left, top } = this.canvas.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        const [x, y] = this.place(event);
        zoomView(Math.exp(-Math.max(-200, Math.min(200, event.deltaY)) * 0.002), x, y);
      },
      { passive: false },
    );
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.shown) return;
      canvas.setPointerCapture(event.pointerId);
      const at = this.place(event);
      this.down.set(event.pointerId, at);
      if (this.down.size > 1 || event.button !== 0 || event.shiftKey) {
        this.finish();
        this.doing = "move";
        return;
      }
      this.doing = "paint";
      this.paint(at, at);
    });
    canvas.addEventListener("pointermove", (event) => {
      for (const each of event.getCoalescedEvents?.().length ? event.getCoalescedEvents() : [event]) this.moved(each);
      this.pointer = this.place(event);
      this.draw();
    });
    for (const kind of /** @type {const} */ (["pointerup", "pointercancel"])) {
      canvas.addEventListener(kind, (event) => {
        this.down.delete(event.pointerId);
        this.finish();
        if (this.down.size === 0) this.doing = "";
      });
    }
    canvas.addEventListener("pointerleave", () => {
      this.pointer = null;
      this.draw();
    });
  }

  /** @param {PointerEvent} event */
  moved(event) {
    const before = this.down.get(event.pointerId);
    if (!before) return;
    const at = this.place(event);
    if (this.doing === "paint") this.paint(before, at);
    else {
      const others = [...this.down].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
      const fixed = others[0];
      if (fixed) {
        const apart = (/** @type {readonly [number, number]} */ [x, y]) => Math.hypot(x - fixed[0], y - fixed[1]);
        if (apart(before) > 10) zoomView(apart(at) / apart(before), ...fixed);
      } else move(at[0] - before[0], at[1] - before[1]);
    }
    this.down.set(event.pointerId, at);
  }

  /**
   * @param {readonly [number, number]} from In the window.
   * @param {readonly [number, number]} to
   */
  paint(from, to) {
    const now = this.shown;
    if (!now) return;
    const { scale, x, y } = view.get();
    const inPicture = (/** @type {readonly [number, number]} */ [px, py]) =>
      /** @type {const} */ ([(px - x) / scale, (py - y) / scale]);
    this.colour(now.mask.line(inPicture(from), inPicture(to), SIZES[sizeStep.get()] ?? 1, brush(now)));
    this.draw();
  }

  /** The stroke is one step. */
  finish() {
    if (this.doing === "paint" && this.shown?.mask.end()) noteChange();
  }
}

/**
 * @param {string} sign
 * @param {string} words
 * @param {() => void} act
 */
function viewButton(sign, words, act) {
  return element("button", { text: sign, attributes: { "aria-label": words, title: words }, onclick: act });
}
customElements.define("rp-label-canvas", RpLabelCanvas);
