// The alarms now: which are present, and the steps that lead out of each. Their words are in the catalogue of reasons.
// A step names only buttons that can be pressed.

import { countOf } from "../control/allowed.js";
import { holder } from "../control/lease.js";
import { mayContinue } from "../control/next-step.js";
import { hardwareStopPressed } from "../control/stop.js";
import { isGone, isLive, isOpening, link, pageState, preview } from "../state/page-state.js";
import { reason, severityOf } from "../state/reasons.js";
import { history } from "./history.js";
import { READINGS, beyondLimit } from "./readings.js";

/** @typedef {import("../link/messages.js").ControllerState} ControllerState */
/** @typedef {import("../link/messages.js").PageState} PageState */
/** @typedef {import("../state/reasons.js").Reason} Reason */

/**
 * What to do is the advice of its reason, then these steps.
 *
 * @typedef {{ reason: Reason, steps: readonly Reason[] }} Alarm
 */

/** Consecutive slow samples (3 s), since loading the 3-D view is slow for a moment. */
const SLOW_SAMPLES = 12;
/** Ratio of late control periods, over this many samples (10 s). */
const LATE_SHARE = 0.02;
const LATE_SAMPLES = 40;

/**
 * All alarms now, errors first.
 *
 * @returns {Alarm[]}
 */
export function alarms() {
  const state = pageState.get();
  const lost = link.get().status !== "open" && !isOpening();
  const found = lost ? [alarm(reason("no_link"))] : state === null ? [] : ofRobot(state);
  return found.sort((a, b) => Number(isWarning(a)) - Number(isWarning(b)));
}

/** @param {Alarm} each */
function isWarning(each) {
  return severityOf(each.reason) !== "error";
}

/**
 * @param {Reason} why
 * @param {readonly Reason[]} [steps]
 * @returns {Alarm}
 */
function alarm(why, steps = []) {
  return { reason: why, steps };
}

/** @param {PageState} state */
function ofRobot(state) {
  return [...ofProcesses(), ...ofDevices(state), ...ofMode(state), ...ofSettings(state), ...ofWork(), ...ofReadings(state)];
}

/** A silent server says nothing about the others. */
function ofProcesses() {
  if (!isLive("server")) return [alarm(reason("server_silent"))];
  return [
    ...when(isGone("bridge"), reason("bridge_gone")),
    ...when(isGone("controller"), reason("controller_gone")),
    ...when(isGone("perception"), reason("perception_gone")),
  ];
}

/**
 * @param {boolean|undefined} present
 * @param {Reason} why
 */
function when(present, why) {
  return present ? [alarm(why)] : [];
}

/** @param {PageState} state */
function ofMode({ controller }) {
  if (controller === null) return [];
  const { mode, reason: cause } = controller;
  switch (mode) {
    case "ESTOP_LATCHED":
      return [alarm(reason("mode_stopped", { cause }), afterStop())];
    case "PROTECTIVE_STOP":
      return [alarm(reason("mode_protective_stop", { cause }), afterProtectiveStop(controller))];
    case "FAULT":
      return [alarm(reason("mode_fault", { cause }), afterFault(controller))];
    case "PAUSED":
      return [alarm(reason("mode_paused", { cause }), byOperator(...afterPause(controller)))];
    case "READY": {
      // Takes the place of "Paused": Resume alone starts nothing.
      const waits = controller.interrupted === "work" && countOf("ACCEPTED") > 0;
      return waits ? [alarm(reason("work_waits"), byOperator(next(controller)))] : [];
    }
    case "AUTO":
      return cause?.code === "waits_for_picture" ? [alarm(cause)] : [];
    default:
      return [];
  }
}

/** @param {PageState} state */
function ofDevices(state) {
  const { bridge, camera_warning, controller } = state;
  const atWork = controller?.mode === "AUTO" || controller?.mode === "TELEOP";
  return [
    ...when(hardwareStopPressed(state), reason("emergency_stop_pressed")),
    ...when(bridge?.cutter === "jammed", reason("cutter_jammed")),
    ...(camera_warning ? [alarm(camera_warning, afterCamera(camera_warning, controller))] : []),
    ...(bridge?.calibration_warnings ?? []).map((each) => alarm(each)),
    ...when(bridge?.watchdog && atWork && isLive("controller"), reason("commands_missing")),
  ];
}

/** @param {PageState} state */
function ofSettings({ relaxed_limits, plain_wire }) {
  return [
    ...when(plain_wire, reason("wire_plain")),
    ...(relaxed_limits.length > 0 ? [alarm(reason("limits_relaxed", { limits: together(relaxed_limits) }))] : []),
  ];
}

/** @param {readonly Reason[]} reasons At least one. */
function together(reasons) {
  return reasons.reduce((first, second) => reason("both", { first, second }));
}

function ofWork() {
  const cuts = countOf("UNKNOWN");
  return when(cuts > 0, reason("cuts_unknown", { cuts }));
}

