// Alarms: severity, text, and what to do. Advice names only buttons that can be pressed.

import { countOf } from "../control/allowed.js";
import { holder } from "../control/lease.js";
import { hardwareStopPressed } from "../control/stop.js";
import { counted } from "../state/format.js";
import { isGone, isLive, isOpening, link, pageState, points, preview, staleWords } from "../state/page-state.js";
import { reasonText } from "../state/reasons.js";
import { history } from "./history.js";

/** @typedef {import("../link/messages.js").ControllerState} ControllerState */
/** @typedef {import("../link/messages.js").PageState} PageState */

/** @typedef {{ id: string, severity: "error"|"warning", text: string, act: string }} Alarm */

const DEGREE = 180 / Math.PI;
/** Longest round trip for teleoperation (ms). */
const SLOW_MS = 200;
/** Consecutive samples (3 s), since loading the 3-D view is slow for a moment. */
const SLOW_SAMPLES = 12;
/** Ratio of late control periods, over this many samples (10 s). */
const LATE_SHARE = 0.02;
const LATE_SAMPLES = 40;

/** @type {Readonly<Record<string, string>>} */
const GONE = Object.freeze({
  bridge: "Nothing is known of the robot now. If it moves, press its emergency stop; then start the bridge again.",
  controller: "The robot has stopped by itself. Start the controller again; what is queued waits.",
  perception: "Nothing new is seen. Work pauses until it is back: start perception again.",
});

/**
 * All alarms now, errors first.
 *
 * @returns {Alarm[]}
 */
export function alarms() {
  const state = pageState.get();
  const found = link.get().status === "open" || isOpening() ? [] : [noLink()];
  if (state !== null && found.length === 0) found.push(...ofProcesses(), ...ofModes(state), ...ofWork(state));
  return found.sort((a, b) => Number(a.severity === "warning") - Number(b.severity === "warning"));
}

/** @returns {Alarm} */
function noLink() {
  return alarm(
    "link",
    "error",
    "This page has no link to the server",
    "It tries again by itself. Until then use the emergency stop on the robot.",
  );
}

/**
 * @param {string} id
 * @param {"error"|"warning"} severity
 * @param {string} text
 * @param {string} act
 * @returns {Alarm}
 */
function alarm(id, severity, text, act) {
  return { id, severity, text, act };
}

/** @returns {Alarm[]} */
function ofProcesses() {
  if (!isLive("server"))
    return [alarm("server", "error", "The server is silent", "Wait, or start it again; the robot stops without it.")];
  return /** @type {const} */ (["bridge", "controller", "perception"])
    .filter(isGone)
    .map((process) =>
      alarm(process, process === "perception" ? "warning" : "error", staleWords(process), GONE[process] ?? ""),
    );
}

/**
 * @param {PageState} state
 * @returns {Alarm[]}
 */
function ofModes({ controller, bridge, stops }) {
  const found = [];
  if (stops.some((stop) => stop.hardware)) {
    found.push(
      alarm(
        "hardware",
        "error",
        "The emergency stop on the robot is pressed",
        "Release it there once the row is clear, then reset here.",
      ),
    );
  }
  const reason = controller ? `: ${reasonText(controller.reason)}` : "";
  switch (controller?.mode) {
    case "ESTOP_LATCHED":
      found.push(alarm("stopped", "error", `Stopped${reason}`, afterStop()));
      break;
    case "PROTECTIVE_STOP":
      found.push(alarm("protective", "error", `Protective stop${reason}`, afterProtectiveStop(controller)));
      break;
    case "PAUSED":
      found.push(alarm("paused", "warning", `Paused${reason}`, afterPause(controller)));
      break;
    case "FAULT":
      found.push(alarm("fault", "error", `Fault${reason}`, afterFault(controller)));
      break;
    case "READY":
      // Takes the place of "Paused": Resume alone starts nothing.
      if (waitingWork(controller))
        found.push(alarm("paused", "warning", "The work waits to be begun again", waitingWork(controller)));
      break;
  }
  if (bridge?.cutter === "jammed") {
    found.push(
      alarm(
        "jammed",
        "error",
        "The cutter is jammed",
        "Press the robot's emergency stop, then free the blades by hand.",
      ),
    );
  }
  const atWork = controller?.mode === "AUTO" || controller?.mode === "TELEOP";
  if (bridge?.watchdog && atWork && isLive("controller")) {
    found.push(
      alarm(
        "watchdog",
        "error",
        "The bridge gets no commands in time and holds the robot",
        "See the load of its computer, then start again.",
      ),
    );
  }
  return found;
}

