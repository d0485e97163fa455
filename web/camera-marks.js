// Pruning points drawn on the camera's image.

import { setText, svg } from "./element.js";
import { selected } from "./state.js";
import { bring } from "./teleoperation.js";
import { POINT_WORDS } from "./words.js";

/** @typedef {import("./messages.js").PagePoint} PagePoint */
/** @typedef {readonly [number, number]} Pixel */

/** Small signs inside the ring, in pixels around its centre. @type {Readonly<Record<import("./messages.js").PointState, string>>} */
const SIGNS = Object.freeze({
  PROPOSED: "M0 -.5v1",
  ACCEPTED: "M-3 .2l2.2 2.2L3 -2.4",
  UNREACHABLE: "M-4.5 0h9",
  INTENT: "M-3 -3l6 6M3 -3l-6 6M0 -4v8",
  DONE: "M-3 .2l2.2 2.2L3 -2.4M-4.5 5.5h9",
  FAILED_NOT_CUT: "M0 -3.6v4M0 2.8v.6",
  UNKNOWN: "M-1.8 -2a1.9 1.9 0 1 1 2.4 2.4l-.6 1M0 3.4v.3",
  REJECTED: "M-3 -3l6 6M3 -3l-6 6",
});

/** Where the blades close, square to a cane that runs to the right. */
const BLADES = "M0 -14V-7M0 7V14";

export class CameraMarks {
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
      mark.addEventListener("click", () => bring(point.point_id));
      this.marks.set(point.point_id, mark);
      this.overlay.append(mark);
    }
    mark.dataset.state = entry.state;
    mark.classList.toggle("selected", selected.get() === point.point_id);
    mark.setAttribute("transform", `translate(${x.toFixed(1)} ${y.toFixed(1)})`);
    const [, , halo, blades, , sign, title] = mark.children;
    for (const each of [halo, blades]) {
      each?.setAttribute("visibility", angle === null ? "hidden" : "visible");
      each?.setAttribute("transform", `rotate(${((angle ?? 0) * (180 / Math.PI)).toFixed(0)}) scale(${unit})`);
    }
    sign?.setAttribute("d", SIGNS[entry.state]);
    sign?.setAttribute("transform", `scale(${unit})`);
    if (title) setText(title, `${point.point_id}: ${POINT_WORDS[entry.state]}`);
  }
}
