// The preview: request, playback, approval.

import { ask } from "../link/api.js";
import { socket } from "../link/socket.js";
import { preview } from "../state/page-state.js";
import { openScreen, screen } from "../state/screens.js";
import { text } from "../state/texts.js";
import { signal } from "../state/signals.js";
import { whyNot, whyNothing } from "./allowed.js";
import { reason } from "../state/reasons.js";

/** @typedef {import("../link/messages.js").PreviewedCut} PreviewedCut */

/** Rate limit of moments sent to the view (ms). */
const TELL_MS = 66;

/** Moment of the playback (s); null while the ghost is hidden. */
export const moment = signal(/** @type {number|null} */ (null));
export const playing = signal(false);
/** Does the preview lie over the view? */
export const previewOpen = signal(false);
let startedAt = 0;
let toldAt = 0;

export function hasPreview() {
  return preview.get()?.preview_hash ? true : false;
}

/** Why no preview can be requested. */
export function whyNoPreview() {
  return whyNot("RequestPreview");
}

/** Why the preview cannot be approved. */
export function whyNoApproval() {
  const state = preview.get();
  if (!state || !hasPreview()) return whyNothing() ?? reason("preview_missing");
  if (state.phase === "approved") return reason("preview_approved_already", { user: state.approved_by });
  if (state.phase === "expired" && state.reason) return reason("preview_expired", { cause: state.reason });
  return whyNot("ApprovePreview");
}

/** @param {string} pointId Empty for all of the work. */
export function askPreview(pointId) {
  hidePreview();
  return ask(text("preview.all"), "api/preview", { point_id: pointId });
}

export function approvePreview() {
  return ask(text("preview.approving"), "api/preview/approve", { preview_hash: preview.get()?.preview_hash ?? "" });
}

/** Lay the preview over the large view, and ask for one where there is none. */
export function openPreview() {
  if (screen.get() !== "drive") openScreen("work");
  previewOpen.set(true);
  if (!hasPreview() && !whyNoPreview()) void askPreview("");
}

export function closePreview() {
  hidePreview();
  previewOpen.set(false);
}

/** @param {boolean} required */
export function requirePreview(required) {
  return ask(text("preview.required"), "api/preview/required", { required });
}

/** Show a moment in the 3-D view. @param {number} time */
export function showMoment(time) {
  const end = preview.get()?.duration_s ?? 0;
  moment.set(Math.max(0, Math.min(time, end)));
  const at = performance.now();
  if (at - toldAt < TELL_MS && time < end) return;
  toldAt = at;
  socket.send({ type: "ShowPreview", time: moment.get() });
}

export function hidePreview() {
  playing.set(false);
  if (moment.get() === null) return;
  moment.set(null);
  socket.send({ type: "ShowPreview", time: null });
}

/** Play on from the moment shown, or stop. */
export function togglePlayback() {
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
  showMoment(time);
  if (time >= end) playing.set(false);
  else requestAnimationFrame(frame);
}

/** The cut at a moment. @param {number} time @returns {PreviewedCut|undefined} */
export function cutAt(time) {
  const cuts = preview.get()?.cuts ?? [];
  return cuts.find((cut) => time < cut.ends_s) ?? cuts.at(-1);
}
