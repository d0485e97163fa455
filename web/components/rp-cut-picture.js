// A picture of a spur with a cut on it: what falls, what stays, the nodes. It zooms by wheel, pinch and buttons. A tap
// is told as `place`, a cut that is dragged along the cane as `move-cut`.

import { text } from "../js/state/texts.js";
import { linePath, nearestArc, placeAt, woodPath } from "../js/views/cut-geometry.js";
import { element, setAttribute, setText, svg } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";

/** @typedef {import("../js/link/messages.js").DrawnCut} DrawnCut */
/** @typedef {import("../js/link/pictures.js").CutPicture} CutPicture */

const MAX_ZOOM = 8;
const ZOOM_STEP = 1.5;
/** A press that moves less than this is a tap (px on the screen). */
const TAP = 8;
/** Where a finger takes hold of the cut (px on the screen, radius). */
const HANDLE = 28;
/** Half the length of the drawn cut, in thicknesses of the wood and at least (px of the picture). */
const BLADE = 1.7;
const MIN_BLADE = 11;
/** Farthest that a cut can be moved at once (m). */
const MAX_MOVE = 0.1;

export class RpCutPicture extends HTMLElement {
  constructor() {
    super();
    this.image = svg("image", { x: 0, y: 0 });
    this.falls = svg("g", { class: "falls" });
    this.stays = svg("path", { class: "stays" });
    this.canes = svg("path", { class: "canes" });
    this.nodes = svg("g", { class: "nodes" });
    this.others = svg("g", { class: "others" });
    this.blade = svg("g", { class: "blade" });
    this.handle = svg("circle", { class: "handle" });
    // What is drawn ends where the picture ends.
    this.inside = svg("svg", { class: "inside" }, this.image, this.canes, this.falls, this.stays, this.nodes, this.others, this.blade, this.handle);
    this.drawing = svg("svg", { class: "outside", role: "img" }, this.inside);
    this.words = element("p", { class: "picture-words", attributes: { role: "status" } });
    this.moved = element("p", { class: "picture-moved number" });
    this.moved.hidden = true;
    /** @type {CutPicture|null} */
    this.picture = null;
    /** The cut that is drawn; null for a place without one. @type {DrawnCut|null} */
    this.cut = null;
    this.movable = false;
    this.placing = false;
    /** Distance by which the cut is dragged (m). */
    this.along = 0;
    this.dragging = false;
    this.zoom = 1;
    /** Centre of what is seen, as a share of the picture. */
    this.centre = { x: 0.5, y: 0.5 };
    /** Pointers that are down: where, and where they began (px on the screen). @type {Map<number, { x: number, y: number, from: { x: number, y: number } }>} */
    this.pointers = new Map();
    this.isTap = false;
  }

