// Why something cannot be asked for now. The controller tells why it would refuse each command; here stands only what
// it cannot know: the link, the session, and who holds control. `whyNot…` functions return null if nothing is in the way.

import { POINT_STATES } from "../link/messages.js";
import { STALE_AFTER_S, isLive, link, pageState, points, processAge } from "../state/page-state.js";
import { reason } from "../state/reasons.js";
import { holder } from "./lease.js";
import { stopProgress } from "./stop.js";

/** @typedef {import("../link/messages.js").Process} Process */
/** @typedef {import("../state/reasons.js").Reason} Reason */

/**
 * Why nothing can be asked for: no link, no state, or a viewer.
 *
 * @returns {Reason|null}
 */
export function whyNothing() {
  const { status } = link.get();
  if (status === "signed-out") return reason("not_signed_in");
  if (status !== "open") return reason("no_link");
  const state = pageState.get();
  if (state === null) return reason("no_state_yet");
  if (state.replay) return reason("recording_only");
  return state.role === "viewer" ? reason("viewer_only") : null;
}

/**
 * Why nothing can be asked of a process.
 *
 * @param {Process} process
 * @returns {Reason|null}
 */
export function whyNothingOf(process) {
  return whyNothing() ?? whySilent("server") ?? whySilent(process);
}

/**
 * @param {Process} process
 * @returns {Reason|null}
 */
function whySilent(process) {
  const age_s = processAge(process);
  if (age_s === null) return reason("process_unheard", { process });
  return isLive(process) ? null : reason("process_silent", { process, age_s, limit_s: STALE_AFTER_S[process] });
}

/**
 * Why the controller would refuse a command now.
 *
 * @param {string} command Name of the command, as in `ControllerState.allowed`.
 * @returns {Reason|null}
 */
export function whyNot(command) {
  const nothing = whyNothingOf("controller");
  if (nothing) return nothing;
  const controller = pageState.get()?.controller;
  const refusal = controller?.allowed[command];
  if (!controller || refusal === undefined) return reason("command_unknown", { command });
  const { held, mine, user } = holder();
  const theirs = held && !mine && controller.of_holder.includes(command);
  // Until the robot tells of a stop that was pressed here, its state still allows what the stop will refuse.
  const ofOthers = pageState.get()?.role !== "supervisor" && controller.of_supervisor.includes(command);
  const stopping = stopProgress.get() === "sending" || stopProgress.get() === "sent";
  if (stopping && controller.of_holder.includes(command)) return refusal ?? reason("stop_asked");
  if (ofOthers) return reason("supervisor_needed");
  return refusal ?? (theirs ? reason("control_held", { user }) : null);
}

/**
 * Why the state of a point refuses a command.
 *
 * @param {keyof typeof POINT_STATES} command
 * @param {import("../link/messages.js").PagePoint} row
 * @returns {Reason|null}
 */
export function whyNotPoint(command, { point: { point_id: point }, entry: { state, reason: why } }) {
  if (POINT_STATES[command].includes(state)) return null;
  return state === "UNREACHABLE" && why ? reason("point_unreachable", { point, why }) : reason("point_state", { point, state });
}

/** Why the robot cannot be moved by hand now. */
export function whyNoTeleoperation() {
  return whyNot("Teleoperation") ?? whyNothingOf("bridge");
}

/** @param {import("../link/messages.js").PointState} state */
export function countOf(state) {
  return (points.get()?.points ?? []).filter((row) => row.entry.state === state).length;
}
