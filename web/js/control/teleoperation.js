// Teleoperation: what moves, the gizmo, and hold to move (a dead man's switch).

import { socket } from "../link/socket.js";
import { pageState, showToast } from "../state/page-state.js";
import { reason, reasonText } from "../state/reasons.js";
import { screen } from "../state/screens.js";
import { signal } from "../state/signals.js";
import { whyNoTeleoperation } from "./allowed.js";
import { isTyping } from "./stop.js";

/** @typedef {import("../state/reasons.js").Reason} Reason */
/** @typedef {"button"|"key"|"gizmo"|"drive"|"pad"|"gamepad"|"joint"|"arrow"|"posture"} HoldSource */
/**
 * @typedef {{ base?: import("../link/messages.js").BaseVelocity, joints?: import("../link/messages.js").ArmVelocities,
 *   along?: import("../link/messages.js").ToolVelocity, posture?: import("../link/messages.js").ArmAngles }} Wanted
 */

const PERIOD_MS = 50;
/** Sources that lead the tool to the gizmo and may be held together. Any other source has to be the only one. */
const TOOL = new Set(["button", "key", "gizmo"]);

class HoldToMove {
  /**
   * @param {(hold: import("../link/messages.js").Hold) => void} send
   * @param {() => Reason|null} whyNot Why holding is not possible now.
   */
  constructor(send, whyNot) {
    this.send = send;
    this.whyNot = whyNot;
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
   * Start holding. A refused press stays without effect, so that the robot never starts moving later.
   *
   * @param {HoldSource} source
   * @param {() => Wanted} [wanted] The motion; by default the tool follows the gizmo.
   * @returns {Reason|null} Why it was refused; null if accepted.
   */
  press(source, wanted = () => ({})) {
    const why = this.whyNot();
    if (why) return why;
    if (this.sources.size > 0 && [...this.sources, source].some((each) => !TOOL.has(each))) {
      this.releaseAll();
      return reason("two_holds");
    }
    this.sources.add(source);
    this.wanted = wanted;
    if (this.holding.get()) return null;
    this.holding.set(true);
    this.tell(true);
    this.timer = window.setInterval(() => this.turn(), PERIOD_MS);
    return null;
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
    const { base = null, joints = null, along = null, posture = null } = hold ? this.wanted() : {};
    const speed_scale = this.speedScale.get();
    this.send({ type: "Hold", sequence: this.sequence, hold, base, joints, along, posture, speed_scale });
  }
}

export const PARTS = Object.freeze(/** @type {const} */ (["tool", "base", "joints", "postures"]));
/** @typedef {(typeof PARTS)[number]} Part */

export const teleoperating = signal(false);
export const moving = signal(/** @type {Part} */ ("tool"));
/** Frame of the gizmo's arrows. */
export const axes = signal(/** @type {import("../link/messages.js").GizmoAxes} */ ("tool"));

export const hold = new HoldToMove(
  (message) => socket.send(message),
  () => whyNoTeleoperation() ?? (teleoperating.get() ? null : reason("teleoperation_off")),
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

/** Release whenever a hold can no longer be deliberate. */
export function initTeleoperation() {
  socket.onclose = () => {
    hold.releaseAll();
    teleoperating.set(false);
  };
  // A hold that the server ended needs a new press.
  socket.onholdended = (reason) => {
    if (!hold.holding.get()) return;
    hold.releaseAll();
    showToast("warning", reasonText(reason));
  };
  // After a mode without teleoperation the switch has to be pressed again. A process that is silent for a moment ends the
  // hold, and that is enough.
  pageState.subscribe(() => {
    const why = teleoperating.get() ? whyNoTeleoperation() : null;
    if (why && why.code !== "process_silent") setTeleoperating(false);
  });
  // No other screen shows what moves.
  screen.subscribe((name) => {
    if (name !== "drive") setTeleoperating(false);
  });
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) hold.releaseAll();
  });
  window.addEventListener("pagehide", () => hold.releaseAll());
  window.addEventListener("blur", () => {
    for (const source of /** @type {const} */ (["button", "key", "joint", "arrow", "posture"])) hold.release(source);
  });
  listenForHoldKey(window);
}

/**
 * The H key of a window holds.
 *
 * @param {Window} target
 */
export function listenForHoldKey(target) {
  target.addEventListener("keydown", (event) => {
    if (event.code !== "KeyH" || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
    if (isTyping(event.target) || moving.get() !== "tool") return;
    const why = hold.press("key");
    if (why && teleoperating.get()) showToast("warning", reasonText(why));
  });
  target.addEventListener("keyup", (event) => {
    if (event.code === "KeyH") hold.release("key");
  });
}

/**
 * Dragging in the 3-D view holds while the pointer is down, once the view is drawn.
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
  // A release outside the window is not reported; the next move shows it.
  view.addEventListener("pointermove", (event) => event.buttons === 0 && release(), options);
  view.addEventListener("blur", () => {
    hold.release("gizmo");
    hold.release("key");
  });
}
