// What a person calls a point: its vine and spur. Messages have its id.

import { points } from "./page-state.js";
import { text } from "./texts.js";

/** Names of the points that this page has heard of, by id, those that have gone since among them. */
const names = new Map();
points.subscribe((page) => {
  for (const { point } of page?.points ?? []) names.set(point.point_id, text("point.name", { vine: point.vine, spur: point.spur }));
});

/**
 * Names of points; the ids themselves where this page has not heard of one of them.
 *
 * @param {string} ids With commas between them.
 */
export function pointNames(ids) {
  const found = ids.split(", ").map((id) => names.get(id));
  return found.includes(undefined) ? ids : found.join("; ");
}
