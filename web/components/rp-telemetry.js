// Telemetry gauges: tracking error, margins to limits, timing; and the way of the base.

import { decimal, degrees } from "../js/state/format.js";
import { isLive, link, now, pageState, staleWords } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setText, svg } from "../js/views/dom.js";
import { Odometer } from "../js/views/odometer.js";
import { READINGS, beyondLimit } from "../js/views/readings.js";

/** @typedef {import("../js/views/readings.js").Reading} Reading */

const SAMPLES = 120;
const WIDTH = 60;
const HEIGHT = 18;

class RpGauge extends HTMLElement {
  /** @type {Reading|null} */
  kind = null;
  /** @type {(number|null)[]} */
  samples = [];
  value = element("span", { class: "value number" });
  fill = element("span", { class: "fill" });
  line = svg("polyline", { class: "trend" });
  warning = element("span", { class: "gauge-warning" });

  /** @param {Reading} kind */
  init(kind) {
    this.kind = kind;
    this.dataset.gauge = kind.id;
    this.title = text(`reading.${kind.id}.hint`);
    this.setAttribute("role", "meter");
    this.setAttribute("aria-label", text(`reading.${kind.id}`));
    this.setAttribute("aria-valuemin", "0");
    this.setAttribute("aria-valuemax", String(kind.fullScale));
    const trend = svg(
      "svg",
      { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "trend-box", "aria-hidden": "true" },
      this.line,
    );
    this.append(
      element("span", { class: "label", text: text(`reading.${kind.id}`) }),
      element("span", { class: "trend-cell" }, trend, this.warning),
      element("span", { class: "reading" }, this.value, element("span", { class: "unit", text: kind.unit })),
      element("span", { class: "bar" }, this.fill),
    );
  }

  /** @param {number|null} value In the unit shown; null when unknown. */
  show(value) {
    const kind = this.kind;
    if (!kind) return;
    setText(this.value, value === null ? "–" : kind.format(value));
    const fraction = value === null ? 0 : Math.min(1, Math.max(0, value / kind.fullScale));
    this.fill.style.setProperty("width", `${(100 * fraction).toFixed(1)}%`);
    const side = beyondLimit(kind, value);
    this.dataset.warning = side;
    setText(this.warning, text(`telemetry.${side}`));
    this.setAttribute("aria-valuetext", value === null ? text("telemetry.unknown") : `${kind.format(value)} ${kind.unit}`);
    this.setAttribute("aria-valuenow", value === null ? "0" : String(Math.min(kind.fullScale, Math.max(0, value))));
  }

  /** Add a value to the trend. @param {number|null} value */
  addSample(value) {
    const kind = this.kind;
    if (!kind) return;
    this.samples.push(value);
    if (this.samples.length > SAMPLES) this.samples.shift();
    const first = SAMPLES - this.samples.length;
    const corners = this.samples.flatMap((sample, index) => {
      if (sample === null) return [];
      const x = ((first + index) / (SAMPLES - 1)) * WIDTH;
      const y = HEIGHT - 1 - Math.min(1, Math.max(0, sample / kind.fullScale)) * (HEIGHT - 2);
      return [`${x.toFixed(1)},${y.toFixed(1)}`];
    });
    this.line.setAttribute("points", corners.join(" "));
  }
}
customElements.define("rp-gauge", RpGauge);

/** Only a real robot's devices tell these. */
const OF_DEVICES = new Set(["battery", "arm-success"]);
/** The others have only charts. */
const SHOWN = READINGS.filter((reading) => reading.place !== "chart");

class RpTelemetry extends HTMLElement {
  connectedCallback() {
    // Moved among the panels.
    if (this.childElementCount > 0) return;
    const note = element("span", { class: "stale-note", attributes: { role: "status" } });
    this.append(note);
    const gauges = SHOWN.map((reading) => {
      const gauge = new RpGauge();
      gauge.init(reading);
      this.append(gauge);
      return gauge;
    });
    /** @type {(number|null)[]} */
    let values = SHOWN.map(() => null);
    drawOn([pageState], () => {
      const state = pageState.get();
      if (state === null) return;
      values = SHOWN.map((reading) => reading.read(state));
      values.forEach((value, index) => gauges[index]?.show(value));
      gauges.forEach((gauge) => {
        gauge.hidden = OF_DEVICES.has(gauge.dataset.gauge ?? "") && state.bridge?.kind === "sim";
      });
    });
    drawOn([now, link], () => {
      const words = staleWords("bridge", "controller");
      setText(note, words);
      this.classList.toggle("stale", words !== "");
      const live = isLive("bridge") && isLive("controller");
      gauges.forEach((gauge, index) => gauge.addSample(live ? (values[index] ?? null) : null));
    });
    gauges.forEach((gauge) => gauge.show(null));
    this.append(wayOfBase());
  }
}

/** Where the base is, and what it has driven and turned since the press; counted also while another screen is open. */
function wayOfBase() {
  const odometer = new Odometer();
  const list = element("dl");
  const figures = ["x", "y", "heading", "distance", "turns"].map((name) => {
    const figure = element("dd", { class: "number" });
    const title = text(`way.${name}.hint`);
    list.append(element("div", { data: { way: name }, attributes: { title } }, element("dt", { text: text(`way.${name}`) }), figure));
    return figure;
  });
  const draw = () => {
    const base = pageState.get()?.base ?? null;
    const { distance, turned } = odometer;
    const words = base && [
      `${decimal(base.x, 3)} m`,
      `${decimal(base.y, 3)} m`,
      `${degrees(base.phi)}°`,
      `${decimal(distance, 3)} m`,
      decimal(turned / (2 * Math.PI), 3),
    ];
    figures.forEach((figure, index) => setText(figure, words?.[index] ?? "–"));
  };
  const count = () => {
    odometer.reset();
    draw();
  };
  // Every state counts, not only those that are drawn.
  pageState.subscribe((state) => {
    if (state?.base && state.joints) odometer.update(state.base, state.joints.header.stamp);
  });
  drawOn([pageState], draw);
  const from = element("button", { id: "way-from-here", text: text("way.from_here"), attributes: { title: text("way.from_here.hint") }, onclick: count });
  return element("section", { class: "way", attributes: { "aria-label": text("way.label") } }, list, from);
}

customElements.define("rp-telemetry", RpTelemetry);
