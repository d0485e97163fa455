// How far the work on the row is: vine by vine, and the time that is left.

import { pageState, points } from "../state/page-state.js";

/** @typedef {import("../link/messages.js").PagePoint} PagePoint */
/**
 * Cuts of one vine: how many there are, are decided about, and are done. What a person left is none of them.
 *
 * @typedef {{ vine: number, count: number, decided: number, done: number }} VineProgress
 */

/** States in which a person still has to decide. */
const OPEN = new Set(["PROPOSED", "UNKNOWN"]);
/** States of what is still to be cut. */
const AHEAD = new Set(["ACCEPTED", "CUTTING"]);

/** The cuts in the order of the row, without those that a person left. */
export function cuts() {
  const all = (points.get()?.points ?? []).filter((row) => row.entry.state !== "REJECTED");
  return all.sort((a, b) => a.point.vine - b.point.vine || a.point.spur - b.point.spur);
}

/**
 * The cut that the robot is at, or the chosen one, or the next one.
 *
 * @param {string} active
 * @param {string} chosen
 */
export function cutToShow(active, chosen) {
  const all = points.get()?.points ?? [];
  const named = (/** @type {string} */ name) => all.find(({ point }) => point.point_id === name);
  // The points come in the order of work.
  return named(active) ?? named(chosen) ?? all.find(({ entry }) => AHEAD.has(entry.state)) ?? cuts()[0];
}

/** @returns {VineProgress[]} In the order of the row. */
export function vines() {
  /** @type {Map<number, VineProgress>} */
  const found = new Map();
  for (const { point, entry } of cuts()) {
    const vine = found.get(point.vine) ?? { vine: point.vine, count: 0, decided: 0, done: 0 };
    vine.count += 1;
    vine.decided += Number(!OPEN.has(entry.state));
    vine.done += Number(entry.state === "DONE");
    found.set(point.vine, vine);
  }
  return [...found.values()].sort((a, b) => a.vine - b.vine);
}

// --- the time that is left ---

/** The pace is that of so many cuts. */
const RECENT = 6;
/** Planned times of cuts that are not made yet, by point (s); NaN where it is not known. @type {Map<string, number>} */
const planned = new Map();
/** Planned and true times of the newest cuts (s). @type {(readonly [number, number])[]} */
let made = [];
/** When the robot began with the cut under way, by the controller's clock (s); NaN where it is at none. */
let begun = NaN;

/** Learn from each cut that is made while the page is open. A pause is no part of any. */
function learnPace() {
  const controller = pageState.get()?.controller;
  const stamp = controller?.header.stamp ?? NaN;
  if (controller?.mode !== "AUTO") begun = NaN;
  else if (!(begun <= stamp)) begun = stamp;
  for (const { point, entry, plan } of points.get()?.points ?? []) {
    const name = point.point_id;
    if (entry.state === "ACCEPTED") {
      planned.set(name, plan?.rollout ? plan.rollout.ends_s - plan.rollout.begins_s : (planned.get(name) ?? NaN));
      continue;
    }
    const time = planned.get(name);
    planned.delete(name);
    // The order to cut ends it. Whether it was cut is seen on the way to the next one.
    if (time === undefined || !(entry.state === "CUTTING" || entry.state === "DONE") || Number.isNaN(begun)) continue;
    if (!Number.isNaN(time)) made = [...made, /** @type {const} */ ([time, stamp - begun])].slice(-RECENT);
    begun = stamp;
  }
}
points.subscribe(learnPace);
pageState.subscribe(learnPace);

/** True against planned time of the newest cuts; 1 before the first. */
function pace() {
  const sum = (/** @type {0|1} */ which) => made.reduce((total, each) => total + each[which], 0);
  return sum(0) > 0 ? sum(1) / sum(0) : 1;
}

/**
 * Time for what is still to be cut (s), at the pace of the newest cuts; null where it is not known, and 0 where nothing is.
 * Of the cut under way, what is left of it.
 */
export function timeLeft() {
  const ahead = cuts().filter(({ entry }) => entry.state === "ACCEPTED");
  const times = ahead.map(({ point }) => planned.get(point.point_id) ?? NaN).filter((time) => !Number.isNaN(time));
  const known = pace() * times.reduce((sum, each) => sum + each, 0);
  if (ahead.length === 0) return 0;
  if (times.length === 0) return null;
  // A cut that is not rolled out yet counts as the mean of the others.
  const mean = known / times.length;
  const since = Number.isNaN(begun) ? 0 : (pageState.get()?.controller?.header.stamp ?? begun) - begun;
  return known + mean * (ahead.length - times.length) - Math.min(since, mean);
}
