// Moving the robot by hand: what moves, whether the gizmo is shown, and holding to move.

import { socket } from "../link/socket.js";
import { pageState, showToast } from "../state/page-state.js";
import { signal } from "../state/signals.js";
import { whyNoTeleoperation } from "./allowed.js";
import { isTyping } from "./stop.js";

/** @typedef {"button"|"key"|"gizmo"|"drive"|"pad"|"gamepad"|"joint"} HoldSource */
/** @typedef {{ base?: import("../link/messages.js").BaseVelocity, joints?: import("../link/messages.js").ArmVelocities }} Wanted */

const PERIOD_MS = 50;
/** What leads the tool to its gizmo. Any other source moves the robot in its own way, and alone. */
const TOOL = new Set(["button", "key", "gizmo"]);
const TWO_AT_ONCE = "Two at once: it stopped. Let go, then hold one of them";

class HoldToMove {
  /**
   * @param {(hold: import("../link/messages.js").Hold) => void} send
   * @param {() => string} whyNot Why holding is not possible now; empty when it is.
   */
  constructor(send, whyNot) {
    this.send = send;
    this.whyNot = whyNot;
    /** Is somebody holding now? */
    this.holding = signal(false);
    /** Speed by hand as a factor of the usual speed. */
    this.speedScale = signal(1);
    /** @type {Set<HoldSource>} */
    this.sources = new Set();
    /** @type {() => Wanted} */
    this.wanted = () => ({});
    this.sequence = 0;
    this.timer = 0;
  }

  /**
   * Somebody begins to hold. Where holding is not possible this does nothing, so that a hold that began too early never
   * starts to move the robot later.
   *
   * @param {HoldSource} source
   * @param {() => Wanted} [wanted] What the base or the joints shall do; without it the tool follows the gizmo.
   * @returns {string} Why it was refused; empty when it was taken.
   */
  press(source, wanted = () => ({})) {
    const why = this.whyNot();
    if (why) return why;
    if (this.sources.size > 0 && [...this.sources, source].some((each) => !TOOL.has(each))) {
      this.releaseAll();
      return TWO_AT_ONCE;
    }
    this.sources.add(source);
    this.wanted = wanted;
    if (this.holding.get()) return "";
    this.holding.set(true);
    this.tell(true);
    this.timer = window.setInterval(() => this.turn(), PERIOD_MS);
    return "";
  }

  /** @param {HoldSource} source */
  release(source) {
    if (this.sources.delete(source) && this.sources.size === 0) this.end();
  }

  releaseAll() {
    this.sources.clear();
    this.end();
  }

  turn() {
    if (this.whyNot()) this.releaseAll();
    else this.tell(true);
  }

  end() {
    if (!this.holding.get()) return;
    clearInterval(this.timer);
    this.tell(false);
    this.holding.set(false);
  }

  /** @param {boolean} hold */
  tell(hold) {
    this.sequence += 1;
    const { base = null, joints = null } = hold ? this.wanted() : {};
    this.send({ type: "Hold", sequence: this.sequence, hold, base, joints, share: this.speedScale.get() });
  }
}

/** @typedef {"tool"|"base"|"joints"} Part */

/** Is the robot moved by hand? */
export const teleoperating = signal(false);
/** What of it. */
export const moving = signal(/** @type {Part} */ ("tool"));
/** Along what the gizmo's arrows lie. */
export const axes = signal(/** @type {import("../link/messages.js").GizmoAxes} */ ("tool"));

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

/** @param {import("../link/messages.js").GizmoAxes} along */
export function showAxes(along) {
  hold.releaseAll();
  axes.set(along);
  showGizmo();
}

/** Let go whenever the operator can no longer be holding on purpose. */
export function initTeleoperation() {
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
