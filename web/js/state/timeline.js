// The timeline of the session, or of the recording that is replayed.

import { isGone, pageState } from "./page-state.js";
import { signal } from "./signals.js";

/** @typedef {import("../link/messages.js").Timeline} Timeline */
/** @typedef {import("../link/messages.js").TimelineEvent} TimelineEvent */
/** @typedef {import("../link/messages.js").Mode} Mode */

/** The newest timeline, which ends now where the session goes on; null before the first. */
export const timeline = signal(/** @type {Timeline|null} */ (null));

/** Fetch it. What was there stays if the server does not answer. */
export async function fetchTimeline() {
  try {
    const response = await fetch("api/timeline", { credentials: "same-origin", signal: AbortSignal.timeout(4000) });
    if (!response.ok) return;
    /** @type {Timeline} */
    const told = await response.json();
    timeline.set(told.began_at > 0 ? { ...told, ended_at: sessionEnd(response, told.ended_at) } : told);
  } catch {
    // Asked again soon.
  }
}

/**
 * Until when the session lasts (s since 1970): now while it goes on, else until its last record.
 *
 * @param {Response} response An answer of the server. Its clock counts: that of a tablet may be wrong.
 * @param {number} recorded Time of the last record (s since 1970).
 */
export function sessionEnd(response, recorded) {
  if (pageState.get()?.replay || isGone("controller")) return recorded;
  const now = Date.parse(response.headers.get("date") ?? "") / 1000;
  return now > recorded ? now : recorded;
}

/**
 * Modes with their begin and end (s since 1970). Before the first change the mode is the one that it left.
 *
 * @param {Timeline} told
 * @param {Mode|""} now The present mode, where nothing has changed.
 */
export function modeSpans({ began_at, ended_at, events }, now) {
  const changes = events.filter((event) => event.kind === "mode");
  const spans = [{ mode: changes[0]?.before || now, from: began_at, to: ended_at }];
  for (const { at, mode } of changes) {
    const last = spans[spans.length - 1];
    if (last) last.to = at;
    spans.push({ mode, from: at, to: ended_at });
  }
  return spans.filter((span) => span.mode !== "" && span.to >= span.from);
}

const DAY_S = 86400;
/** Steps of a time axis (s). */
const STEPS = Object.freeze([1, 2, 5, 10, 30, 60, 120, 300, 600, 1800, 3600, 7200, 14400, 43200]);

/**
 * Times of an axis's ticks (s since 1970), at round times of the day.
 *
 * @param {number} from
 * @param {number} to
 * @param {number} most Largest number of ticks.
 */
export function ticks(from, to, most) {
  const step = STEPS.find((each) => (to - from) / each <= most) ?? DAY_S * Math.ceil((to - from) / DAY_S / most);
  const shift = new Date(from * 1000).getTimezoneOffset() * 60;
  const first = Math.ceil((from - shift) / step) * step + shift;
  return Array.from({ length: Math.max(0, Math.floor((to - first) / step) + 1) }, (_, index) => first + index * step);
}

const HALTED = new Set(["PAUSED", "PROTECTIVE_STOP", "FAULT", "ESTOP_LATCHED"]);

/**
 * Is it worth a mark of its own? Other changes of mode are seen in the band.
 *
 * @param {TimelineEvent} event
 */
export function isMark(event) {
  return event.kind !== "mode" || HALTED.has(event.mode);
}
