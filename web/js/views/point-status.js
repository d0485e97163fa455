// The sign of each status of a point or a place: a shape and a colour.

import { setAttribute, svg } from "./dom.js";

/** @typedef {import("../state/point-status.js").Status} Status */

/** A body, which is filled with the colour, and a sign on it. @type {Readonly<Record<Status, readonly [string, string]>>} */
const PATHS = Object.freeze({
  proposed: ["M12 3a9 9 0 1 0 0 18a9 9 0 1 0 0-18zM12 8a4 4 0 1 1 0 8a4 4 0 1 1 0-8z", ""],
  accepted: ["M12 3a9 9 0 1 0 0 18a9 9 0 1 0 0-18z", "M7.8 12.4l2.9 2.9L16.3 9"],
  unreachable: ["M4 4h16v16H4z", "M8 12h8"],
  done: ["M9.6 19.4L2.6 12.4L5.4 9.6L9.6 13.8L18.6 4.8L21.4 7.6z", ""],
  decide: ["M12 1.5L22.5 12L12 22.5L1.5 12z", "M9.6 9.6a2.5 2.5 0 1 1 3.4 2.3c-.7.3-1 .8-1 1.7M12 16.4v.2"],
  left: ["M5.5 4L12 10.5L18.5 4L20 5.5L13.5 12L20 18.5L18.5 20L12 13.5L5.5 20L4 18.5L10.5 12L4 5.5z", ""],
});

/**
 * Show a status in an element, if it is another one.
 *
 * @param {HTMLElement} holder
 * @param {Status} status
 */
export function setStatus(holder, status) {
  setAttribute(holder, "data-status", status);
  if (holder.dataset.drawn === status) return;
  holder.dataset.drawn = status;
  const [body, sign] = PATHS[status];
  const shape = svg("svg", { viewBox: "0 0 24 24", class: "status", "aria-hidden": "true" }, svg("path", { d: body, class: "body" }));
  if (sign) shape.append(svg("path", { d: sign, class: "sign" }));
  holder.replaceChildren(shape);
}
