// Readings of telemetry and charts: source, unit, format, warning limits.

import { decimal, degrees, millimetres } from "../state/format.js";
import { roundTrip } from "../state/page-state.js";

/** @typedef {import("../link/messages.js").PageState} PageState */

/** Window of the speed estimate (s): shorter is noisy, longer is late. */
const SPAN_S = 0.4;

class BaseSpeed {
  constructor() {
    /** @type {{ stamp: number, x: number, y: number }[]} */
    this.track = [];
  }

  /**
   * @param {import("../link/messages.js").PlanarPose|null} base
   * @param {import("../link/messages.js").JointState|null} joints Its stamp is the bridge's clock.
   * @returns {number|null} m/s; null before there are two poses.
   */
  update(base, joints) {
    if (base === null || joints === null) return null;
    const stamp = joints.header.stamp;
    const newest = this.track.at(-1);
    // The clock of a restarted bridge begins again.
    if (newest && stamp < newest.stamp) this.track = [];
    if (!newest || stamp > newest.stamp) this.track.push({ stamp, x: base.x, y: base.y });
    while (this.track.length > 2 && stamp - (this.track[1]?.stamp ?? stamp) >= SPAN_S) this.track.shift();
    const first = this.track[0];
    if (!first || stamp <= first.stamp) return null;
    return Math.hypot(base.x - first.x, base.y - first.y) / (stamp - first.stamp);
  }
}

/**
 * @typedef {object} Reading
 * @property {string} id Of its texts too: `reading.ID` and `reading.ID.hint`.
 * @property {string} unit
 * @property {number} fullScale Upper end of the bar, in the unit shown.
 * @property {number} [warnAbove]
 * @property {number} [warnBelow]
 * @property {(value: number) => string} format
 * @property {(state: PageState) => number|null} read In the unit shown; null when unknown.
 * @property {"gauge"|"engineer"|"chart"} [place] Where it is shown besides its chart; a gauge by default.
 */

const DEGREE = 180 / Math.PI;
const speed = new BaseSpeed();

/** @type {readonly Reading[]} */
export const READINGS = Object.freeze([
  {
    id: "position-error",
    unit: "mm",
    fullScale: 20,
    warnAbove: 10,
    format: (/** @type {number} */ value) => millimetres(value / 1000),
    read: (/** @type {PageState} */ state) => scaled(state.controller?.position_error, 1000),
  },
  {
    id: "rotation-error",
    unit: "°",
    fullScale: 10,
    warnAbove: 5,
    format: (/** @type {number} */ value) => degrees(value / DEGREE),
    read: (/** @type {PageState} */ state) => scaled(state.controller?.rotation_error, DEGREE),
  },
  {
    id: "manipulability",
    place: "engineer",
    unit: "ω",
    fullScale: 0.15,
    warnBelow: 0.02,
    format: (/** @type {number} */ value) => decimal(value, 3),
    read: (/** @type {PageState} */ state) => state.controller?.manipulability ?? null,
  },
  {
    id: "joint-margin",
    unit: "°",
    fullScale: 60,
    warnBelow: 5,
    format: (/** @type {number} */ value) => decimal(value, 1),
    read: (/** @type {PageState} */ state) => scaled(state.controller?.joint_margin, DEGREE),
  },
  {
    id: "tool-force",
    place: "engineer",
    unit: "N",
    fullScale: 30,
    // As `light_force` of the controller's configuration.
    warnAbove: 8,
    format: (/** @type {number} */ value) => decimal(value, 0),
    read: (/** @type {PageState} */ state) => state.controller?.tool_force ?? null,
  },
  {
    id: "base-speed",
    unit: "m/s",
    fullScale: 0.5,
    format: (/** @type {number} */ value) => decimal(value, 2),
    read: (/** @type {PageState} */ state) => speed.update(state.base, state.joints),
  },
  {
    id: "battery",
    unit: "%",
    fullScale: 100,
    warnBelow: 20,
    format: (/** @type {number} */ value) => value.toFixed(0),
    read: (/** @type {PageState} */ state) => scaled(state.bridge?.battery ?? undefined, 100),
  },
  {
    id: "arm-success",
    unit: "%",
    fullScale: 100,
    warnBelow: 95,
    format: (/** @type {number} */ value) => value.toFixed(0),
    read: (/** @type {PageState} */ state) => scaled(state.bridge?.arm_success ?? undefined, 100),
  },
  {
    id: "real-time-factor",
    unit: "×",
    fullScale: 1.2,
    warnBelow: 0.9,
    format: (/** @type {number} */ value) => decimal(value, 2),
    read: (/** @type {PageState} */ state) => state.bridge?.real_time_factor ?? null,
  },
  {
    id: "tick",
    place: "engineer",
    unit: "µs",
    fullScale: 1000,
    warnAbove: 1000,
    format: (/** @type {number} */ value) => value.toFixed(0),
    read: (/** @type {PageState} */ state) => scaled(state.controller?.tick_s, 1e6),
  },
  {
    id: "late-ticks",
    place: "engineer",
    unit: "",
    fullScale: 100,
    format: (/** @type {number} */ value) => value.toFixed(0),
    read: (/** @type {PageState} */ state) => state.controller?.late_ticks ?? null,
  },
  {
    id: "wheel-speed",
    place: "chart",
    unit: "%",
    fullScale: 100,
    warnAbove: 95,
    format: (/** @type {number} */ value) => value.toFixed(0),
    read: (/** @type {PageState} */ state) => largest(state.speed_ratios.slice(0, 2), 100),
  },
  {
    id: "arm-speed",
    place: "chart",
    unit: "%",
    fullScale: 100,
    warnAbove: 95,
    format: (/** @type {number} */ value) => value.toFixed(0),
    read: (/** @type {PageState} */ state) => largest(state.speed_ratios.slice(2), 100),
  },
  {
    id: "command-round-trip",
    place: "chart",
    unit: "ms",
    fullScale: 50,
    warnAbove: 50,
    format: (/** @type {number} */ value) => decimal(value, 1),
    read: (/** @type {PageState} */ state) => scaled(state.bridge?.round_trip_s, 1000),
  },
  {
    id: "page-round-trip",
    place: "chart",
    unit: "ms",
    fullScale: 200,
    warnAbove: 200,
    format: (/** @type {number} */ value) => value.toFixed(0),
    read: () => roundTrip.get(),
  },
]);

/**
 * On which side of its limits a reading is.
 *
 * @param {Reading} reading
 * @param {number|null} value In the unit shown; null when unknown.
 * @returns {"low"|"high"|""}
 */
export function beyondLimit({ warnBelow, warnAbove }, value) {
  if (value === null) return "";
  if (warnBelow !== undefined && value < warnBelow) return "low";
  return warnAbove !== undefined && value > warnAbove ? "high" : "";
}

/**
 * @param {number|undefined} value
 * @param {number} factor
 */
function scaled(value, factor) {
  return value === undefined ? null : value * factor;
}

/**
 * @param {readonly number[]} values
 * @param {number} factor
 */
function largest(values, factor) {
  return values.length === 0 ? null : factor * Math.max(...values);
}
