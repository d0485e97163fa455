// Which intents are possible now, and otherwise why not. `whyNot…` functions return an empty string if nothing is in
// the way.

import { OF_HOLDER } from "../link/messages.js";
import { MODE_WORDS } from "../state/format.js";
import { isLive, link, pageState, points, preview, staleWords } from "../state/page-state.js";
import { holder } from "./lease.js";
import { reasonText } from "../state/reasons.js";

/** Reason for an intent that the mode does not allow. */
const NEEDS = Object.freeze({
  Arm: "Arming starts from Idle",
  Start: "Starting needs Ready",
  Survey: "A survey needs Ready",
  Pause: "There is nothing to pause",
  Resume: "Resuming needs Paused",
  Home: "Going home needs Ready",
  Acknowledge: "There is nothing to acknowledge",
  Reset: "There is no stop to reset",
  AcceptPoint: "Points cannot be accepted",
  AcceptAll: "Points cannot be accepted",
  RequestPreview: "There can be no preview",
  ApprovePreview: "Nothing can be approved",
  RequirePreview: "It cannot be changed",
  SetApproach: "The approach cannot be turned",
  MoveInQueue: "The order cannot be changed",
  ResetOrder: "The order cannot be changed",
  RejectPoint: "Points cannot be rejected",
  ReconsiderPoint: "Decisions cannot be taken back",
  ResolvePoint: "How a cut ended cannot be said",
});

/** @typedef {keyof typeof NEEDS} Intent */

/** Why nothing can be asked for: no link, no state, or a viewer. */
export function whyNothing() {
  const { status } = link.get();
  if (status === "signed-out") return "You are not signed in";
  if (status !== "open") return "There is no link to the server";
  const state = pageState.get();
  if (state === null) return "Waiting for the first state";
  if (state.role === "viewer") return "You are signed in as a viewer";
  return "";
}

/** Why nothing can be asked of the controller. */
function whyNoController() {
  const nothing = whyNothing();
  if (nothing) return nothing;
  const known = pageState.get()?.controller && isLive("controller");
  return known ? "" : staleWords("controller") || "The controller is not there";
}

/**
 * Why the controller would refuse an intent now.
 *
 * @param {Intent} intent Name of the intent, as in `ControllerState.allowed`.
 */
export function whyNot(intent) {
  const controller = pageState.get()?.controller ?? null;
  if (controller === null || whyNoController()) return whyNoController();
  // Acknowledging a fault moves nothing and needs no control.
  const ofHolder = OF_HOLDER.includes(intent) && controller.mode !== "FAULT";
  if (controller.allowed[intent] === null) return ofHolder ? whyNotHolder() : "";
  if (intent === "Start" && controller.mode === "READY" && countOf("ACCEPTED") === 0) {
    return countOf("UNREACHABLE") > 0 ? "No accepted point can be reached" : "Accept a point first";
  }
  if (intent === "Start" && controller.mode === "READY" && whyNoStart()) return whyNoStart();
  return `${NEEDS[intent]}; the mode is ${MODE_WORDS[controller.mode]}`;
}

/** Why work waits for a preview. */
function whyNoStart() {
  const state = preview.get();
  if (!state?.required || state.phase === "approved") return "";
  if (state.phase === "ready") return "Approve the preview first";
  if (state.phase === "expired") return `The preview has expired: ${reasonText(state.reason)}`;
  return "A preview is required before each cut: press Preview";
}

/** Names the person who holds control, unless it is this page or nobody. */
function whyNotHolder() {
  const { held, mine, user } = holder();
  return held && !mine ? `${user} holds control: ask for it, or take it` : "";
}

/** Why teleoperation is not possible now. */
export function whyNoTeleoperation() {
  const controller = pageState.get()?.controller ?? null;
  if (controller === null || whyNoController()) return whyNoController();
  if (!isLive("bridge")) return staleWords("bridge") || "The bridge is not there";
  if (controller.mode === "READY" || controller.mode === "TELEOP") return whyNotHolder();
  return `Teleoperation needs Ready; the mode is ${MODE_WORDS[controller.mode]}`;
}

/** @param {import("../link/messages.js").PointState} state */
export function countOf(state) {
  return (points.get()?.points ?? []).filter((row) => row.entry.state === state).length;
}