/**
 * @param {PageState} state
 * @returns {Alarm[]}
 */
function ofWork({ controller, bridge, relaxed_limits, plain_wire }) {
  const found = [];
  if (plain_wire) {
    found.push(
      alarm(
        "plain",
        "error",
        "The robot's wire is plain: every program on its machine can move it",
        "Start the program again without --plain-wire.",
      ),
    );
  }
  if (relaxed_limits.length > 0) {
    found.push(
      alarm(
        "wider",
        "warning",
        `Set wider than usual: ${relaxed_limits.join("; ")}`,
        "If nobody means that, have the configuration changed back.",
      ),
    );
  }
  const unknown = points.get()?.points.filter((row) => row.entry.state === "UNKNOWN").length ?? 0;
  if (unknown > 0) {
    found.push(
      alarm(
        "unknown",
        "warning",
        `${counted(unknown, "cut")} ended unknown`,
        "Look at the plant, and say on the row whether it is cut.",
      ),
    );
  }
  if (bridge && isLive("bridge") && bridge.real_time_factor < 0.9 && bridge.kind === "sim") {
    found.push(alarm("slow", "warning", "The simulation is slower than real time", "Close other programs."));
  }
  if (controller && isLive("controller")) {
    if (lateShare() > LATE_SHARE) {
      found.push(
        alarm("late", "warning", "Control periods come too late", "Close other programs on the robot's computer."),
      );
    }
    if (controller.joint_margin * DEGREE < 5) {
      found.push(alarm("margin", "warning", "A joint of the arm is near its limit", awayFromLimit(controller)));
    }
    if (controller.manipulability < 0.02) {
      found.push(alarm("singular", "warning", "The arm is nearly stretched out", awayFromLimit(controller)));
    }
  }
  const trips = history.of("page-round-trip").slice(-SLOW_SAMPLES);
  if (trips.length === SLOW_SAMPLES && trips.every((trip) => trip.value > SLOW_MS)) {
    found.push(
      alarm(
        "trip",
        "warning",
        "The link between this page and the server is slow",
        "Leading the tool may end by itself.",
      ),
    );
  }
  return found;
}

/** Ratio of late control periods in the last seconds. */
function lateShare() {
  const late = history.of("late-ticks").slice(-LATE_SAMPLES);
  const ticks = history.of("ticks").slice(-LATE_SAMPLES);
  const grown = (/** @type {typeof late} */ samples) => (samples.at(-1)?.value ?? 0) - (samples[0]?.value ?? 0);
  return grown(ticks) > 0 ? grown(late) / grown(ticks) : 0;
}

const NOT_MENDED = "Mend the cause. A second after it has gone";

/** @param {ControllerState} controller In PAUSED. */
function afterPause({ interrupted }) {
  return `${control()}When that is seen to, ${press("Resume")}, then ${goOn(interrupted)}.`;
}

/** @param {ControllerState} controller In PROTECTIVE_STOP. */
function afterProtectiveStop({ allowed }) {
  const mended = allowed.Acknowledge === null;
  return `${control()}${mended ? "The cause has gone:" : `${NOT_MENDED},`} ${press("Acknowledge")}, then Resume.`;
}

/** @param {ControllerState} controller In FAULT. */
function afterFault({ allowed }) {
  const mended = allowed.Acknowledge === null;
  return `${mended ? "The cause has gone:" : `${NOT_MENDED},`} ${ofSupervisor("Acknowledge")}, then Arm.`;
}

function afterStop() {
  if (hardwareStopPressed(pageState.get()))
    return "Release the robot's own emergency stop first, once the row is clear.";
  return `See that the row is clear and write why it is safe to go on; ${ofSupervisor("Reset")}, then Arm.`;
}

/**
 * Advice for work that was interrupted, after Resume; empty if none waits.
 *
 * @param {ControllerState} controller
 */
function waitingWork({ mode, interrupted }) {
  if (mode !== "READY" || interrupted !== "work" || countOf("ACCEPTED") === 0) return "";
  return `${control()}${capital(press(goOn("work")))} to go on.`;
}

/** @param {ControllerState} controller */
function awayFromLimit({ mode }) {
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

/** First step while another person holds control. */
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
 * How to continue what was interrupted.
 *
 * @param {import("../link/messages.js").Interrupted} what
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
