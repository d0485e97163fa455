// Moving the robot by hand: what moves, whether the gizmo is shown, and who holds.

import { whyNoTeleoperation } from "./allowed.js";
import { HoldToMove } from "./hold.js";
import { Link } from "./socket.js";
import { brought, pageState, selected, showToast } from "./state.js";
import { signal } from "./store.js";
import { isTyping } from "./stop.js";

// Beside the page: with several robots each has a page and a socket of its own.
export const socket = new Link(new URL("ws", location.href.replace(/^http/, "ws")).href);

/** @typedef {"tool"|"base"|"joints"} Part */

/** Is the robot moved by hand? */
export const teleoperating = signal(false);
/** What of it. */
export const moving = signal(/** @type {Part} */ ("tool"));
/** Along what the gizmo's arrows lie. */
export const axes = signal(/** @type {import("./messages.js").GizmoAxes} */ ("tool"));

export const hold = new HoldToMove(
  (message) => socket.send(message),
  () => whyNoTeleoperation() || (teleoperating.get() ? "" : "Switch on Teleoperate first"),
);

/** @param {boolean} on */
export function setTeleoperating(on) {
  if (on === teleoperating.get()) return;
  if (!on) hold.releaseAll();
  teleoperating.set(on);
  showGizmo();
}

function showGizmo() {
  socket.send({ type: "ShowGizmo", visible: teleoperating.get() && moving.get() === "tool", axes: axes.get() });
}

/** @param {Part} part */
export function showMoving(part) {
  if (part === moving.get()) return;
  hold.releaseAll();
  moving.set(part);
  showGizmo();
}

/** @param {import("./messages.js").GizmoAxes} along */
export function showAxes(along) {
  hold.releaseAll();
  axes.set(along);
  showGizmo();
}

/** When somebody has last chosen, or looked for something, himself (ms). */
let lookedAt = -Infinity;
/** When the last choice was told (ms). */
let toldAt = -Infinity;
/** A press that gives a row the focus and chooses it is one choice (ms). */
const ONE_PRESS_MS = 400;

/** Somebody looks for himself. */
export function touched() {
  lookedAt = performance.now();
}

export function touchedAt() {
  return lookedAt;
}

/**
 * Somebody chooses a point: list, picture and 3-D view are brought there.
 *
 * @param {string} pointId Empty = none.
 */
export function select(pointId) {
  touched();
  if (pointId !== selected.get()) tell(pointId);
}

/**
 * The same by a press, which brings them there again where the point is chosen already.
 *
 * @param {string} pointId
 */
export function bring(pointId) {
  touched();
  if (pointId !== selected.get() || performance.now() - toldAt > ONE_PRESS_MS) tell(pointId);
}

/**
 * Nobody has chosen: the robot is at this point.
 *
 * @param {string} pointId
 */
export function goAlong(pointId) {
  selected.set(pointId);
  socket.send({ type: "Select", point_id: pointId, follow: true });
}

socket.onselected = (/** @type {string} */ pointId) => {
  touched();
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
  if (pointId === selected.get()) brought.set(brought.get() + 1);
  else selected.set(pointId);
}

/** Let go whenever the operator can no longer be holding on purpose. */
export function guardHold() {
  socket.onclose = () => {
    hold.releaseAll();
    teleoperating.set(false);
  };
  // Whoever still holds must press again: the tool never sets out by itself once it has been stopped.
  socket.onholdended = (reason) => {
    if (!hold.holding.get()) return;
    hold.releaseAll();
    showToast("warning", reason);
  };
  // The robot has left the modes in which a hand may move it: start over from the switch, not from a held button.
  pageState.subscribe(() => {
    if (teleoperating.get() && whyNoTeleoperation()) setTeleoperating(false);
  });
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) hold.releaseAll();
  });
  window.addEventListener("pagehide", () => hold.releaseAll());
  window.addEventListener("blur", () => {
    hold.release("button");
    hold.release("key");
    hold.release("joint");
  });
  listenForHoldKey(window);
}

/**
 * Hold with the H key of a window.
 *
 * @param {Window} target
 */
export function listenForHoldKey(target) {
  target.addEventListener("keydown", (event) => {
    if (event.code !== "KeyH" || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
    if (isTyping(event.target) || moving.get() !== "tool") return;
    const why = hold.press("key");
    if (why && teleoperating.get()) showToast("warning", why);
  });
  target.addEventListener("keyup", (event) => {
    if (event.code === "KeyH") hold.release("key");
  });
}

/**
 * Dragging in the 3-D view counts as holding for as long as the pointer is down there, once there is something to see.
 *
 * @param {Window} view
 */
export function listenForDrag(view) {
  const release = () => hold.release("gizmo");
  const options = { capture: true };
  view.addEventListener(
    "pointerdown",
    (event) => {
      if (view.document.documentElement.dataset.view === "loading" || !event.isPrimary || event.button !== 0) return;
      if (teleoperating.get() && moving.get() === "tool") hold.press("gizmo");
    },
    options,
  );
  view.addEventListener("pointerup", release, options);
  view.addEventListener("pointercancel", release, options);
  // A release outside the window is never reported; the next move tells.
  view.addEventListener("pointermove", (event) => event.buttons === 0 && release(), options);
  view.addEventListener("blur", () => {
    hold.release("gizmo");
    hold.release("key");
  });
}
