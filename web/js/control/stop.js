// The software stop: asking for it until the server has it, and who holds it latched since when.

import { post } from "../link/api.js";
import { clockWords } from "../state/format.js";
import { say } from "../state/page-state.js";
import { signal } from "../state/signals.js";

/** @typedef {"idle"|"sending"|"sent"|"failed"} StopProgress */

/** @type {import("../state/signals.js").Signal<StopProgress>} */
export const stopProgress = signal(/** @type {StopProgress} */ ("idle"));

/** Does this server have several robots? Then each has its page under a path of its own. */
export const multiRobot = location.pathname.startsWith("/robots/");
const TRIES = 4;
/** The server has sent the stop, but the bridge has not confirmed it. */
const UNCONFIRMED = 503;

/** @param {string} reason */
export async function stopRobot(reason) {
  stopProgress.set("sending");
  let refusal = "";
  let unconfirmed = 0;
  for (let attempt = 0; attempt < TRIES; attempt++) {
    // At the root: it stops every robot of this server, whichever this page shows.
    const answer = await post("/api/stop", { reason }, 1000);
    if (answer.ok) {
      stopProgress.set("sent");
      return;
    }
    refusal = answer.reason;
    if (answer.status === UNCONFIRMED) unconfirmed += 1;
    if (answer.status === 401 || unconfirmed > 1) break;
  }
  stopProgress.set("failed");
  const what = unconfirmed > 0 ? "is not confirmed" : "did not get through";
  say("error", `The software stop ${what} (${refusal}). Use the emergency stop on the robot.`);
}

/**
 * Make the space bar of a window stop the robot, even when a button there has the focus.
 *
 * @param {Window} target
 */
export function listenForSpace(target) {
  const swallow = (/** @type {KeyboardEvent} */ event) => {
    if (event.code !== "Space" || isTyping(event.target)) return false;
    event.preventDefault();
    event.stopImmediatePropagation();
    return true;
  };
  target.addEventListener(
    "keydown",
    (event) => {
      if (swallow(event) && !event.repeat) void stopRobot("space bar");
    },
    { capture: true },
  );
  // A button is pressed when the space bar comes up again.
  target.addEventListener("keyup", swallow, { capture: true });
}

const TEXT_INPUTS = new Set(["text", "search", "email", "url", "password", "tel"]);

/**
 * Is this a place where a space is a character? Works across frames, where `instanceof` does not.
 *
 * @param {EventTarget|null} target
 */
export function isTyping(target) {
  const node = /** @type {Partial<HTMLInputElement>|null} */ (target);
  const name = node?.localName;
  if (name === "textarea" || node?.isContentEditable === true) return true;
  return name === "input" && TEXT_INPUTS.has(node?.type ?? "text") && !node?.readOnly && !node?.disabled;
}

/** @typedef {import("../link/messages.js").PageState} PageState */
/** @typedef {import("../link/messages.js").StopRecord} StopRecord */

/**
 * What a process holds latched, the newest first.
 *
 * @param {PageState|null} state
 * @param {"bridge"|"controller"} process
 * @returns {readonly StopRecord[]}
 */
function latchedBy(state, process) {
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
export function hardwareStopPressed(state) {
  return state?.stops.some((told) => told.hardware) ?? false;
}
