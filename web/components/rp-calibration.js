// The camera's calibration: what is in use, how well ordinary work agrees with it, and a better one where there is one.

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

/** @typedef {import("../js/link/messages.js").CameraMount} CameraMount */
/** @typedef {import("../js/link/messages.js").CameraState} CameraState */

/** Period of the camera's state while the screen is open (ms). */
const AGAIN_MS = 2000;
const DEGREE = Math.PI / 180;
const ROWS = /** @type {const} */ (["used", "seen", "offer"]);

class RpCalibration extends HTMLElement {
  camera = signal(/** @type {CameraState|null} */ (null));

  connectedCallback() {
    if (this.childElementCount > 0) return;
    const cells = ROWS.map((row) => ({ row, cell: element("dd", { data: { calibration: row } }) }));
    const list = element("dl", { class: "facts" }, ...cells.flatMap(({ row, cell }) => [element("dt", { text: text(`calibration.${row}`) }), cell]));
    const button = (/** @type {string} */ id, /** @type {"CheckCamera"|"CalibrateCamera"|"UseCamera"} */ command, /** @type {() => void} */ act) =>
      element("button", { id, text: text(`command.${command}`), onclick: act });
    const check = button("check-camera", "CheckCamera", () => void ask(text("command.CheckCamera"), "api/camera/check"));
    const calibrate = button("calibrate-camera", "CalibrateCamera", () => void ask(text("command.CalibrateCamera"), "api/camera/calibrate"));
    const use = button("use-camera", "UseCamera", () => take("calibration"));
    this.append(list, element("div", { class: "buttons" }, check, calibrate, use));
    whileOpen("engineer", AGAIN_MS, async () => this.camera.set((await fetchJson("api/camera")) ?? this.camera.get()));
    drawOn([this.camera, pageState, link, now], () => {
      if (screen.get() !== "engineer") return;
      const camera = this.camera.get();
      for (const { row, cell } of cells) setText(cell, camera ? WORDS[row](camera) : text("calibration.untold"));
      setEnabled(check, whyNot("CheckCamera"), text("calibration.check_hint"));
      setEnabled(calibrate, whyNot("CalibrateCamera"), text("calibration.calibrate_hint"));
      setEnabled(use, whyNot("UseCamera") ?? (camera?.offer ? null : reason("no_calibration_offered")), text("calibration.use_hint"));
    });
  }
}

/** @type {Readonly<Record<typeof ROWS[number], (camera: CameraState) => string>>} */
const WORDS = Object.freeze({
  used: ({ mount }) => (mount ? madeWords(mount) : text("calibration.drawn")),
  seen: ({ turned, turned_sd, observations }) => {
    if (!turned || !turned_sd) return text("calibration.unseen");
    const [up, right] = turned;
    return counted("calibration.turned", observations, { right: turn(right), up: turn(up), sd: turn(Math.max(...turned_sd)) });
  },
  offer: ({ offer, refused, views }) => {
    if (offer) return madeWords(offer);
    if (refused) return reasonText(refused);
    return views > 0 ? counted("calibration.views", views) : text("calibration.none");
  },
});

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

customElements.define("rp-calibration", RpCalibration);
