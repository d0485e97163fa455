// The selected point: list, picture and 3-D view show the same one.

import { socket } from "../link/socket.js";
import { revealCount, selected } from "../state/page-state.js";

/** When somebody has last chosen, or looked for something, himself (ms). */
let lookedAt = -Infinity;
/** When the last choice was told (ms). */
let toldAt = -Infinity;
/** A press that gives a row the focus and chooses it is one choice (ms). */
const ONE_PRESS_MS = 400;

/** Somebody looks for himself. */
export function noteInteraction() {
  lookedAt = performance.now();
}

export function lastInteraction() {
  return lookedAt;
}

/**
 * Somebody chooses a point: list, picture and 3-D view go there.
 *
 * @param {string} pointId Empty = none.
 */
export function select(pointId) {
  noteInteraction();
  if (pointId !== selected.get()) tell(pointId);
}

/**
 * The same by a press, which brings them there again where the point is chosen already.
 *
 * @param {string} pointId
 */
export function selectAndReveal(pointId) {
  noteInteraction();
  if (pointId !== selected.get() || performance.now() - toldAt > ONE_PRESS_MS) tell(pointId);
}

/**
 * Nobody has chosen: the robot is at this point.
 *
 * @param {string} pointId
 */
export function followPoint(pointId) {
  selected.set(pointId);
  socket.send({ type: "Select", point_id: pointId, follow: true });
}

socket.onselected = (/** @type {string} */ pointId) => {
  noteInteraction();
  show(pointId);
};

/** @param {string} pointId */
function tell(pointId) {
  toldAt = performance.now();
  show(pointId);
  socket.send({ type: "Select", point_id: pointId });
}

/** @param {string} pointId */
function show(pointId) {
  if (pointId === selected.get()) revealCount.set(revealCount.get() + 1);
  else selected.set(pointId);
}
