// One number with its unit, a bar against its limit, and its last half minute.

import { element, setText, svg } from "../element.js";

/** @typedef {import("../readings.js").Reading} Reading */

const SAMPLES = 120;
const WIDTH = 60;
const HEIGHT = 18;

export class RpGauge extends HTMLElement {
  /** @type {Reading|null} */
  kind = null;
  /** @type {(number|null)[]} */
  samples = [];
  value = element("span", { class: "value number" });
  fill = element("span", { class: "fill" });
  line = svg("polyline", { class: "trend" });
  warning = element("span", { class: "gauge-warning" });

  /** @param {Reading} kind */
  begin(kind) {
    this.kind = kind;
    this.dataset.gauge = kind.id;
    this.title = kind.about;
    this.setAttribute("role", "meter");
    this.setAttribute("aria-label", kind.label);
    this.setAttribute("aria-valuemin", "0");
    this.setAttribute("aria-valuemax", String(kind.full));
    const trend = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "trend-box", "aria-hidden": "true" }, this.line);
    this.append(
      element("span", { class: "label", text: kind.label }),
      element("span", { class: "trend-cell" }, trend, this.warning),
      element("span", { class: "reading" }, this.value, element("span", { class: "unit", text: kind.unit })),
      element("span", { class: "bar" }, this.fill),
    );
  }

  /** @param {number|null} value In the unit shown; null when unknown. */
  show(value) {
    const kind = this.kind;
    if (!kind) return;
    setText(this.value, value === null ? "–" : kind.write(value));
    const share = value === null ? 0 : Math.min(1, Math.max(0, value / kind.full));
    this.fill.style.setProperty("width", `${(100 * share).toFixed(1)}%`);
    const low = value !== null && kind.warnBelow !== undefined && value < kind.warnBelow;
    const high = value !== null && kind.warnAbove !== undefined && value > kind.warnAbove;
    this.dataset.warning = low ? "low" : high ? "high" : "";
    setText(this.warning, low ? "▾ low" : high ? "▴ high" : "");
    this.setAttribute("aria-valuetext", value === null ? "unknown" : `${kind.write(value)} ${kind.unit}`);
    this.setAttribute("aria-valuenow", value === null ? "0" : String(Math.min(kind.full, Math.max(0, value))));
  }

  /** Take the value into the trend. @param {number|null} value */
  remember(value) {
    const kind = this.kind;
    if (!kind) return;
    this.samples.push(value);
    if (this.samples.length > SAMPLES) this.samples.shift();
    const first = SAMPLES - this.samples.length;
    const corners = this.samples.flatMap((sample, index) => {
      if (sample === null) return [];
      const x = ((first + index) / (SAMPLES - 1)) * WIDTH;
      const y = HEIGHT - 1 - Math.min(1, Math.max(0, sample / kind.full)) * (HEIGHT - 2);
      return [`${x.toFixed(1)},${y.toFixed(1)}`];
    });
    this.line.setAttribute("points", corners.join(" "));
  }
}
customElements.define("rp-gauge", RpGauge);
