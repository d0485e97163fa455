// Details of the selected point: its image crop, figures, and adjustment of cut and approach.

import { move, whyNotMove } from "../js/control/decisions.js";
import { turnApproach, whyNotTurn } from "../js/control/order.js";
import { newtons, uncertainty } from "../js/state/format.js";
import { reason } from "../js/state/reasons.js";
import { text } from "../js/state/texts.js";
import { element, setEnabled, setText } from "../js/views/dom.js";

/** @typedef {import("../js/link/messages.js").PagePoint} PagePoint */
/** @typedef {import("../js/link/messages.js").PruningPoint} PruningPoint */

/** A missing crop is requested again after this time (ms), this many times. */
const AGAIN_MS = 1500;
const TRIES = 20;
/** Debounce of the slider (ms). */
const SETTLE_MS = 150;
/** Steps along the cane (mm). */
const STEPS = Object.freeze([-5, -1, 1, 5]);

/** Their words are `details.NAME`. @type {readonly (readonly [name: string, value: (point: PruningPoint) => string])[]} */
const FACTS = Object.freeze([
  ["cut", cutWords],
  ["keeps", (point) => text("details.nodes", { kept: point.nodes_kept, seen: point.nodes_seen })],
  ["cane", caneWords],
  ["place", placeWords],
  ["clear", clearWords],
  ["content", (point) => `${point.revision} · ${point.digest.slice(0, 8) || "–"}`],
]);

/** @param {PruningPoint} point */
function cutWords(point) {
  const kind = text(`details.kind.${point.kind}`);
  if (point.offset === null) return kind;
  return text("details.past", { kind, offset: Math.round(1000 * point.offset), node: point.nodes_kept });
}

/** @param {PruningPoint} point */
function caneWords(point) {
  const thick = `${(2000 * point.radius).toFixed(1)} mm`;
  return point.force > 0 ? `${thick}, ≈ ${newtons(point.force)}` : thick;
}

/** @param {PruningPoint} point */
function placeWords(point) {
  if (point.position_covariance === null) return "–";
  const place = `± ${(1000 * uncertainty(point.position_covariance)).toFixed(1)} mm`;
  if (point.tangent_covariance === null) return place;
  return `${place}, ± ${((180 / Math.PI) * uncertainty(point.tangent_covariance)).toFixed(0)}°`;
}

/** @param {PruningPoint} point */
function clearWords(point) {
  const near = /** @type {[string, number|null][]} */ ([
    ["wire", point.wire_distance],
    ["cordon", point.cordon_distance],
    ["node", point.node_distance],
  ]);
  const known = near.filter(([, distance]) => distance !== null);
  if (known.length === 0) return text("details.nothing_near");
  const distances = known.map(([name, distance]) => `${text(`details.near.${name}`)} ${Math.round(1000 * (distance ?? 0))}`);
  return `${distances.join(" · ")} mm`;
}

export class RpPointDetails extends HTMLElement {
  constructor() {
    super();
    this.picture = element("img", { attributes: { alt: text("details.crop") } });
    this.frame = element("figure", { class: "crop" }, this.picture);
    this.facts = element("dl", { class: "number" });
    this.values = FACTS.map(() => element("dd"));
    this.moves = element("div", { class: "moves", attributes: { role: "group", "aria-label": text("details.move_label") } });
    /** @type {PagePoint|null} */
    this.row = null;
    this.buttons = STEPS.map((step) => {
      const words = `${step > 0 ? "+" : "−"}${Math.abs(step)}`;
      return element("button", { class: "quiet", text: words, onclick: () => this.move(step) });
    });
    this.moves.append(element("span", { text: text("details.move") }), ...this.buttons);
    this.turn = element("input", {
      attributes: {
        type: "range",
        min: "-75",
        max: "75",
        step: "5",
        "aria-label": text("details.turn"),
      },
    });
    this.turned = element("span", { class: "number" });
    this.free = element("button", {
      class: "quiet",
      text: text("details.as_found"),
      onclick: () => this.row && void turnApproach(this.row, null),
    });
    this.turning = 0;
    this.turn.addEventListener("input", () => this.turnTo(Number(this.turn.value)));
    this.approach = element(
      "div",
      { class: "approach" },
      element("span", { text: text("details.approach") }),
      this.turn,
      this.turned,
      this.free,
    );
    this.shown = "";
    this.tries = 0;
    this.timer = 0;
  }

  connectedCallback() {
    if (this.childElementCount > 0) return;
    FACTS.forEach(([name], at) => {
      const [term, title] = [element("dt", { text: text(`details.${name}`) }), text(`details.${name}.hint`)];
      this.facts.append(element("div", { attributes: { title } }, term, this.values[at] ?? ""));
    });
    this.picture.addEventListener("load", () => this.frame.classList.add("loaded"));
    this.picture.addEventListener("error", () => {
      if (this.tries++ >= TRIES) return;
      this.timer = window.setTimeout(() => this.fetch(), AGAIN_MS);
    });
    this.append(this.frame, this.facts, this.moves, this.approach);
  }

  /** @param {number} step */
  move(step) {
    if (this.row) void move(this.row, step);
  }

  /** Debounced while the slider is dragged. @param {number} degrees */
  turnTo(degrees) {
    setText(this.turned, `${degrees}°`);
    window.clearTimeout(this.turning);
    const row = this.row;
    this.turning = window.setTimeout(() => {
      this.turning = 0;
      if (row) void turnApproach(row, (degrees * Math.PI) / 180);
    }, SETTLE_MS);
  }

  /** @param {PagePoint} row */
  showApproach(row) {
    const { azimuth } = row.entry;
    const why = whyNotTurn(row);
    setEnabled(this.turn, why, text("details.turn_hint"));
    setEnabled(
      this.free,
      why ?? (azimuth === null ? reason("approach_free") : null),
      text("details.as_found_hint"),
    );
    if (this.turning) return;
    const degrees = azimuth === null ? 0 : Math.round((180 * azimuth) / Math.PI);
    this.turn.value = String(degrees);
    setText(this.turned, azimuth === null ? text("details.found") : `${degrees}°`);
  }

  /** @param {PagePoint} row */
  show(row) {
    this.row = row;
    this.showApproach(row);
    const { point } = row;
    const why = whyNotMove(row);
    this.buttons.forEach((button, at) => {
      const step = STEPS[at] ?? 0;
      setEnabled(button, why, text(step > 0 ? "details.move_out" : "details.move_in", { distance: Math.abs(step) }));
    });
    FACTS.forEach(([, value], at) => {
      const node = this.values[at];
      if (node) setText(node, value(point));
    });
    // A restarted perception reuses ids: the hash distinguishes the points.
    const path = `api/points/${encodeURIComponent(point.point_id)}/picture?of=${point.digest}`;
    if (path === this.shown) return;
    this.shown = path;
    this.tries = 0;
    window.clearTimeout(this.timer);
    this.frame.classList.remove("loaded");
    this.fetch();
  }

  fetch() {
    this.picture.src = this.tries === 0 ? this.shown : `${this.shown}&try=${this.tries}`;
  }
}
customElements.define("rp-point-details", RpPointDetails);
