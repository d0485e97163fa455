// How far the work on the row is, vine by vine.

import { points } from "../state/page-state.js";

/**
 * Cuts of one vine: how many there are, are decided about, and are done. What a person left is none.
 *
 * @typedef {{ vine: number, count: number, decided: number, done: number }} VineProgress
 */

/** States in which a person still has to decide. */
const OPEN = new Set(["PROPOSED", "UNKNOWN"]);

/** @returns {VineProgress[]} In the order of the row. */
export function vines() {
  /** @type {Map<number, VineProgress>} */
  const found = new Map();
  for (const { point, entry } of points.get()?.points ?? []) {
    if (entry.state === "REJECTED") continue;
    const vine = found.get(point.vine) ?? { vine: point.vine, count: 0, decided: 0, done: 0 };
    vine.count += 1;
    vine.decided += Number(!OPEN.has(entry.state));
    vine.done += Number(entry.state === "DONE");
    found.set(point.vine, vine);
  }
  return [...found.values()].sort((a, b) => a.vine - b.vine);
}
