// Text for ages, units and numbers.

import { LANGUAGE, labelOf, text } from "./texts.js";

/**
 * The nearest obstacle; empty if nothing is near.
 *
 * @param {import("../link/messages.js").ControllerState|null} controller
 */
export function nearWords(controller) {
  const near = controller?.proximity ?? null;
  return near === null ? "" : text("near", { distance: (near.distance * 1000).toFixed(0), what: labelOf(near.what) });
}

/** @param {number} seconds */
export function ageWords(seconds) {
  if (seconds < 99.5) return `${seconds.toFixed(1)} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min`;
  return `${Math.floor(seconds / 3600)} h`;
}

/** @param {number} seconds */
export function durationWords(seconds) {
  if (seconds < 120) return `${Math.round(seconds)} s`;
  return `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
}

/** @param {number} metres */
export function millimetres(metres) {
  const value = metres * 1000;
  return value.toFixed(Math.abs(value) < 99.95 ? 1 : 0);
}

/** @param {number} radians */
export function degrees(radians) {
  return (radians * (180 / Math.PI)).toFixed(1);
}

const CLOCK = new Intl.DateTimeFormat(LANGUAGE, { timeStyle: "medium", hourCycle: "h23" });
const DATE = new Intl.DateTimeFormat(LANGUAGE, { dateStyle: "medium", timeStyle: "medium", hourCycle: "h23" });

/** @param {number} wallTime Seconds since 1970. */
export function clockWords(wallTime) {
  return CLOCK.format(new Date(wallTime * 1000));
}

/** @param {number} wallTime Seconds since 1970. */
export function dateWords(wallTime) {
  return DATE.format(new Date(wallTime * 1000));
}

/**
 * A force (N) to two digits, since it is an estimate.
 *
 * @param {number} force
 */
export function newtons(force) {
  return `${Number(force.toPrecision(2))} N`;
}

/**
 * Largest standard deviation among a vector's coordinates, from the upper triangle of its covariance.
 *
 * @param {import("../link/messages.js").Covariance} covariance
 */
export function uncertainty([xx, , , yy, , zz]) {
  return Math.sqrt(Math.max(xx, yy, zz, 0));
}
