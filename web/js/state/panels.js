// Which panels of the screen for engineers are shown, and in which order. The browser remembers it.

import { signal } from "./signals.js";

/** @typedef {"alarms"|"processes"|"telemetry"|"charts"|"log"|"topics"|"models"|"camera"} PanelName */
/** @typedef {{ order: readonly PanelName[], hidden: readonly PanelName[] }} Arrangement */

const KEY = "rp-panels";
/** @type {readonly PanelName[]} */
export const PANELS = Object.freeze(["alarms", "processes", "telemetry", "charts", "log", "topics", "models", "camera"]);
/** @type {Arrangement} */
const USUAL = Object.freeze({ order: PANELS, hidden: Object.freeze([]) });

export const arrangement = signal(remembered());

/**
 * What was remembered. Names that this version does not know are left out, and new panels come last.
 *
 * @returns {Arrangement}
 */
function remembered() {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY) ?? "null");
    const known = (/** @type {unknown} */ names) => PANELS.filter((each) => Array.isArray(names) && names.includes(each));
    const told = [...new Set(Array.isArray(kept?.order) ? kept.order : [])].filter((each) => PANELS.includes(each));
    if (told.length === 0) return USUAL;
    return { order: [...told, ...PANELS.filter((each) => !told.includes(each))], hidden: known(kept.hidden) };
  } catch {
    // Storage may be forbidden, or hold something else.
    return USUAL;
  }
}

/** @param {Arrangement} next */
function arrange(next) {
  arrangement.set(next);
  try {
    localStorage.setItem(KEY, JSON.stringify(next));
  } catch {
    // Remembered until the page is closed.
  }
}

/**
 * Move a panel one place among those that are shown.
 *
 * @param {PanelName} name
 * @param {1|-1} way Later or earlier.
 */
export function movePanel(name, way) {
  const { order, hidden } = arrangement.get();
  const shown = order.filter((each) => !hidden.includes(each));
  const other = shown[shown.indexOf(name) + way];
  if (!other) return;
  const swapped = order.map((each) => (each === name ? other : each === other ? name : each));
  arrange({ order: swapped, hidden });
}

/**
 * Move a panel to the place of another one.
 *
 * @param {PanelName} name
 * @param {PanelName} other
 */
export function placePanel(name, other) {
  const { order, hidden } = arrangement.get();
  const rest = order.filter((each) => each !== name);
  rest.splice(order.indexOf(other), 0, name);
  arrange({ order: rest, hidden });
}

/**
 * @param {PanelName} name
 * @param {boolean} show
 */
export function showPanel(name, show) {
  const { order, hidden } = arrangement.get();
  const others = hidden.filter((each) => each !== name);
  arrange({ order, hidden: show ? others : [...others, name] });
}

export function resetPanels() {
  arrange(USUAL);
}
