// Calibration of camera, base, arm and camera clock: what is in use, how well ordinary work agrees with it, and a new one where there is one.

import { whyNot } from "../js/control/allowed.js";
import { take } from "../js/control/commands.js";
import { ask, fetchJson } from "../js/link/api.js";
import { dateWords, decimal } from "../js/state/format.js";
import { link, now, pageState } from "../js/state/page-state.js";
import { reason, reasonText } from "../js/state/reasons.js";
import { screen, whileOpen } from "../js/state/screens.js";
import { drawOn, signal } from "../js/state/signals.js";
import { counted, text } from "../js/state/texts.js";
import { element, setEnabled, setText } from "../js/views/dom.js";

/** @typedef {import("../js/link/messages.js").ArmCalibration} ArmCalibration */
/** @typedef {import("../js/link/messages.js").BaseCalibration} BaseCalibration */
/** @typedef {import("../js/link/messages.js").CameraMount} CameraMount */
/** @typedef {import("../js/link/messages.js").CameraState} CameraState */
/** @typedef {import("../js/link/messages.js").FrameTiming} FrameTiming */
/** @typedef {import("../js/link/messages.js").RobotCalibration} RobotCalibration */
/** @typedef {"CheckCamera"|"CalibrateCamera"|"UseCamera"|"CalibrateBase"|"UseBase"|"CalibrateArm"|"UseArm"|"UseTiming"} Command */

/** Period of the calibrations' state while the screen is open (ms). */
const AGAIN_MS = 2000;
const DEGREE = Math.PI / 180;
const ROWS = /** @type {const} */ (["used", "seen", "offer", "base", "base_offer", "arm", "arm_offer", "timing", "timing_offer"]);
/** Parts of the robot that the bridge uses a calibration of. */
const PARTS = /** @type {const} */ ([
  { part: "base", calibrate: "CalibrateBase", use: "UseBase", none: () => reason("no_base_offered") },
  { part: "arm", calibrate: "CalibrateArm", use: "UseArm", none: () => reason("no_arm_offered") },
  // Ordinary work tells it.
  { part: "timing", calibrate: null, use: "UseTiming", none: () => reason("no_timing_offered") },
]);

class RpCalibration extends HTMLElement {
  camera = signal(/** @type {CameraState|null} */ (null));
  robot = signal(/** @type {RobotCalibration|null} */ (null));

  connectedCallback() {
    if (this.childElementCount > 0) return;
    const cells = ROWS.map((row) => ({ row, cell: element("dd", { data: { calibration: row } }) }));
    const list = element("dl", { class: "facts" }, ...cells.flatMap(({ row, cell }) => [element("dt", { text: text(`calibration.${row}`) }), cell]));
    const button = (/** @type {string} */ id, /** @type {Command} */ command, /** @type {() => void} */ act) =>
      element("button", { id, text: text(`command.${command}`), onclick: act });
    const check = button("check-camera", "CheckCamera", () => void ask(text("command.CheckCamera"), "api/camera/check"));
    const calibrate = button("calibrate-camera", "CalibrateCamera", () => void ask(text("command.CalibrateCamera"), "api/camera/calibrate"));
    const use = button("use-camera", "UseCamera", () => void take("calibration"));
    const parts = PARTS.map(({ part, calibrate, use, none }) => {
      const path = (/** @type {string} */ what) => `api/${part}/${what}`;
      const measure = calibrate && button(`calibrate-${part}`, calibrate, () => void ask(text(`command.${calibrate}`), path("calibrate")));
      const useIt = button(`use-${part}`, use, () => {
        const offer = this.robot.get()?.[part];
        if (offer) void ask(text(`command.${use}`), path("use"), { made_at: offer.made_at });
      });
      const draw = () => {
        if (measure) setEnabled(measure, whyNot(calibrate), text(`calibration.${part}_hint`));
        setEnabled(useIt, whyNot(use) ?? (newPart(part, this.robot.get()) ? null : none()), text(`calibration.${part}_use_hint`));
      };
      return { buttons: measure ? [measure, useIt] : [useIt], draw };
    });
    this.append(list, element("div", { class: "buttons" }, check, calibrate, use, ...parts.flatMap(({ buttons }) => buttons)));
    whileOpen("engineer", AGAIN_MS, async () => {
      this.camera.set((await fetchJson("api/camera")) ?? this.camera.get());
      this.robot.set((await fetchJson("api/calibration")) ?? this.robot.get());
    });
    drawOn([this.camera, this.robot, pageState, link, now], () => {
      if (screen.get() !== "engineer") return;
      const [camera, robot] = [this.camera.get(), this.robot.get()];
      const words = { ...cameraWords(camera), ...partWords("base", robot), ...partWords("arm", robot), ...partWords("timing", robot) };
      for (const { row, cell } of cells) setText(cell, words[row]);
      setEnabled(check, whyNot("CheckCamera"), text("calibration.check_hint"));
      setEnabled(calibrate, whyNot("CalibrateCamera"), text("calibration.calibrate_hint"));
      setEnabled(use, whyNot("UseCamera") ?? (camera?.offer ? null : reason("no_calibration_offered")), text("calibration.use_hint"));
      for (const { draw } of parts) draw();
    });
  }
}

