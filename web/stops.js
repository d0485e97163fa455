// Which stops bridge and controller hold latched, and since when each of them does.

import { clockWords } from "./words.js";

/** @typedef {import("./messages.js").PageState} PageState */
/** @typedef {import("./messages.js").StopRecord} StopRecord */

/**
 * What a process holds latched, the newest first.
 *
 * @param {PageState|null} state
 * @param {"bridge"|"controller"} process
 * @returns {readonly StopRecord[]}
 */
export function latchedBy(state, process) {
  return state?.stops.find((told) => told.process === process)?.stops ?? [];
}

/**
 * When a process latched a stop, in words to be read after "latched"; empty where it does not say.
 *
 * @param {PageState|null} state
 * @param {"bridge"|"controller"} process
 * @param {string} stopId
 */
export function sinceWords(state, process, stopId) {
  const records = latchedBy(state, process);
  const record = records.find((each) => each.stop_id === stopId) ?? records[0];
  return record ? ` at ${clockWords(record.wall_time)}` : "";
}

/**
 * Who else pressed before the newest stop, each with the time; what is long is cut.
 *
 * @param {PageState|null} state
 */
export function earlierWords(state) {
  const earlier = latchedBy(state, "bridge").slice(1);
  if (earlier.length === 0) return "";
  const told = earlier.slice(0, 3).map((stop) => `${stop.user || stop.source}, ${clockWords(stop.wall_time)}`);
  const more = earlier.length > told.length ? ` and ${earlier.length - told.length} more` : "";
  return `Before that: ${told.join("; ")}${more}`;
}

/**
 * Is the robot's own emergency stop button pressed?
 *
 * @param {PageState|null} state
 */
export function buttonPressed(state) {
  return state?.stops.some((told) => told.hardware) ?? false;
}
