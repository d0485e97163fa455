// Text for ages, units and numbers.

import { LANGUAGE, labelOf, text } from "./texts.js";

/** Formats by their options, since one costs more to make than to use. @type {Map<string, Intl.NumberFormat>} */
const FORMATS = new Map();

/**
 * @param {number} value
 * @param {Intl.NumberFormatOptions} options
 */
function formatted(value, options) {
  const key = JSON.stringify(options);
  const format = FORMATS.get(key) ?? new Intl.NumberFormat(LANGUAGE, { useGrouping: false, signDisplay: "negative", ...options });
  FORMATS.set(key, format);
  return format.format(value);
}

/**
 * A number in the language of the page.
 *
 * @param {number} value
 * @param {number} digits After the decimal mark.
 */
export function decimal(value, digits) {
  return formatted(value, { minimumFractionDigits: digits, maximumFractionDigits: digits });
}

/**
 * A number in the language of the page.
 *
 * @param {number} value
 * @param {number} digits Significant ones, at most.
 */
export function significant(value, digits) {
  return formatted(value, { maximumSignificantDigits: digits });
}

/**
 * The nearest obstacle; empty if nothing is near.
 *
 * @param {import("../link/messages.js").ControllerState|null} controller
 */
export function nearWords(controller) {
  const near = controller?.proximity ?? null;
  return near === null ? "" : text("near", { distance: decimal(near.distance * 1000, 0), what: labelOf(near.what) });
}

/** @param {number} seconds */
export function ageWords(seconds) {
  if (seconds < 99.5) return `${decimal(seconds, 1)} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min`;
  return `${Math.floor(seconds / 3600)} h`;
}

/** @param {number} seconds */
export function durationWords(seconds) {
  if (seconds < 120) return `${Math.round(seconds)} s`;
  return `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
}

/**
 * A time that may last for hours.
 *
 * @param {number} seconds
 */
export function spanWords(seconds) {
  const whole = Math.max(0, Math.round(seconds));
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor((whole % 3600) / 60)];
  if (hours > 0) return text("span.hours", { hours, minutes });
  return minutes > 0 ? text("span.minutes", { minutes, seconds: whole % 60 }) : text("span.seconds", { seconds: whole });
}

/** @param {number} metres */
export function millimetres(metres) {
  const value = metres * 1000;
  return decimal(value, Math.abs(value) < 99.95 ? 1 : 0);
}

/** @param {number} radians */
export function degrees(radians) {
  return decimal(radians * (180 / Math.PI), 1);
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
  return `${significant(force, 2)} N`;
}

/**
 * Largest standard deviation among a vector's coordinates, from the upper triangle of its covariance.
 *
 * @param {import("../link/messages.js").Covariance} covariance
 */
export function uncertainty([xx, , , yy, , zz]) {
  return Math.sqrt(Math.max(xx, yy, zz, 0));
}