/** @param {CameraState|null} camera */
function cameraWords(camera) {
  const untold = text("calibration.untold");
  if (!camera) return { used: untold, seen: untold, offer: untold };
  const { mount, turned, turned_sd, observations, offer, refused, views } = camera;
  const found = offer ? madeWords(offer) : refused ? reasonText(refused) : null;
  return {
    used: mount ? madeWords(mount) : text("calibration.drawn"),
    seen: turned && turned_sd ? turnedWords(turned, turned_sd, observations) : text("calibration.unseen"),
    offer: found ?? (views > 0 ? counted("calibration.views", views) : text("calibration.none")),
  };
}

/** @param {readonly number[]} turned @param {readonly number[]} sd @param {number} observations */
function turnedWords([up = 0, right = 0], sd, observations) {
  return counted("calibration.turned", observations, { right: turn(right), up: turn(up), sd: turn(Math.max(...sd)) });
}

/** @param {number} angle (rad) */
function turn(angle) {
  return decimal(angle / DEGREE, 2);
}

/** @param {CameraMount} mount */
function madeWords({ source, made_at, views, pixels, angle_sd, shift_sd }) {
  const [date, sd, shift] = [dateWords(made_at), turn(angle_sd), decimal(shift_sd * 1000, 1)];
  if (source === "board") return counted("calibration.board", views, { date, sd, shift, pixels: decimal(pixels, 2) });
  return counted("calibration.work", views, { date, sd, shift });
}

/** @typedef {"base"|"arm"|"timing"} Part */

/** The new calibration of a part; null without one, and for the one in use. @param {Part} part @param {RobotCalibration|null} robot */
function newPart(part, robot) {
  const offer = robot?.[part];
  return offer && offer.made_at !== pageState.get()?.bridge?.[part]?.made_at ? offer : null;
}

/** Why the last calibration of a part gave no new one; null if it gave one, and before the first. @param {Part} part @param {RobotCalibration|null} robot */
function refusalOf(part, robot) {
  // Ordinary work refuses nothing.
  return !robot || part === "timing" || robot[`${part}_views`] === 0 ? null : robot[`${part}_refused`];
}

/** What is in use for a part, and what is new. @template {Part} P @param {P} part @param {RobotCalibration|null} robot */
function partWords(part, robot) {
  const used = pageState.get()?.bridge?.[part];
  const offer = newPart(part, robot);
  const refused = refusalOf(part, robot);
  const found = offer ? measuredWords(offer) : refused ? reasonText(refused) : text("calibration.none");
  const words = { [part]: used ? measuredWords(used) : text(`calibration.${part}_drawn`), [`${part}_offer`]: robot ? found : text("calibration.untold") };
  return /** @type {Record<P|`${P}_offer`, string>} */ (words);
}

/** @param {BaseCalibration|ArmCalibration|FrameTiming} made */
function measuredWords(made) {
  const date = dateWords(made.made_at);
  if ("offsets" in made) {
    const offsets = made.offsets.slice(1, 6).map(turn).join(", ");
    return counted("calibration.arm_measured", made.views, { date, offsets, sd: turn(made.offset_sd), pixels: decimal(made.pixels, 2) });
  }
  const mm = (/** @type {number} */ length) => decimal(length * 1000, 2);
  if ("delay" in made) {
    const [delay, sd] = [decimal(made.delay * 1000, 0), decimal(made.delay_sd * 1000, 0)];
    return counted("calibration.timing_measured", made.views, { date, delay, sd });
  }
  const percent = (/** @type {number} */ share) => decimal(share * 100, 2);
  return counted("calibration.base_measured", made.views, {
    date,
    left: mm(made.left),
    right: mm(made.right),
    track: mm(made.track),
    radius_sd: percent(made.radius_sd),
    track_sd: percent(made.track_sd),
  });
}

customElements.define("rp-calibration", RpCalibration);
