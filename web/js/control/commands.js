// The robot's commands that have a button, and where else the next step leads.

import { ask, fetchJson } from "../link/api.js";
import { openScreen } from "../state/screens.js";
import { signal } from "../state/signals.js";
import { text } from "../state/texts.js";
import { whyNot } from "./allowed.js";
import { approvePreview, openPreview, whyNoApproval } from "./preview.js";

/** @typedef {import("../link/messages.js").CameraState} CameraState */
/** @typedef {"Arm"|"Survey"|"Start"|"Pause"|"Resume"|"Home"|"Acknowledge"} CommandName */
/** @typedef {CommandName|"continue"|"review"|"preview"|"approve"|"reset"|"calibration"} Step */

/** @type {readonly CommandName[]} */
export const COMMANDS = Object.freeze(["Arm", "Survey", "Start", "Pause", "Resume", "Home", "Acknowledge"]);
/** How far the next survey goes (m). */
export const surveyDistance = signal(4);

/** @param {Step} step @returns {step is CommandName} */
export function isCommand(step) {
  return COMMANDS.some((each) => each === step);
}

/** Why a step is not possible now. @param {Step} step */
export function whyNotStep(step) {
  if (step === "approve") return whyNoApproval();
  if (step === "continue") return whyNot("Continue");
  if (step === "reset") return whyNot("Reset");
  if (step === "calibration") return whyNot("UseCamera");
  return isCommand(step) ? whyNot(step) : null;
}

/** Do it; over when the robot has answered. @param {Step} step */
export async function take(step) {
  switch (step) {
    case "continue":
      await ask(text("command.Resume"), "api/continue");
      break;
    case "review":
      openScreen("review");
      break;
    case "preview":
      openPreview();
      break;
    case "approve":
      await approvePreview();
      break;
    case "calibration":
      await useCalibration();
      break;
    case "reset":
      document.getElementById("reset-reason")?.focus();
      break;
    default:
      await ask(text(`command.${step}`), `api/${step.toLowerCase()}`, step === "Survey" ? { distance: surveyDistance.get() } : {});
  }
}

/** The one that is on offer now. */
async function useCalibration() {
  /** @type {CameraState|null} */
  const camera = await fetchJson("api/camera");
  if (camera?.offer) await ask(text("command.UseCamera"), "api/camera/use", { made_at: camera.offer.made_at });
}
