// Calibration of camera and base: what is in use, how well ordinary work agrees with it, and a new one where there is one.

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

/** @typedef {import("../js/link/messages.js").BaseCalibration} BaseCalibration */
/** @typedef {import("../js/link/messages.js").CameraMount} CameraMount */
/** @typedef {import("../js/link/messages.js").CameraState} CameraState */
/** @typedef {import("../js/link/messages.js").RobotCalibration} RobotCalibration */
/** @typedef {"CheckCamera"|"CalibrateCamera"|"UseCamera"|"CalibrateBase"|"UseBase"} Command */

/** Period of the calibrations' state while the screen is open (ms). */
const AGAIN_MS = 2000;
const DEGREE = Math.PI / 180;
const ROWS = /** @type {const} */ (["used", "seen", "offer", "base", "base_offer"]);

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
    const measure = button("calibrate-base", "CalibrateBase", () => void ask(text("command.CalibrateBase"), "api/base/calibrate"));
    const useBase = button("use-base", "UseBase", () => {
      const base = this.robot.get()?.base;
      if (base) void ask(text("command.UseBase"), "api/base/use", { made_at: base.made_at });
    });
    this.append(list, element("div", { class: "buttons" }, check, calibrate, use, measure, useBase));
    whileOpen("engineer", AGAIN_MS, async () => {
      this.camera.set((await fetchJson("api/camera")) ?? this.camera.get());
      this.robot.set((await fetchJson("api/calibration")) ?? this.robot.get());
    });
    drawOn([this.camera, this.robot, pageState, link, now], () => {
      if (screen.get() !== "engineer") return;
      const [camera, robot] = [this.camera.get(), this.robot.get()];
      const words = { ...cameraWords(camera), base: baseWords(pageState.get()?.bridge?.base), base_offer: robot ? offerWords(robot) : text("calibration.untold") };
      for (const { row, cell } of cells) setText(cell, words[row]);
      setEnabled(check, whyNot("CheckCamera"), text("calibration.check_hint"));
      setEnabled(calibrate, whyNot("CalibrateCamera"), text("calibration.calibrate_hint"));
      setEnabled(use, whyNot("UseCamera") ?? (camera?.offer ? null : reason("no_calibration_offered")), text("calibration.use_hint"));
      setEnabled(measure, whyNot("CalibrateBase"), text("calibration.base_hint"));
      setEnabled(useBase, whyNot("UseBase") ?? (isNew(robot?.base) ? null : reason("no_base_offered")), text("calibration.base_use_hint"));
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

/** Whether a calibration of the base is another one than that in use. @param {BaseCalibration|null|undefined} base */
function isNew(base) {
  return base != null && base.made_at !== pageState.get()?.bridge?.base?.made_at;
}

/** @param {RobotCalibration} robot */
function offerWords({ base, base_refused, base_views }) {
  if (base && isNew(base)) return baseWords(base);
  if (base_refused && base_views > 0) return reasonText(base_refused);
  return text("calibration.none");
}

/** @param {BaseCalibration|null|undefined} base */
function baseWords(base) {
  if (!base) return text("calibration.base_drawn");
  const mm = (/** @type {number} */ length) => decimal(length * 1000, 2);
  const percent = (/** @type {number} */ share) => decimal(share * 100, 2);
  return counted("calibration.base_measured", base.views, {
    date: dateWords(base.made_at),
    left: mm(base.left),
    right: mm(base.right),
    track: mm(base.track),
    radius_sd: percent(base.radius_sd),
    track_sd: percent(base.track_sd),
  });
}

customElements.define("rp-calibration", RpCalibration);
