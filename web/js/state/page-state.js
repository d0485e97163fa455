// Everything the page knows. The last known state is kept with its age while a link or process is gone.

import { ageWords } from "./format.js";
import { signal } from "./signals.js";
import { text } from "./texts.js";

/** @typedef {import("../link/messages.js").PageEvent} PageEvent */
/** @typedef {import("../link/messages.js").PagePoints} PagePoints */
/** @typedef {import("../link/messages.js").PageState} PageState */
/** @typedef {import("../link/messages.js").Process} Process */
/** @typedef {import("../link/messages.js").Severity} Severity */

/**
 * @typedef {object} Link
 * @property {"connecting"|"open"|"closed"|"signed-out"} status
 * @property {number} attempts Attempts since it was last open.
 */

/** @typedef {{ id: number, severity: Severity, text: string }} Toast */

const MAX_LINES = 500;
/** A toast stays for this time per letter, so that it can be read (ms). */
const READING_MS = 60;
/** Age from which the state of a process is stale (s). */
export const STALE_AFTER_S = { bridge: 1, controller: 1, perception: 2, server: 1 };

export const link = signal(/** @type {Link} */ ({ status: "connecting", attempts: 0 }));
export const pageState = signal(/** @type {PageState|null} */ (null));
export const points = signal(/** @type {PagePoints|null} */ (null));
/** The newest state of the preview; null before the first. */
export const preview = signal(/** @type {import("../link/messages.js").PreviewState|null} */ (null));
export const log = signal(/** @type {readonly PageEvent[]} */ ([]));
export const toasts = signal(/** @type {readonly Toast[]} */ ([]));
/** Id of the selected point; empty if none. */
export const selected = signal("");
/** Grows when the selected point is selected again. */
export const revealCount = signal(0);
/** Round trip page → server → page in ms; null before the first. */
export const roundTrip = signal(/** @type {number|null} */ (null));
/** The page's clock (ms), updated four times a second so that ages grow on screen. */
export const now = signal(performance.now());
/** Time of the newest `PageState` (page's clock, ms). */
let stateAt = 0;
/** Clock updates since then, or since the page was opened. */
let turns = 0;
now.subscribe(() => {
  turns += 1;
});
/**
 * After this many updates (1 s) without a state the server is silent. Not milliseconds alone: while the browser loads
 * the 3-D view, this page does not run and messages wait unread.
 */
const SILENT_TURNS = 4;
/** A page that has just been opened waits this many updates (5 s) before silence is an alarm. */
const FIRST_TURNS = 20;
let nextToast = 1;
let nextLocalLine = -1;

/** @param {PageState} message */
export function receiveState(message) {
  stateAt = performance.now();
  turns = 0;
  pageState.set(message);
}

/** Is the page waiting for its first state, too early for an alarm? */
export function isOpening() {
  return pageState.get() === null && link.get().status !== "signed-out" && turns < FIRST_TURNS;
}

/**
 * New lines of the server's log. After a reconnection the server repeats its last lines, and a restarted server counts
 * from the start; older lines that the page has are kept.
 *
 * @param {readonly PageEvent[]} events
 * @param {boolean} first Is this the first batch of a connection?
 */
export function receiveEvents(events, first) {
  const oldest = events[0];
  if (!oldest) return;
  const kept = first ? log.get().filter((line) => line.number < 0 || line.wall_time < oldest.wall_time) : log.get();
  const lines = first ? [...kept, ...events].sort((a, b) => a.wall_time - b.wall_time) : [...kept, ...events];
  log.set(lines.slice(-MAX_LINES));
}

/**
 * Show a toast and add it to the log.
 *
 * @param {Severity} severity
 * @param {string} text
 */
export function say(severity, text) {
  const line = { number: nextLocalLine--, wall_time: Date.now() / 1000, process: "page", severity, text, reason: null };
  log.set([...log.get(), line].slice(-MAX_LINES));
  showToast(severity, text);
}

/**
 * Show a toast, which ends by itself.
 *
 * @param {Severity} severity
 * @param {string} text
 */
export function showToast(severity, text) {
  const toast = { id: nextToast++, severity, text };
  toasts.set([...toasts.get().filter((each) => each.text !== text), toast].slice(-3));
  setTimeout(() => dismissToast(toast.id), Math.max(severity === "error" ? 10_000 : 6000, READING_MS * text.length));
}

/** @param {number} id */
export function dismissToast(id) {
  toasts.set(toasts.get().filter((toast) => toast.id !== id));
}

/** Age of the newest `PageState` (s); null before the first. */
export function stateAge() {
  return pageState.get() === null ? null : Math.max(0, (performance.now() - stateAt) / 1000);
}

/**
 * Age of a process's last message (s): as the server measured it, plus the time since.
 *
 * @param {Process} process
 * @returns {number|null}
 */
export function processAge(process) {
  const passed = stateAge();
  if (process === "server" || passed === null) return passed;
  const age = toldAge(process);
  return age === null ? null : age + passed;
}

/**
 * Age of a process's last message (s) as the server measured it.
 *
 * @param {Process} process
 * @returns {number|null}
 */
function toldAge(process) {
  const state = pageState.get();
  if (state === null) return null;
  let age = state.processes.find((row) => row.process === process)?.age_s ?? null;
  if (process === "bridge" && state.bridge_age_s !== null) age = state.bridge_age_s;
  if (process === "controller" && state.controller_age_s !== null) age = state.controller_age_s;
  return age;
}

/**
 * Does the server report that a process is gone? Silence on this page's own link does not count.
 *
 * @param {Process} process
 */
export function isGone(process) {
  const row = pageState.get()?.processes.find((each) => each.process === process);
  return !row?.present || (toldAge(process) ?? Infinity) >= STALE_AFTER_S[process];
}

/**
 * Is a process known to be running, with a fresh last message?
 *
 * @param {Process} process
 */
export function isLive(process) {
  const state = pageState.get();
  const age = processAge(process);
  if (state === null || link.get().status !== "open") return false;
  if (process === "server") return turns < SILENT_TURNS || (age ?? 0) < STALE_AFTER_S.server;
  return !isGone(process) && age !== null && age < STALE_AFTER_S[process];
}

/**
 * Why the state of these processes is stale, with its age; empty while it is fresh.
 *
 * @param {...Process} processes
 */
export function staleWords(...processes) {
  if (link.get().status !== "open") {
    const age = stateAge();
    return age === null ? "" : text("stale.no_link", { age: ageWords(age) });
  }
  if (pageState.get() === null) return "";
  // A silent server says nothing about the others.
  const silence = stateAge() ?? 0;
  if (!isLive("server")) return text("stale.server", { age: ageWords(silence) });
  for (const process of processes) {
    if (isLive(process)) continue;
    const seconds = processAge(process);
    const name = text(`process.${process}`);
    if (seconds === null) return text("stale.unseen", { process: name });
    return text(isGone(process) ? "stale.gone" : "stale.late", { process: name, age: ageWords(seconds) });
  }
  return "";
}
