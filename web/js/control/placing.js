// Points that a person places: a click into the 3-D view or into the camera's image, put on the nearest known cane.

import { post } from "../link/api.js";
import { socket } from "../link/socket.js";
import { isLive, link, pageState, say, showToast } from "../state/page-state.js";
import { signal } from "../state/signals.js";
import { whyNothing } from "./allowed.js";
import { select } from "./selection.js";

/** Are clicks meant for new points? */
export const placing = signal(false);

/** Why no point can be placed now; empty when one can. */
export function whyNoPlacing() {
  return whyNothing() || (isLive("perception") ? "" : "Perception is not there");
}

/** @param {boolean} on */
export function setPlacing(on) {
  if (on === placing.get()) return;
  placing.set(on);
  socket.send({ type: "PlaceByHand", active: on });
}

/**
 * Ask for a point, and tell what came of it.
 *
 * @param {string} path
 * @param {object} body
 * @returns {Promise<string>} Its name, empty when there is none.
 */
export async function placePoint(path, body) {
  const answer = await post(path, body);
  if (answer.ok) {
    select(answer.reason);
    showToast("info", `${answer.reason} is placed: look at it in the queue.`);
    return answer.reason;
  }
  const words = `No point placed: ${answer.reason}`;
  if (answer.status === 409) showToast("warning", words);
  else say("error", words);
  return "";
}

/** Listen for clicks into the 3-D view, and stop placing when the link goes or nobody may place any more. */
export function initPlacing() {
  socket.onsightline = ({ origin, direction }) => {
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
