// Icons on a 16 × 16 grid, one for each state, so that nothing is shown by colour alone.

import { svg } from "./dom.js";

const RING = "M8 1.8a6.2 6.2 0 1 0 0 12.4a6.2 6.2 0 1 0 0-12.4z";

/** @type {Record<string, string>} */
const PATHS = {
  // point states
  PROPOSED: RING,
  ACCEPTED: `${RING}M5 8.2l2.2 2.2L11 6`,
  UNREACHABLE: `${RING}M4.4 8h7.2`,
  CUTTING: "M4 13L11.5 3M12 13L4.5 3M4 13.2a1.4 1.4 0 1 0 .1 0M12 13.2a1.4 1.4 0 1 0 .1 0",
  DONE: "M2.5 8.5l3.8 3.8L13.5 4.5",
  FAILED_NOT_CUT: "M8 2L14.5 13.5h-13zM8 6.5v3.4M8 11.6v.3",
  UNKNOWN: "M5.4 5.6a2.7 2.7 0 1 1 3.6 2.6c-.7.3-1 .8-1 1.6v.4M8 12.6v.3",
  REJECTED: "M3.5 3.5l9 9M12.5 3.5l-9 9",
  // modes
  IDLE: "M3 8h10",
  READY: RING,
  TELEOP: "M8 1.5v13M1.5 8h13M6 3.5l2-2 2 2M6 12.5l2 2 2-2M3.5 6l-2 2 2 2M12.5 6l2 2-2 2",
  AUTO: "M4.5 2.5l8 5.5-8 5.5z",
  PAUSED: "M5.5 3v10M10.5 3v10",
  PROTECTIVE_STOP: "M8 1.8l5.5 2v4.4c0 3-2.3 5-5.5 6.2c-3.2-1.2-5.5-3.2-5.5-6.2V3.8z",
  FAULT: "M8 2L14.5 13.5h-13zM8 6.5v3.4M8 11.6v.3",
  ESTOP_LATCHED: "M5.2 1.5h5.6l3.7 3.7v5.6l-3.7 3.7H5.2l-3.7-3.7V5.2z",
  // presence and severity
  present: "M2.5 8.5l3.8 3.8L13.5 4.5",
  gone: "M3.5 3.5l9 9M12.5 3.5l-9 9",
  info: `${RING}M8 7.4v3.6M8 4.8v.3`,
  warning: "M8 2L14.5 13.5h-13zM8 6.5v3.4M8 11.6v.3",
  error: "M5.2 1.5h5.6l3.7 3.7v5.6l-3.7 3.7H5.2l-3.7-3.7V5.2zM5.6 5.6l4.8 4.8M10.4 5.6l-4.8 4.8",
  // screens
  work: "M4 13L11.5 3M12 13L4.5 3M4 13.2a1.4 1.4 0 1 0 .1 0M12 13.2a1.4 1.4 0 1 0 .1 0",
  review: "M2.5 4.5l1.3 1.3L6 3.4M2.5 11l1.3 1.3L6 9.9M8.5 4.7h5M8.5 11.2h5",
  drive: "M8 1.5v13M1.5 8h13M6 3.5l2-2 2 2M6 12.5l2 2 2-2M3.5 6l-2 2 2 2M12.5 6l2 2-2 2",
  report: "M3.5 1.8h6l3 3v9.4h-9zM5.8 7h4.4M5.8 9.5h4.4M5.8 12h2.6",
  engineer: "M2 13.5V2.5M2 13.5h12M4.5 10.5l3-4 2.5 2 3.5-5",
  person: "M8 2.2a2.6 2.6 0 1 0 .1 0M3 13.8c.4-3 2.4-4.4 5-4.4s4.6 1.4 5 4.4",
  swap: "M2.5 6V2.5H6M13.5 10v3.5H10M2.5 2.5l4.3 4.3M13.5 13.5L9.2 9.2",
  add: "M8 2.5v11M2.5 8h11",
  previous: "M10.5 3L5.5 8l5 5",
  next: "M5.5 3l5 5-5 5",
  again: "M13 5.5A5.6 5.6 0 1 0 13.6 9M13.4 2.2v3.6H9.8",
  link: "M2.5 12.5v-2M6.2 12.5v-4.4M9.9 12.5V5.6M13.5 12.5v-9.8",
};

/**
 * @param {string} name
 * @returns {SVGSVGElement}
 */
export function icon(name) {
  const path = PATHS[name] ?? RING;
  return svg("svg", { viewBox: "0 0 16 16", class: "icon", "aria-hidden": "true" }, svg("path", { d: path }));
}

/**
 * Replace the icon in `holder` if the name differs.
 *
 * @param {HTMLElement} holder
 * @param {string} name
 */
export function setIcon(holder, name) {
  if (holder.dataset.icon === name) return;
  holder.dataset.icon = name;
  holder.replaceChildren(icon(name));
}
