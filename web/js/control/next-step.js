// The next step of the work: what the large button at the bottom does now, and what waits for a person.

import { pageState, points, preview } from "../state/page-state.js";
import { screen } from "../state/screens.js";
import { countOf } from "./allowed.js";
import { previewOpen } from "./preview.js";

/** @typedef {import("./commands.js").Step} Step */
/** @typedef {import("../link/messages.js").Interrupted} Interrupted */
/** @typedef {import("../link/messages.js").Need} Need */

/** @returns {Step|""} Empty for a recording, and after a stop for a viewer. */
export function nextStep() {
  const state = pageState.get();
  if (state?.replay) return "";
  switch (state?.controller?.mode) {
    case "READY":
      return whenReady(state.controller.interrupted);
    case "AUTO":
    case "TELEOP":
      return "Pause";
    case "PAUSED":
      return mayContinue(state.controller.interrupted) ? "continue" : "Resume";
    case "PROTECTIVE_STOP":
    case "FAULT":
      return "Acknowledge";
    case "ESTOP_LATCHED":
      return state.role === "viewer" ? "" : "reset";
    default:
      return "Arm";
  }
}

/**
 * @param {Interrupted} interrupted
 * @returns {Step}
 */
function whenReady(interrupted) {
  if (interrupted === "survey") return "continue";
  if (countOf("ACCEPTED") > 0) return withPreview();
  if (countOf("PROPOSED") === 0) return "Survey";
  return screen.get() === "review" ? "Start" : "review";
}

/**
 * Does one press lead from a pause back to what was interrupted? Not where a person has to look at a plant or a preview
 * first.
 *
 * @param {Interrupted} interrupted
 */
export function mayContinue(interrupted) {
  if (interrupted === "survey") return true;
  return interrupted === "work" && countOf("UNKNOWN") === 0 && countOf("ACCEPTED") > 0 && withPreview() === "Start";
}

/** @returns {Step} */
function withPreview() {
  const told = preview.get();
  if (!told?.required || told.phase === "approved") return "Start";
  return told.phase === "ready" && previewOpen.get() ? "approve" : "preview";
}

/** How many spurs without a cut wait for a decision. While the robot works by itself, its next looks may settle some. */
export function waitingPlaces() {
  const isLooking = pageState.get()?.controller?.mode === "AUTO";
  const waits = (/** @type {Need} */ needs) => needs === "operator" || (needs === "another look" && !isLooking);
  const sites = (points.get()?.undecided_sites ?? []).filter(({ vine, needs }) => vine > 0 && waits(needs));
  return new Set(sites.map(({ vine, spur }) => `${vine} ${spur}`)).size;
}

/** How many cuts and places wait for a decision. */
export function waitingForPerson() {
  return countOf("PROPOSED") + countOf("UNKNOWN") + countOf("FAILED_NOT_CUT") + waitingPlaces();
}
