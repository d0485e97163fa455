// What leads on from where the robot is. Advice that names buttons names those that can be pressed, the first one now.

import { countOf } from "./allowed.js";
import { holder } from "./holder.js";
import { preview } from "./preview-state.js";
import { pageState } from "./state.js";
import { buttonPressed } from "./stops.js";

/** @typedef {import("./messages.js").ControllerState} ControllerState */

const NOT_MENDED = "Mend the cause. A second after it has gone";

/** @param {ControllerState} controller In PAUSED. */
export function afterPause({ interrupted }) {
  return `${control()}When that is seen to, ${press("Resume")}, then ${goOn(interrupted)}.`;
}

/** @param {ControllerState} controller In PROTECTIVE_STOP. */
export function afterProtectiveStop({ allowed }) {
  const mended = allowed.includes("Acknowledge");
  return `${control()}${mended ? "The cause has gone:" : `${NOT_MENDED},`} ${press("Acknowledge")}, then Resume.`;
}

/** @param {ControllerState} controller In FAULT. */
export function afterFault({ allowed }) {
  const mended = allowed.includes("Acknowledge");
  return `${mended ? "The cause has gone:" : `${NOT_MENDED},`} ${ofSupervisor("Acknowledge")}, then Arm.`;
}

export function afterStop() {
  if (buttonPressed(pageState.get())) return "Release the robot's own emergency stop first, once the row is clear.";
  return `See that the row is clear and write why it is safe to go on; ${ofSupervisor("Reset")}, then Arm.`;
}

/**
 * What goes on with the work that a pause has ended, once it has been resumed; empty where none waits.
 *
 * @param {ControllerState} controller
 */
export function waitingWork({ mode, interrupted }) {
  if (mode !== "READY" || interrupted !== "work" || countOf("ACCEPTED") === 0) return "";
  return `${control()}${capital(press(goOn("work")))} to go on.`;
}

/** @param {ControllerState} controller */
export function awayFromLimit({ mode }) {
  switch (mode) {
    case "AUTO":
      return "Nothing yet: the robot leads itself back. If it does not, press Pause, then Resume and Home.";
    case "TELEOP":
      return "Lead the tool back towards the base; or let go, and press Home.";
    case "READY":
      return `${control()}${capital(press("Home"))}, or lead the tool back towards the base.`;
    case "PAUSED":
      return `${control()}${capital(press("Resume"))}, then Home.`;
    case "IDLE":
      return `${control()}${capital(press("Arm"))}, then Home.`;
    default:
      return "Once the robot is ready again, press Home.";
  }
}

/** What comes first where somebody else holds control. */
function control() {
  const { held, mine, user } = holder();
  return held && !mine && !viewing() ? `${user} holds control: press Ask or Take. ` : "";
}

/** @param {string} button */
function press(button) {
  return viewing() ? `an operator presses ${button}` : `press ${button}`;
}

/** @param {string} button */
function ofSupervisor(button) {
  return pageState.get()?.role === "supervisor" ? `press ${button}` : `a supervisor presses ${button}`;
}

/**
 * What begins again what was interrupted.
 *
 * @param {import("./messages.js").Interrupted} what
 */
function goOn(what) {
  const accepted = countOf("ACCEPTED") > 0;
  if (what === "teleoperation") return "hold again";
  if (what === "survey") return accepted ? "Survey to look on, or Start to cut" : "Survey to look on";
  if (!accepted) return countOf("PROPOSED") > 0 ? "accept points, then Start" : "Survey";
  return startAfterPreview();
}

function startAfterPreview() {
  const told = preview.get();
  if (!told?.required || told.phase === "approved") return "Start";
  return told.phase === "ready" ? "Approve and Start" : "Preview, Approve and Start";
}

function viewing() {
  return pageState.get()?.role === "viewer";
}

/** @param {string} words */
function capital(words) {
  return words.charAt(0).toUpperCase() + words.slice(1);
}
