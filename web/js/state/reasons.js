// Reasons as text for people.

import { decimal, significant } from "./format.js";
import { pointNames } from "./point-names.js";
import { REASONS, isOne, labelOf, text } from "./texts.js";

/** @typedef {{code: string, values: readonly (readonly [string, string|number|Reason])[]}} Reason */

/** Values that are ids of points. */
const OF_POINTS = Object.freeze(["point", "points", "before", "other"]);

/**
 * A reason of the page's own.
 *
 * @param {string} code
 * @param {Readonly<Record<string, string|number|Reason>>} [values]
 * @returns {Reason}
 */
export function reason(code, values = {}) {
  return { code, values: Object.entries(values) };
}

/**
 * The same for reasons that differ in numbers alone, such as an age that grows.
 *
 * @param {Reason|null} why
 * @returns {string}
 */
export function keyOf(why) {
  return JSON.stringify(why, (_, value) => (typeof value === "number" ? 0 : value));
}

/**
 * Severity of a reason; a warning where this page does not know its code.
 *
 * @param {Reason} reason
 */
export function severityOf({ code }) {
  return REASONS[code]?.[0] ?? "warning";
}

/**
 * Text of a reason, and what to do. A code that this page does not know is shown with its values.
 *
 * @param {Reason} reason
 * @returns {{ text: string, act: string }}
 */
export function partsOf({ code, values = [] }) {
  const entry = REASONS[code];
  if (!entry) return { text: [code, ...values.map(([name, value]) => `${name} ${shown(value, "")}`)].join(", "), act: "" };
  const [, template, act] = entry;
  const known = new Map(values);
  const told = template.replace(/\{(\w+)(?::([^}]*))?\}/g, (_, name, format, at) => {
    const value = known.get(name);
    const place = typeof value === "string" && OF_POINTS.includes(name) ? pointNames(value) : value;
    if (place === value) return shown(value, format ?? "");
    return at === 0 ? capital(String(place)) : String(place);
  });
  return { text: told, act };
}

/**
 * Text of a reason, with what to do; empty without one.
 *
 * @param {Reason|null|undefined} reason
 * @returns {string}
 */
export function reasonText(reason) {
  if (!reason) return "";
  const told = partsOf(reason);
  return told.act ? text("advice", { text: told.text, act: told.act }) : told.text;
}

/** @param {string} words */
export function sentence(words) {
  return `${capital(words)}.`;
}

/** @param {string} words */
export function capital(words) {
  return `${words.charAt(0).toUpperCase()}${words.slice(1)}`;
}

/**
 * The words of a person; empty where a reason has none.
 *
 * @param {Reason|null} reason
 */
export function saidText(reason) {
  return reason?.code === "said" ? reasonText(reason) : "";
}

/**
 * @param {string|number|Reason|undefined} value
 * @param {string} format As in Python: `.1f`, `g` or empty; or words for one and for several, as `cane|canes`.
 * @returns {string}
 */
function shown(value, format) {
  if (value === undefined) return "?";
  if (typeof value === "string") return labelOf(value);
  if (typeof value === "object") return reasonText(value);
  const words = format.split("|");
  if (words.length > 1) return words[isOne(value) ? 0 : 1] ?? "";
  const digits = /^\.(\d)f$/.exec(format);
  return digits ? decimal(value, Number(digits[1])) : significant(value, format === "g" ? 6 : 12);
}
