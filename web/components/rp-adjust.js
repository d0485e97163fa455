// What can be changed about a point: the cut along its cane, from where the blades come; and the figures behind it.

import { move, whyNotMove } from "../js/control/decisions.js";
import { turnApproach, whyNotTurn } from "../js/control/order.js";
import { decimal, newtons, uncertainty } from "../js/state/format.js";
import { reason } from "../js/state/reasons.js";
import { text } from "../js/state/texts.js";
import { element, setEnabled, setText } from "../js/views/dom.js";

/** @typedef {import("../js/link/messages.js").PagePoint} PagePoint */
/** @typedef {import("../js/link/messages.js").PruningPoint} PruningPoint */

/** Debounce of the slider (ms). */
const SETTLE_MS = 150;
/** Steps along the cane (mm). */
const STEPS = Object.freeze([-5, -1, 1, 5]);

/** Their words are `details.NAME`; one without a value is not shown. @type {readonly (readonly [name: string, value: (point: PruningPoint) => string])[]} */
const FACTS = Object.freeze([
  ["cut", cutWords],
  ["keeps", keepsWords],
  ["sure", (point) => `${Math.floor(100 * point.confidence + 1e-9)} %`],
  ["cane", caneWords],
  ["place", placeWords],
  ["clear", clearWords],
]);

/** @param {PruningPoint} point */
function cutWords(point) {
  const kind = text(`details.kind.${point.kind}`);
  if (point.offset === null) return kind;
  return text("details.past", { kind, offset: Math.round(1000 * point.offset), node: point.nodes_kept });
}

/** Of last year's cane nothing stays, and its shoots are not counted. @param {PruningPoint} point */
function keepsWords(point) {
  return point.kind === "removal" ? "" : text("details.nodes", { kept: point.nodes_kept, seen: point.nodes_seen });
}

/** @param {PruningPoint} point */
function caneWords(point) {
  const thick = `${decimal(2000 * point.radius, 1)} mm`;
  return point.force > 0 ? `${thick}, ≈ ${newtons(point.force)}` : thick;
}

/** @param {PruningPoint} point */
function placeWords(point) {
  if (point.position_covariance === null) return "–";
  const place = `± ${decimal(1000 * uncertainty(point.position_covariance), 1)} mm`;
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

export class RpAdjust extends HTMLElement {
  constructor() {
    super();
    /** @type {PagePoint|null} */
    this.row = null;
    this.values = FACTS.map(() => element("dd"));
    this.buttons = STEPS.map((step) => {
      const words = `${step > 0 ? "+" : "−"}${Math.abs(step)}`;
      return element("button", { text: words, onclick: () => this.row && void move(this.row, step) });
    });
    const turn = { type: "range", min: "-75", max: "75", step: "5", "aria-label": text("details.turn") };
    this.turn = element("input", { attributes: turn });
    this.turned = element("span", { class: "number" });
    this.free = element("button", {
      text: text("details.as_found"),
      onclick: () => this.row && void turnApproach(this.row, null),
    });
    this.turning = 0;
  }

  connectedCallback() {
    if (this.childElementCount > 0) return;
    this.turn.addEventListener("input", () => this.turnTo(Number(this.turn.value)));
    const facts = FACTS.map(([name], at) => {
      const [term, title] = [element("dt", { text: text(`details.${name}`) }), text(`details.${name}.hint`)];
      return element("div", { attributes: { title } }, term, this.values[at] ?? "");
    });
    const moves = { role: "group", "aria-label": text("details.move_label") };
    this.append(
      element(
        "details",
        { class: "adjust" },
        element("summary", { text: text("review.adjust") }),
        element("div", { class: "moves", attributes: moves }, element("span", { text: text("details.move") }), ...this.buttons),
        element("div", { class: "approach" }, element("span", { text: text("details.approach") }), this.turn, this.turned, this.free),
        element("dl", { class: "number" }, ...facts),
      ),
    );
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
  show(row) {
    this.row = row;
    const why = whyNotMove(row);
    this.buttons.forEach((button, at) => {
      const step = STEPS[at] ?? 0;
      setEnabled(button, why, text(step > 0 ? "details.move_out" : "details.move_in", { distance: Math.abs(step) }));
    });
    FACTS.forEach(([, value], at) => {
      const node = this.values[at];
      if (!node?.parentElement) return;
      const words = value(row.point);
      setText(node, words);
      node.parentElement.hidden = words === "";
    });
    const { azimuth } = row.entry;
    const whyNot = whyNotTurn(row);
    setEnabled(this.turn, whyNot, text("details.turn_hint"));
    setEnabled(this.free, whyNot ?? (azimuth === null ? reason("approach_free") : null), text("details.as_found_hint"));
    if (this.turning) return;
    const degrees = azimuth === null ? 0 : Math.round((180 * azimuth) / Math.PI);
    this.turn.value = String(degrees);
    setText(this.turned, azimuth === null ? text("details.found") : `${degrees}°`);
  }
}
customElements.define("rp-adjust", RpAdjust);
