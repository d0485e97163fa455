// Placing a point by hand: a click in the 3-D view or the camera image goes to the nearest known cane.

import { ask, post } from "../link/api.js";
import { socket } from "../link/socket.js";
import { link, pageState, say, showToast } from "../state/page-state.js";
import { reasonText } from "../state/reasons.js";
import { signal } from "../state/signals.js";
import { text } from "../state/texts.js";
import { whyNothingOf } from "./allowed.js";
import { undoable } from "./decisions.js";
import { select } from "./selection.js";

/** Do clicks place points? */
export const placing = signal(false);

/** Why no point can be placed now. */
export function whyNoPlacing() {
  return whyNothingOf("perception");
}

/** @param {boolean} on */
export function setPlacing(on) {
  if (on === placing.get()) return;
  placing.set(on);
  socket.send({ type: "PlaceByHand", active: on });
}

/**
 * Request a point and report the outcome.
 *
 * @param {string} path
 * @param {object} body
 * @returns {Promise<string>} Its id; empty if refused.
 */
export async function placePoint(path, body) {
  const answer = await post(path, body);
  if (answer.ok) {
    const point = String(answer.why?.values.find(([name]) => name === "point")?.[1] ?? "");
    void undoable(Promise.resolve(true), () => text("undo.placing"), () => unplace(point), point);
    select(point);
    showToast("info", reasonText(answer.why));
    return point;
  }
  const words = text("placing.refused", { why: reasonText(answer.why) });
  if (answer.status === 409) showToast("warning", words);
  else say("error", words);
  return "";
}

/** A point is never forgotten: one that was placed by mistake is rejected. @param {string} point */
function unplace(point) {
  return ask(text("undo.placing"), `api/points/${encodeURIComponent(point)}/reject`, { reason: text("undo.placed_reason") });
}

/** Handle clicks in the 3-D view; stop placing without a link or permission. */
export function initPlacing() {
  socket.onpickray = ({ origin, direction }) => {
    if (placing.get()) void placePoint("api/points/by-hand", { origin, direction });
  };
  link.subscribe(({ status }) => {
    if (status !== "open") placing.set(false);
  });
  pageState.subscribe(() => {
    if (placing.get() && whyNoPlacing()) setPlacing(false);
  });
  window.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && placing.get()) setPlacing(false);
  });
}
