// The software stop: the request, repeated until the server has it, and the stops that are latched.

import { post } from "../link/api.js";
import { clockWords } from "../state/format.js";
import { pageState, say } from "../state/page-state.js";
import { reasonText } from "../state/reasons.js";
import { signal } from "../state/signals.js";
import { labelOf, text } from "../state/texts.js";

/** @typedef {import("../link/messages.js").PageState} PageState */
/** @typedef {import("../link/messages.js").StopRecord} StopRecord */
/** @typedef {"idle"|"sending"|"sent"|"failed"} StopProgress */

/** @type {import("../state/signals.js").Signal<StopProgress>} */
export const stopProgress = signal(/** @type {StopProgress} */ ("idle"));

/** Does this server have several robots? Then each has its own path. */
export const multiRobot = location.pathname.startsWith("/robots/");
const TRIES = 4;
/** Status of a stop that was sent and that the bridge has not confirmed. */
const UNCONFIRMED = 503;

/** @param {string} reason */
export async function stopRobot(reason) {
  stopProgress.set("sending");
  let refusal = /** @type {import("../state/reasons.js").Reason|null} */ (null);
  let unconfirmed = 0;
  const press = pressId();
  for (let attempt = 0; attempt < TRIES; attempt++) {
    // At the root path: stops every robot of this server.
    const answer = await post("/api/stop", { reason, press }, 1000);
    if (answer.ok) {
      // The robot may have told of the stop before this answer came.
      if (stopProgress.get() === "sending") stopProgress.set("sent");
      return;
    }
    refusal = answer.why;
    if (answer.status === UNCONFIRMED) unconfirmed += 1;
    if (answer.status === 401 || unconfirmed > 1) break;
  }
  stopProgress.set("failed");
  say("error", text(unconfirmed > 0 ? "stop.not_confirmed" : "stop.not_through", { why: reasonText(refusal) }));
}

/** Tells the server what is one press: repeated after the reset, it does not stop again. */
function pressId() {
  return Array.from(crypto.getRandomValues(new Uint8Array(8)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/**
 * The space bar stops the robot, whatever has the focus in this window.
 *
 * @param {Window} target
 */
export function listenForSpace(target) {
  const swallow = (/** @type {KeyboardEvent} */ event) => {
    // A recording has nothing to stop.
    if (event.code !== "Space" || isTyping(event.target) || pageState.get()?.replay) return false;
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
  // A focused button would be clicked on keyup.
  target.addEventListener("keyup", swallow, { capture: true });
}

const TEXT_INPUTS = new Set(["text", "search", "email", "url", "password", "tel"]);

/**
 * Is this a text field? `instanceof` does not work across frames.
 *
 * @param {EventTarget|null} target
 */
export function isTyping(target) {
  const node = /** @type {Partial<HTMLInputElement>|null} */ (target);
  const name = node?.localName;
  if (name === "textarea" || node?.isContentEditable === true) return true;
  return name === "input" && TEXT_INPUTS.has(node?.type ?? "text") && !node?.readOnly && !node?.disabled;
}

/**
 * Stops that a process has latched, newest first.
 *
 * @param {PageState|null} state
 * @param {"bridge"|"controller"} process
 * @returns {readonly StopRecord[]}
 */
function latchedBy(state, process) {
  return state?.stops.find((told) => told.process === process)?.stops ?? [];
}

/**
 * Time at which a process latched a stop, as words after "latched"; empty if unknown.
 *
 * @param {PageState|null} state
 * @param {"bridge"|"controller"} process
 * @param {string} stopId
 */
export function sinceWords(state, process, stopId) {
  const records = latchedBy(state, process);
  const record = records.find((each) => each.stop_id === stopId) ?? records[0];
  return record ? ` ${text("stop.since", { time: clockWords(record.wall_time) })}` : "";
}

/**
 * Earlier stops with their times, three at most.
 *
 * @param {PageState|null} state
 */
export function earlierWords(state) {
  const earlier = latchedBy(state, "bridge").slice(1);
  if (earlier.length === 0) return "";
  const told = earlier.slice(0, 3).map((stop) => `${stop.user || labelOf(stop.source)}, ${clockWords(stop.wall_time)}`);
  const more = earlier.length - told.length;
  const stops = told.join("; ");
  return more > 0 ? text("stop.earlier_more", { stops, more }) : text("stop.earlier", { stops });
}

/**
 * Is the emergency stop on the robot pressed?
 *
 * @param {PageState|null} state
 */
export function hardwareStopPressed(state) {
  return state?.stops.some((told) => told.hardware) ?? false;
}
