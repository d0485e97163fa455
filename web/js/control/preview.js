// The preview: asking for it, playing it, approving it.

import { ask } from "../link/api.js";
import { socket } from "../link/socket.js";
import { preview } from "../state/page-state.js";
import { signal } from "../state/signals.js";
import { whyNot, whyNothing } from "./allowed.js";

/** @typedef {import("../link/messages.js").PreviewedCut} PreviewedCut */

/** The view is told of a new moment so often at most (ms). */
const TELL_MS = 66;

/** The moment that is shown (s); null while the ghost is hidden. */
export const moment = signal(/** @type {number|null} */ (null));
export const playing = signal(false);
let startedAt = 0;
let toldAt = 0;

/** Is there one to look at? */
export function hasPreview() {
  return preview.get()?.preview_hash ? true : false;
}

/** Why none can be asked for; empty when it can. @param {number} accepted How many points are accepted. */
export function whyNoPreview(accepted) {
  return whyNot("AskPreview") || (accepted === 0 ? "Accept a point first" : "");
}

/** Why it cannot be approved; empty when it can. */
export function whyNoApproval() {
  const state = preview.get();
  if (!state || !hasPreview()) return whyNothing() || "There is no preview yet";
  if (state.phase === "approved") return `Approved by ${state.approved_by}`;
  if (state.phase === "expired") return `It has expired: ${state.reason}`;
  return whyNot("ApprovePreview");
}

/** @param {string} pointId Empty for all of the work. */
export function askPreview(pointId) {
  hide();
  return ask("Preview", "api/preview", { point_id: pointId });
}

export function approve() {
  return ask("Approving the preview", "api/preview/approve", { preview_hash: preview.get()?.preview_hash ?? "" });
}

/** @param {boolean} required */
export function require(required) {
  return ask("Previews", "api/preview/required", { required });
}

/** Show a moment in the 3-D view. @param {number} time */
export function show(time) {
  const end = preview.get()?.duration_s ?? 0;
  moment.set(Math.max(0, Math.min(time, end)));
  const at = performance.now();
  if (at - toldAt < TELL_MS && time < end) return;
  toldAt = at;
  socket.send({ type: "ShowPreview", time: moment.get() });
}

export function hide() {
  playing.set(false);
  if (moment.get() === null) return;
  moment.set(null);
  socket.send({ type: "ShowPreview", time: null });
}

/** Play from the moment shown, or from the start; or stop playing. */
export function play() {
  if (playing.get()) {
    playing.set(false);
    return;
  }
  const end = preview.get()?.duration_s ?? 0;
  const from = moment.get();
  startedAt = performance.now() - 1000 * (from === null || from >= end ? 0 : from);
  playing.set(true);
  requestAnimationFrame(frame);
}

function frame() {
  if (!playing.get()) return;
  const end = preview.get()?.duration_s ?? 0;
  const time = (performance.now() - startedAt) / 1000;
  show(time);
  if (time >= end) playing.set(false);
  else requestAnimationFrame(frame);
}

/** The cut that a moment belongs to. @param {number} time @returns {PreviewedCut|undefined} */
export function cutAt(time) {
  const cuts = preview.get()?.cuts ?? [];
  return cuts.find((cut) => time < cut.ends_s) ?? cuts.at(-1);
}
