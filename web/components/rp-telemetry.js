// How well the robot does: tracking, distance to its limits, and whether the computer keeps up.

import { element, panelHead, setText } from "../element.js";
import { isLive, link, now, pageState, staleWords } from "../state.js";
import { drawOn } from "../store.js";
import { counted, degrees, millimetres } from "../words.js";
import { BaseSpeed } from "../base-speed.js";
import { RpGauge } from "./rp-gauge.js";

/** @typedef {import("../messages.js").PageState} PageState */
/** @typedef {import("./rp-gauge.js").GaugeKind & { read: (state: PageState) => number|null }} Reading */

/** What an operator need not read, behind a disclosure. */
const ENGINEERING = new Set(["manipulability", "tick", "late-ticks"]);
const DEGREE = 180 / Math.PI;
const speed = new BaseSpeed();

/** @type {readonly Reading[]} */
const READINGS = Object.freeze([
  {
    id: "position-error",
    label: "Tool error",
    unit: "mm",
    about: "Distance of the tool from where its trajectory has it now",
    full: 20,
    warnAbove: 10,
    write: (/** @type {number} */ value) => millimetres(value / 1000),
    read: (/** @type {PageState} */ state) => scaled(state.controller?.position_error, 1000),
  },
  {
    id: "rotation-error",
    label: "Tool angle",
    unit: "°",
    about: "Angle of the tool from where its trajectory has it now",
    full: 10,
    warnAbove: 5,
    write: (/** @type {number} */ value) => degrees(value / DEGREE),
    read: (/** @type {PageState} */ state) => scaled(state.controller?.rotation_error, DEGREE),
  },
  {
    id: "manipulability",
    label: "Manipulability",
    unit: "ω",
    about: "How freely the arm can move the tool; 0 is a singular posture",
    full: 0.15,
    warnBelow: 0.02,
    write: (/** @type {number} */ value) => value.toFixed(3),
    read: (/** @type {PageState} */ state) => state.controller?.manipulability ?? null,
  },
  {
    id: "joint-margin",
    label: "Joint margin",
    unit: "°",
    about: "Least distance of an arm joint to its limit",
    full: 60,
    warnBelow: 5,
    write: (/** @type {number} */ value) => value.toFixed(1),
    read: (/** @type {PageState} */ state) => scaled(state.controller?.joint_margin, DEGREE),
  },
  {
    id: "base-speed",
    label: "Base speed",
    unit: "m/s",
    about: "Speed of the base over the ground, from its wheels",
    full: 0.5,
    write: (/** @type {number} */ value) => value.toFixed(2),
    read: (/** @type {PageState} */ state) => speed.take(state.base, state.joints),
  },
  {
    id: "battery",
    label: "Battery",
    unit: "%",
    about: "Charge of the base's battery",
    full: 100,
    warnBelow: 20,
    write: (/** @type {number} */ value) => value.toFixed(0),
    read: (/** @type {PageState} */ state) => scaled(state.bridge?.battery ?? undefined, 100),
  },
  {
    id: "real-time-factor",
    label: "Real time",
    unit: "×",
    about: "Simulated seconds a second; below 0.9 the computer is too slow and everything happens later",
    full: 1.2,
    warnBelow: 0.9,
    write: (/** @type {number} */ value) => value.toFixed(2),
    read: (/** @type {PageState} */ state) => state.bridge?.real_time_factor ?? null,
  },
  {
    id: "tick",
    label: "Control step",
    unit: "µs",
    about: "Median time of one control step over the last second",
    full: 1000,
    warnAbove: 1000,
    write: (/** @type {number} */ value) => value.toFixed(0),
    read: (/** @type {PageState} */ state) => scaled(state.controller?.tick_s, 1e6),
  },
  {
    id: "late-ticks",
    label: "Late steps",
    unit: "",
    about: "Control periods that came too late since the controller started",
    full: 100,
    write: (/** @type {number} */ value) => value.toFixed(0),
    read: (/** @type {PageState} */ state) => state.controller?.late_ticks ?? null,
  },
]);

class RpTelemetry extends HTMLElement {
  connectedCallback() {
    const { head, note } = panelHead("Telemetry");
    const title = element("summary");
    const engineers = element("details", { class: "engineers" }, title);
    this.append(head);
    const gauges = READINGS.map((reading) => {
      const gauge = new RpGauge();
      gauge.begin(reading);
      (ENGINEERING.has(reading.id) ? engineers : this).append(gauge);
      return gauge;
    });
    this.append(engineers);
    /** @type {(number|null)[]} */
    let values = READINGS.map(() => null);
    drawOn([pageState], () => {
      const state = pageState.get();
      if (state === null) return;
      values = READINGS.map((reading) => reading.read(state));
      values.forEach((value, index) => gauges[index]?.show(value));
      // A simulated base has none.
      const battery = gauges[READINGS.findIndex((reading) => reading.id === "battery")];
      if (battery) battery.hidden = state.bridge?.kind === "sim";
      const warnings = gauges.filter((gauge) => gauge.parentElement === engineers && gauge.dataset.warning).length;
      setText(title, `For engineers${warnings > 0 ? ` · ${counted(warnings, "warning")}` : ""}`);
    });
    drawOn([now, link], () => {
      const words = staleWords("bridge", "controller");
      setText(note, words);
      this.classList.toggle("stale", words !== "");
      const live = isLive("bridge") && isLive("controller");
      gauges.forEach((gauge, index) => gauge.remember(live ? (values[index] ?? null) : null));
    });
    gauges.forEach((gauge) => gauge.show(null));
    setText(title, "For engineers");
  }
}

/**
 * @param {number|undefined} value
 * @param {number} factor
 */
function scaled(value, factor) {
  return value === undefined ? null : value * factor;
}
customElements.define("rp-telemetry", RpTelemetry);
