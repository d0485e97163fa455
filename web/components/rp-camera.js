// Panel with the eye-in-hand camera's image and the points on it. Freeze holds the image; a click can place a point.

import { placePoint, placing } from "../js/control/placing.js";
import { selectAndReveal } from "../js/control/selection.js";
import { ageWords } from "../js/state/format.js";
import { link, now, pageState, points, selected, staleWords } from "../js/state/page-state.js";
import { drawOn, signal } from "../js/state/signals.js";
import { labelOf, text } from "../js/state/texts.js";
import { element, panelHead, setText, svg } from "../js/views/dom.js";

/** @typedef {import("../js/link/messages.js").PagePoint} PagePoint */
/** @typedef {readonly [number, number]} Pixel */

/**
 * Small signs inside the ring, in pixels around its centre.
 *
 * @type {Readonly<Record<import("../js/link/messages.js").PointState, string>>}
 */
const SIGNS = Object.freeze({
  PROPOSED: "M0 -.5v1",
  ACCEPTED: "M-3 .2l2.2 2.2L3 -2.4",
  UNREACHABLE: "M-4.5 0h9",
  CUTTING: "M-3 -3l6 6M3 -3l-6 6M0 -4v8",
  DONE: "M-3 .2l2.2 2.2L3 -2.4M-4.5 5.5h9",
  FAILED_NOT_CUT: "M0 -3.6v4M0 2.8v.6",
  UNKNOWN: "M-1.8 -2a1.9 1.9 0 1 1 2.4 2.4l-.6 1M0 3.4v.3",
  REJECTED: "M-3 -3l6 6M3 -3l-6 6",
});

/** Line of the blades, for a cane along x. */
const BLADES = "M0 -14V-7M0 7V14";

class CameraMarks {
  /** @param {SVGSVGElement} overlay */
  constructor(overlay) {
    this.overlay = overlay;
    /** @type {Map<string, SVGGElement>} */
    this.marks = new Map();
  }

  /**
   * @param {readonly PagePoint[]} rows
   * @param {(row: PagePoint) => Pixel|null} place Where a point is in the image that is shown.
   * @param {number} unit Image pixels for one pixel of a 320-pixel-wide picture.
   */
  show(rows, place, unit) {
    const gone = new Set(this.marks.keys());
    for (const row of rows) {
      const pixel = place(row);
      if (pixel === null) continue;
      gone.delete(row.point.point_id);
      this.draw(row, pixel, unit);
    }
    for (const id of gone) {
      this.marks.get(id)?.remove();
      this.marks.delete(id);
    }
  }

  /**
   * @param {PagePoint} row
   * @param {Pixel} pixel
   * @param {number} unit
   */
  draw({ point, entry, cane_angle: angle }, [x, y], unit) {
    let mark = this.marks.get(point.point_id);
    if (!mark) {
      mark = svg("g", { class: "mark" });
      mark.append(
        svg("circle", { class: "target", r: 14 * unit }),
        svg("circle", { class: "halo", r: 7 * unit }),
        svg("path", { class: "halo", d: BLADES }),
        svg("path", { class: "ring", d: BLADES }),
        svg("circle", { class: "ring", r: 7 * unit }),
        svg("path", { class: "sign" }),
        svg("title"),
      );
      mark.addEventListener("click", () => selectAndReveal(point.point_id));
      this.marks.set(point.point_id, mark);
      this.overlay.append(mark);
    }
    mark.dataset.state = entry.state;
    mark.classList.toggle("selected", selected.get() === point.point_id);
    mark.setAttribute("transform", `translate(${x.toFixed(1)} ${y.toFixed(1)})`);
    const [, , halo, blades, , sign, title] = mark.children;
    for (const each of [halo, blades]) {
      each?.setAttribute("visibility", angle === null ? "hidden" : "inherit");
      each?.setAttribute("transform", `rotate(${((angle ?? 0) * (180 / Math.PI)).toFixed(0)}) scale(${unit})`);
    }
    sign?.setAttribute("d", SIGNS[entry.state]);
    sign?.setAttribute("transform", `scale(${unit})`);
    if (title) setText(title, text("review.mark", { vine: point.vine, spur: point.spur, status: labelOf(entry.state) }));
  }
}

/** Age from which an image is stale (ms); images arrive at 2 Hz. */
const OLD_MS = 2500;