  connectedCallback() {
    if (this.childElementCount > 0) return;
    const button = (/** @type {string} */ title, /** @type {string} */ sign, /** @type {() => void} */ act) =>
      element("button", { class: "zoom", attributes: { "aria-label": title, title }, onclick: act }, icon(sign));
    this.append(
      this.drawing,
      this.words,
      this.moved,
      element(
        "div",
        { class: "zooms" },
        button(text("picture.in"), "add", () => this.zoomTo(this.zoom * ZOOM_STEP)),
        button(text("picture.out"), "IDLE", () => this.zoomTo(this.zoom / ZOOM_STEP)),
      ),
    );
    this.drawing.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoomTo(this.zoom * Math.exp(-event.deltaY / 300), this.shareAt(event));
    });
    this.drawing.addEventListener("dblclick", (event) => !this.placing && this.zoomTo(this.zoom > 1 ? 1 : 3, this.shareAt(event)));
    this.drawing.addEventListener("pointerdown", (event) => this.down(event));
    this.drawing.addEventListener("pointermove", (event) => this.move(event));
    for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) this.drawing.addEventListener(name, (event) => this.up(event));
    new ResizeObserver(() => this.frame()).observe(this);
  }

  /**
   * Show a picture.
   *
   * @param {CutPicture|null} picture
   * @param {DrawnCut|null} cut
   * @param {string} words What it shows, or why there is none.
   */
  show(picture, cut, words) {
    const other = picture?.drawing.image !== this.picture?.drawing.image || cut?.point_id !== this.cut?.point_id;
    this.picture = picture;
    this.cut = cut;
    this.along = 0;
    this.dragging = false;
    if (other) [this.zoom, this.centre] = [1, { x: 0.5, y: 0.5 }];
    setAttribute(this, "data-shown", picture ? "yes" : "no");
    setAttribute(this.drawing, "aria-label", words);
    setText(this.words, picture ? "" : words);
    if (picture) {
      const [width, height] = picture.drawing.size;
      for (const each of [this.inside, this.image]) {
        setAttribute(each, "width", String(width));
        setAttribute(each, "height", String(height));
      }
      setAttribute(this.image, "href", picture.image.src);
    } else setAttribute(this.image, "href", "");
    this.draw();
    this.frame();
  }

  /**
   * @param {boolean} movable Can the cut be dragged?
   * @param {boolean} placing Does a tap place a cut?
   */
  allow(movable, placing) {
    if (movable === this.movable && placing === this.placing) return;
    this.movable = movable;
    this.placing = placing;
    this.classList.toggle("placing", placing);
    this.draw();
  }

  /** The cut is where it was, unless it is just being dragged. */
  putBack() {
    if (this.dragging) return;
    this.along = 0;
    this.draw();
  }

  draw() {
    const { cut, along } = this;
    const canes = cut ? [] : (this.picture?.drawing.canes ?? []);
    setAttribute(this.canes, "d", canes.map(linePath).join(""));
    setAttribute(this.handle, "visibility", cut && this.movable ? "inherit" : "hidden");
    const distance = `${along > 0 ? "+" : "−"}${Math.abs(Math.round(1000 * along))}`;
    setText(this.moved, text("picture.moved", { distance }));
    this.moved.hidden = along === 0;
    this.blade.replaceChildren();
    this.nodes.replaceChildren();
    this.others.replaceChildren();
    this.falls.replaceChildren();
    for (const other of this.picture?.drawing.cuts ?? []) {
      if (other === cut) continue;
      const half = Math.max(MIN_BLADE, BLADE * 1.25 * other.thickness);
      this.others.append(svg("path", { d: `M0 ${-half}V${half}`, transform: turnOf(cutPlace(other)) }));
    }
    setAttribute(this.stays, "d", cut ? woodPath(cut.axis, along, "stays") : "");
    // Where only a part of the picture has room, it is the one around the cut.
    const height = this.picture?.drawing.size[1] ?? 1;
    this.style.setProperty("--cut", cut ? (cut.position[1] / height).toFixed(3) : "0.5");
    if (!cut) return;
    const width = Math.max(3, 1.25 * cut.thickness);
    for (const path of [woodPath(cut.axis, along, "falls"), ...cut.falls.map(linePath)]) {
      if (path) this.falls.append(svg("path", { d: path, "stroke-width": width.toFixed(1) }));
    }
    const kept = cut.nodes.filter(([, , s]) => s < along);
    for (const [x, y] of kept) this.nodes.append(svg("circle", { cx: x, cy: y, r: (0.75 * width).toFixed(1) }));
    const at = along === 0 ? cutPlace(cut) : placeAt(cut.axis, along);
    this.drawBlade(at, Math.max(MIN_BLADE, BLADE * width));
    setAttribute(this.handle, "cx", at.x.toFixed(1));
    setAttribute(this.handle, "cy", at.y.toFixed(1));
  }

  /**
   * A line across the wood, and a blade that closes from each side.
   *
   * @param {import("../js/views/cut-geometry.js").Place} at
   * @param {number} half Of its length (px of the picture).
   */
  drawBlade(at, half) {
    const turn = turnOf(at);
    const line = `M0 ${-half}V${half}`;
    const tip = 0.34 * half;
    const blades = [-1, 1].map((side) => `M0 ${side * 0.62 * half}L${-tip} ${side * half * 1.25}H${tip}z`).join("");
    for (const layer of ["edge", "core"]) this.blade.append(svg("path", { d: line, class: layer, transform: turn }));
    this.blade.append(svg("path", { d: blades, class: "tips", transform: turn }));
  }

  // --- zoom ---

  /** Show the part of the picture that is zoomed to, as large as there is room. */
  frame() {
    const [width, height] = this.picture?.drawing.size ?? [4, 3];
    const half = 0.5 / this.zoom;
    for (const axis of /** @type {const} */ (["x", "y"])) this.centre[axis] = Math.max(half, Math.min(1 - half, this.centre[axis]));
    const [w, h] = [width / this.zoom, height / this.zoom];
    const [x, y] = [this.centre.x * width - w / 2, this.centre.y * height - h / 2];
    setAttribute(this.drawing, "viewBox", [x, y, w, h].map((each) => each.toFixed(2)).join(" "));
    setAttribute(this.handle, "r", (HANDLE / this.pixelSize()).toFixed(1));
    this.classList.toggle("zoomed", this.zoom > 1);
  }

  /** Size of a pixel of the picture on the screen (px). */
  pixelSize() {
    return Math.max(1e-3, this.drawing.getScreenCTM()?.a ?? 1);
  }

  /**
   * @param {number} zoom
   * @param {{ x: number, y: number }} [about] What stays where it is, as a share of the picture.
   */
  zoomTo(zoom, about = this.centre) {
    if (!this.picture) return;
    const to = Math.max(1, Math.min(MAX_ZOOM, zoom));
    const part = this.zoom / to;
    this.centre = { x: about.x + part * (this.centre.x - about.x), y: about.y + part * (this.centre.y - about.y) };
    this.zoom = to;
    this.frame();
  }

  /** @param {{ clientX: number, clientY: number }} event */
  placeOf(event) {
    const toScreen = this.drawing.getScreenCTM();
    return toScreen ? new DOMPoint(event.clientX, event.clientY).matrixTransform(toScreen.inverse()) : new DOMPoint();
  }

  /** @param {{ clientX: number, clientY: number }} event */
  shareAt(event) {
    const [width, height] = this.picture?.drawing.size ?? [1, 1];
    const { x, y } = this.placeOf(event);
    return { x: x / width, y: y / height };
  }

  // --- pointers ---

  /** @param {PointerEvent} event */
  down(event) {
    if (event.button !== 0 || !this.picture) return;
    const at = { x: event.clientX, y: event.clientY };
    this.pointers.set(event.pointerId, { ...at, from: at });
    this.drawing.setPointerCapture(event.pointerId);
    this.isTap = this.pointers.size === 1;
    this.dragging = this.isTap && this.movable && event.target === this.handle;
    if (this.dragging) event.preventDefault();
  }

  /** @param {PointerEvent} event */
  move(event) {
    const pointer = this.pointers.get(event.pointerId);
    if (!pointer) return;
    const before = { x: pointer.x, y: pointer.y };
    [pointer.x, pointer.y] = [event.clientX, event.clientY];
    if (Math.hypot(pointer.x - pointer.from.x, pointer.y - pointer.from.y) > TAP) this.isTap = false;
    if (this.pointers.size === 2) this.pinch(event.pointerId, before);
    else if (this.dragging && this.cut && !this.isTap) {
      const { x, y } = this.placeOf(event);
      const along = Math.max(-MAX_MOVE, Math.min(MAX_MOVE, nearestArc(this.cut.axis, [x, y])));
      this.along = Math.round(1000 * along) / 1000;
      this.draw();
    } else if (this.zoom > 1 && !this.isTap) this.pan(pointer.x - before.x, pointer.y - before.y);
  }

  /**
   * @param {number} dx (px on the screen)
   * @param {number} dy
   */
  pan(dx, dy) {
    const [width, height] = this.picture?.drawing.size ?? [1, 1];
    const size = this.pixelSize();
    this.centre = { x: this.centre.x - dx / size / width, y: this.centre.y - dy / size / height };
    this.frame();
  }

  /**
   * @param {number} moved The pointer that has moved.
   * @param {{ x: number, y: number }} before Where it was.
   */
  pinch(moved, before) {
    const other = [...this.pointers].find(([id]) => id !== moved)?.[1];
    const pointer = this.pointers.get(moved);
    if (!other || !pointer) return;
    const apart = (/** @type {{ x: number, y: number }} */ at) => Math.hypot(at.x - other.x, at.y - other.y);
    const middle = { clientX: (pointer.x + other.x) / 2, clientY: (pointer.y + other.y) / 2 };
    this.zoomTo((this.zoom * apart(pointer)) / Math.max(1, apart(before)), this.shareAt(middle));
    this.pan((pointer.x - before.x) / 2, (pointer.y - before.y) / 2);
  }

  /** @param {PointerEvent} event */
  up(event) {
    if (!this.pointers.delete(event.pointerId)) return;
    const cancelled = event.type === "pointercancel";
    if (this.dragging) {
      this.dragging = false;
      if (cancelled || this.along === 0) this.putBack();
      else this.dispatchEvent(new CustomEvent("move-cut", { detail: { along: this.along } }));
    } else if (this.isTap && this.placing && !cancelled && this.picture) {
      const { drawing } = this.picture;
      const { x, y } = this.placeOf(event);
      const [width, height] = drawing.size;
      if (x < 0 || y < 0 || x > width || y > height) return;
      const [left, top, w, h] = drawing.window;
      const [u, v] = [(left + (x / width) * w) / drawing.frame[0], (top + (y / height) * h) / drawing.frame[1]];
      this.dispatchEvent(new CustomEvent("place", { detail: { sequence: drawing.sequence, u, v } }));
    }
    this.isTap = false;
  }
}

/** @param {DrawnCut} cut */
function cutPlace(cut) {
  return { ...placeAt(cut.axis, 0), x: cut.position[0], y: cut.position[1] };
}

/** @param {import("../js/views/cut-geometry.js").Place} at */
function turnOf({ x, y, angle }) {
  return `translate(${x.toFixed(1)} ${y.toFixed(1)}) rotate(${((180 / Math.PI) * angle).toFixed(1)})`;
}
customElements.define("rp-cut-picture", RpCutPicture);