/** @param {PageState} state */
function ofReadings(state) {
  const { bridge, controller } = state;
  const simulated = bridge?.kind === "sim" && isLive("bridge");
  const found = [
    ...when(simulated && isBeyond("real-time-factor", state), reason("simulation_slow")),
    ...when(isSlow(), reason("page_link_slow")),
  ];
  if (!controller || !isLive("controller")) return found;
  found.push(...when(lateShare() > LATE_SHARE, reason("control_late")));
  if (isBeyond("joint-margin", state)) found.push(alarm(reason("joint_near_limit"), awayFromLimit(controller)));
  if (isBeyond("manipulability", state)) found.push(alarm(reason("arm_stretched"), awayFromLimit(controller)));
  return found;
}

/**
 * @param {string} id
 * @param {PageState} state
 */
function isBeyond(id, state) {
  const reading = READINGS.find((each) => each.id === id);
  return reading !== undefined && beyondLimit(reading, reading.read(state)) !== "";
}

/** Is the link between this page and the server slow? */
function isSlow() {
  const reading = READINGS.find((each) => each.id === "page-round-trip");
  const trips = history.of("page-round-trip").slice(-SLOW_SAMPLES);
  return trips.length === SLOW_SAMPLES && trips.every(({ value }) => reading && beyondLimit(reading, value) === "high");
}

/** Ratio of late control periods in the last seconds. */
function lateShare() {
  const ticks = grown("ticks");
  return ticks > 0 ? grown("late-ticks") / ticks : 0;
}

/** @param {string} id Of a count, which is unknown while its process is gone. */
function grown(id) {
  const known = history.of(id).slice(-LATE_SAMPLES).filter(({ value }) => !Number.isNaN(value));
  return (known.at(-1)?.value ?? 0) - (known[0]?.value ?? 0);
}

/**
 * Steps of somebody who has to be in control first.
 *
 * @param {...Reason} steps
 */
function byOperator(...steps) {
  if (pageState.get()?.role === "viewer") return [reason("ask_operator")];
  const { held, mine, user } = holder();
  return held && !mine ? [reason("control_held", { user }), ...steps] : steps;
}

function isSupervisor() {
  return pageState.get()?.role === "supervisor";
}

function afterStop() {
  if (hardwareStopPressed(pageState.get())) return [reason("release_first")];
  return [reason("check_row"), isSupervisor() ? reason("press_reset") : reason("supervisor_resets")];
}

/** @param {ControllerState} controller In PROTECTIVE_STOP. */
function afterProtectiveStop({ allowed }) {
  return byOperator(mended(allowed), reason("acknowledge_resume"));
}

/** @param {ControllerState} controller In FAULT, where nobody has to be in control. */
function afterFault({ allowed }) {
  return [mended(allowed), isSupervisor() ? reason("acknowledge_arm") : reason("supervisor_acknowledges")];
}

/**
 * A camera that is found turned comes with its correction; one that was calibrated long ago does not.
 *
 * @param {Reason} warning
 * @param {ControllerState|null} controller
 */
function afterCamera({ code }, controller) {
  if (!code.startsWith("camera_looks_") || !controller) return [];
  if (pageState.get()?.role === "viewer") return [reason("ask_operator")];
  return [controller.allowed["UseCamera"] === null ? reason("press_use_calibration") : reason("pause_then_calibration")];
}

/** @param {ControllerState["allowed"]} allowed */
function mended(allowed) {
  return allowed["Acknowledge"] === null ? reason("cause_gone") : reason("mend_cause");
}

/** @param {ControllerState} controller In PAUSED. */
function afterPause(controller) {
  if (!mayContinue(controller.interrupted)) return [reason("press_resume"), next(controller)];
  return [controller.interrupted === "survey" ? reason("resume_survey") : reason("resume_work")];
}

/**
 * How to go on with what was interrupted.
 *
 * @param {ControllerState} controller
 */
function next({ interrupted }) {
  const accepted = countOf("ACCEPTED") > 0;
  if (interrupted === "teleoperation") return reason("hold_again");
  if (!accepted) return countOf("PROPOSED") > 0 ? reason("accept_start") : reason("press_survey");
  const told = preview.get();
  if (!told?.required || told.phase === "approved") return reason("press_start");
  return told.phase === "ready" ? reason("approve_start") : reason("preview_start");
}

/** @param {ControllerState} controller */
function awayFromLimit({ mode }) {
  switch (mode) {
    case "AUTO":
      return [reason("robot_leads_back")];
    case "TELEOP":
      return [reason("lead_back")];
    case "READY":
      return byOperator(reason("press_home"));
    case "PAUSED":
      return byOperator(reason("resume_home"));
    case "IDLE":
      return byOperator(reason("arm_and_home"));
    default:
      return [reason("home_when_ready")];
  }
}