class RpCamera extends HTMLElement {
  constructor() {
    super();
    this.image = element("img", { attributes: { alt: text("camera.image") } });
    this.overlay = svg("svg", { role: "group", "aria-label": text("camera.points") });
    this.empty = element("p", { class: "empty", text: text("camera.waiting"), attributes: { role: "status" } });
    this.picture = element("div", { class: "picture" }, this.image, this.empty);
    this.shownFrame = 0;
    this.frameAt = 0;
    this.loading = false;
    /** Pixels of the points in the frozen image; null while it is live. */
    this.held = signal(/** @type {Map<string, Pixel>|null} */ (null));
  }

  connectedCallback() {
    const source = element("span", { class: "tag" });
    const freeze = element("button", { id: "freeze", class: "quiet", text: text("camera.freeze") });
    const { head, note } = panelHead(text("camera.title"), source, freeze);
    this.picture.append(this.overlay);
    this.append(head, this.picture);
    this.image.hidden = true;

    pageState.subscribe(() => this.fetchNewest());
    drawOn([pageState, link, now, this.held], () => {
      const held = this.held.get() !== null;
      const age = performance.now() - this.frameAt;
      let words = staleWords("bridge");
      if (!words && held) words = text("stale.frozen", { age: ageWords(age / 1000) });
      else if (!words && this.frameAt > 0 && age > OLD_MS) words = text("stale.image", { age: ageWords(age / 1000) });
      setText(note, words);
      this.classList.toggle("stale", words !== "" && !held);
      this.classList.toggle("frozen", held);
      const kind = pageState.get()?.bridge?.kind ?? "real";
      setText(source, text(`camera.${kind}`));
      source.title = text(`camera.${kind}.hint`);
    });

    freeze.addEventListener("click", () => {
      this.held.set(this.held.get() === null ? this.pixels() : null);
      this.fetchNewest();
    });
    drawOn([this.held], () => {
      const held = this.held.get() !== null;
      freeze.setAttribute("aria-pressed", String(held));
      freeze.title = text(held ? "camera.live_hint" : "camera.freeze_hint");
    });
    this.overlay.addEventListener("click", (event) => void this.clicked(event));

    const marks = new CameraMarks(this.overlay);
    drawOn([points, selected, this.held], () => {
      const page = points.get();
      const [width, height] = page?.image_size ?? [0, 0];
      if (width > 0) {
        this.overlay.setAttribute("viewBox", `0 0 ${width} ${height}`);
        this.picture.style.setProperty("aspect-ratio", `${width} / ${height}`);
      }
      const held = this.held.get();
      marks.show(
        page?.points ?? [],
        (row) => (held === null ? row.pixel : (held.get(row.point.point_id) ?? null)),
        Math.max(width, 1) / 320,
      );
    });
  }

  /** @returns {Map<string, Pixel>} */
  pixels() {
    const out = new Map();
    for (const row of points.get()?.points ?? []) if (row.pixel !== null) out.set(row.point.point_id, row.pixel);
    return out;
  }

  /** Decode before showing, so that the image never flashes empty. */
  fetchNewest() {
    const frame = pageState.get()?.camera_frame ?? 0;
    if (this.loading || frame === this.shownFrame || frame === 0 || this.held.get() !== null) return;
    this.loading = true;
    const next = new Image();
    next.addEventListener("load", () => {
      this.loading = false;
      if (this.held.get() !== null) return;
      this.shownFrame = frame;
      this.frameAt = performance.now();
      this.image.src = next.src;
      this.image.hidden = false;
      this.empty.hidden = true;
    });
    next.addEventListener("error", () => {
      this.loading = false;
      if (this.image.hidden) setText(this.empty, text("camera.failed"));
    });
    next.src = `camera/color.jpg?n=${frame}`;
  }

  /** @param {MouseEvent} event */
  async clicked(event) {
    const [width, height] = points.get()?.image_size ?? [0, 0];
    const toScreen = this.overlay.getScreenCTM();
    if (!placing.get() || this.image.hidden || width === 0 || toScreen === null) return;
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(toScreen.inverse());
    const [u, v] = [at.x / width, at.y / height];
    if (u < 0 || u > 1 || v < 0 || v > 1) return;
    const name = await placePoint("api/points/by-hand-in-image", { sequence: this.shownFrame, u, v });
    const held = this.held.get();
    // A frozen image gets no new pixels: the point is where it was clicked.
    if (name && held !== null) this.held.set(new Map(held).set(name, [at.x, at.y]));
  }
}
customElements.define("rp-camera", RpCamera);
