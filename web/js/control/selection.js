// Selecting a point: list, camera image and 3-D view show the same one.

import { socket } from "../link/socket.js";
import { revealCount, selected } from "../state/page-state.js";

/** Time of the operator's last interaction (ms). */
let interactedAt = -Infinity;
/** Time of the last selection sent (ms). */
let sentAt = -Infinity;
/** Did the page select the newest point by itself? */
let followed = false;
/** A press both focuses a row and clicks it: within this time it is one selection (ms). */
const ONE_PRESS_MS = 400;

export function noteInteraction() {
  interactedAt = performance.now();
}

export function lastInteraction() {
  return interactedAt;
}

/**
 * The operator selects a point.
 *
 * @param {string} pointId Empty = none.
 */
export function select(pointId) {
  noteInteraction();
  if (pointId !== selected.get()) send(pointId);
}

/**
 * The operator presses a point. Pressing the selected one again reveals it again.
 *
 * @param {string} pointId
 */
export function selectAndReveal(pointId) {
  noteInteraction();
  if (pointId !== selected.get() || performance.now() - sentAt > ONE_PRESS_MS) send(pointId);
}

/**
 * Select the point that the robot is at; counts as no interaction.
 *
 * @param {string} pointId
 */
export function followPoint(pointId) {
  followed = true;
  selected.set(pointId);
  socket.send({ type: "Select", point_id: pointId, follow: true });
}

socket.onselected = (/** @type {string} */ pointId) => {
  noteInteraction();
  show(pointId);
};

/** @param {string} pointId */
function send(pointId) {
  sentAt = performance.now();
  show(pointId);
  socket.send({ type: "Select", point_id: pointId });
}

/** Was the newest point selected by `followPoint`? */
export function isFollowed() {
  return followed;
}

/** @param {string} pointId */
function show(pointId) {
  followed = false;
  if (pointId === selected.get()) revealCount.set(revealCount.get() + 1);
  else selected.set(pointId);
}
