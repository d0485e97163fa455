// What the eye-in-hand camera sees, with the pruning points drawn on it.

import { element, panelHead, setText, svg } from "../element.js";
import { link, now, pageState, points, selected, staleWords } from "../state.js";
import { drawOn } from "../store.js";
import { select } from "../teleoperation.js";
import { POINT_WORDS, ageWords } from "../words.js";

/** @typedef {import("../messages.js").PagePoint} PagePoint */

/** Frames come at 2 Hz; one that is this old (ms) is called old. */
const OLD_MS = 2500;

class RpCamera extends HTMLElement {
  connectedCallback() {
    const source = element("span", { class: "tag", attributes: { title: "The robot and its camera are simulated" } });
    const { head, note } = panelHead("Camera", source);
    const image = element("img", { attributes: { alt: "What the camera at the tool sees" } });
    const overlay = svg("svg", { role: "group", "aria-label": "Pruning points in the image" });
    const empty = element("p", { class: "empty", text: "Waiting for the first image…", attributes: { role: "status" } });
    const picture = element("div", { class: "picture" }, image, empty);
    picture.append(overlay);
    this.append(head, picture);
    image.hidden = true;

    let shownFrame = 0;
    let loading = false;
    let frameAt = 0;
    const fetchNewest = () => {
      const frame = pageState.get()?.camera_frame ?? 0;
      if (loading || frame === shownFrame || frame === 0) return;
      loading = true;
      // Decoded aside first: the picture never flashes empty between two frames.
      const next = new Image();
      next.addEventListener("load", () => {
        loading = false;
        shownFrame = frame;
        frameAt = performance.now();
        image.src = next.src;
        image.hidden = false;
        empty.hidden = true;
      });
      next.addEventListener("error", () => {
        loading = false;
        shownFrame = frame;
        if (image.hidden) setText(empty, "The image did not load; trying the next one.");
      });
      next.src = `/camera/color.jpg?n=${frame}`;
    };
    pageState.subscribe(fetchNewest);
    drawOn([pageState, link, now], () => {
      let words = staleWords("bridge");
      const age = performance.now() - frameAt;
      if (!words && frameAt > 0 && age > OLD_MS) words = `image ${ageWords(age / 1000)} old`;
      setText(note, words);
      this.classList.toggle("stale", words !== "");
      setText(source, pageState.get()?.bridge?.kind === "sim" ? "simulation" : "");
    });

    /** @type {Map<string, SVGGElement>} */
    const marks = new Map();
    drawOn([points, selected], () => {
      const page = points.get();
      const [width, height] = page?.image_size ?? [0, 0];
      if (width > 0) {
        overlay.setAttribute("viewBox", `0 0 ${width} ${height}`);
        picture.style.setProperty("aspect-ratio", `${width} / ${height}`);
      }
      const unit = Math.max(width, 1) / 320;
      const visible = (page?.points ?? []).filter((row) => row.pixel !== null);
      const wanted = new Set(visible.map((row) => row.point.point_id));
      for (const [id, mark] of marks) {
        if (wanted.has(id)) continue;
        mark.remove();
        marks.delete(id);
      }
      for (const row of visible) drawMark(overlay, marks, row, unit);
    });
  }
}

/**
 * @param {SVGSVGElement} overlay
 * @param {Map<string, SVGGElement>} marks
 * @param {PagePoint} row
 * @param {number} unit Image pixels for one pixel of a 320-pixel-wide picture.
 */
function drawMark(overlay, marks, row, unit) {
  const { point, entry, pixel } = row;
  if (pixel === null) return;
  let mark = marks.get(point.point_id);
  if (!mark) {
    mark = svg("g", { class: "mark" });
    mark.append(
      svg("circle", { class: "target", r: 14 * unit }),
      svg("circle", { class: "halo", r: 7 * unit }),
      svg("circle", { class: "ring", r: 7 * unit }),
      svg("path", { class: "sign" }),
      svg("title"),
    );
    mark.addEventListener("click", () => select(point.point_id));
    marks.set(point.point_id, mark);
    overlay.append(mark);
  }
  mark.dataset.state = entry.state;
  mark.classList.toggle("selected", selected.get() === point.point_id);
  mark.setAttribute("transform", `translate(${pixel[0].toFixed(1)} ${pixel[1].toFixed(1)})`);
  const [, , , sign, title] = mark.children;
  sign?.setAttribute("d", SIGNS[entry.state]);
  sign?.setAttribute("transform", `scale(${unit})`);
  if (title) setText(title, `${point.point_id}: ${POINT_WORDS[entry.state]}`);
}

/** Small signs inside the ring, in pixels around its centre. @type {Readonly<Record<import("../messages.js").PointState, string>>} */
const SIGNS = Object.freeze({
  PROPOSED: "M0 -.5v1",
  ACCEPTED: "M-3 .2l2.2 2.2L3 -2.4",
  INTENT: "M-3 -3l6 6M3 -3l-6 6M0 -4v8",
  DONE: "M-3 .2l2.2 2.2L3 -2.4M-4.5 5.5h9",
  FAILED_NOT_CUT: "M0 -3.6v4M0 2.8v.6",
  UNKNOWN: "M-1.8 -2a1.9 1.9 0 1 1 2.4 2.4l-.6 1M0 3.4v.3",
  REJECTED: "M-3 -3l6 6M3 -3l-6 6",
});
customElements.define("rp-camera", RpCamera);
