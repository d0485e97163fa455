// Driving the base by hand with keys, the pad on the page, or a gamepad.

import { showToast } from "../state/page-state.js";
import { reason, reasonText } from "../state/reasons.js";
import { signal } from "../state/signals.js";
import { isTyping } from "./stop.js";
import { hold, moving, teleoperating } from "./teleoperation.js";

/** Full speed (m/s, rad/s). */
const LINEAR = 0.4;
const ANGULAR = 0.6;
/** Sticks do not rest at exactly zero. */
const DEAD_ZONE = 0.15;
const POLL_MS = 50;
/** @type {Readonly<Record<string, readonly [ahead: number, left: number]>>} */
const KEYS = Object.freeze({
  KeyW: [1, 0],
  ArrowUp: [1, 0],
  KeyS: [-1, 0],
  ArrowDown: [-1, 0],
  KeyA: [0, 1],
  ArrowLeft: [0, 1],
  KeyD: [0, -1],
  ArrowRight: [0, -1],
});

/** Name of the gamepad in use; empty without one. */
export const gamepad = signal("");

/** @typedef {{ ahead: number, left: number }} DriveInput Fractions of full speed, −1…1. */

/** Why the base cannot be driven now. */
export function whyNoDriving() {
  return hold.whyNot() ?? (moving.get() === "base" ? null : reason("base_not_chosen"));
}

/**
 * Drive while `source` is held.
 *
 * @param {"drive"|"pad"|"gamepad"} source
 * @param {() => DriveInput} way
 */
export function drive(source, way) {
  const wanted = () => {
    const { ahead, left } = way();
    return { base: { linear: LINEAR * clamp(ahead), angular: ANGULAR * clamp(left) } };
  };
  return whyNoDriving() ?? hold.press(source, wanted);
}

/** @param {number} value */
function clamp(value) {
  return Math.max(-1, Math.min(1, value));
}

/** @type {Set<string>} */
const down = new Set();

/**
 * Drive with the keys of a window while the base is selected.
 *
 * @param {Window} target
 */
export function listenForDriveKeys(target) {
  target.addEventListener(
    "keydown",
    (event) => {
      if (!(event.code in KEYS) || event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
      const elsewhere = /** @type {Partial<Element>} */ (event.target).closest?.("input, select, rp-review");
      if (!teleoperating.get() || moving.get() !== "base" || elsewhere) return;
      // Keeps the 3-D camera and the page's scroll where they are.
      event.preventDefault();
      event.stopImmediatePropagation();
      if (event.repeat) return;
      const first = down.size === 0;
      down.add(event.code);
      const why = first ? drive("drive", () => sum([...down].map((code) => KEYS[code] ?? [0, 0]))) : null;
      if (why) showToast("warning", reasonText(why));
    },
    { capture: true },
  );
  target.addEventListener("keyup", (event) => {
    if (down.delete(event.code) && down.size === 0) hold.release("drive");
  });
  // After a loss of focus no keyup arrives.
  target.addEventListener("blur", () => {
    down.clear();
    hold.release("drive");
  });
}

/**
 * @param {(readonly [number, number])[]} ways
 * @returns {DriveInput}
 */
function sum(ways) {
  return { ahead: ways.reduce((all, [each]) => all + each, 0), left: ways.reduce((all, [, each]) => all + each, 0) };
}

/** Poll gamepads: sticks drive while a trigger is held. A trigger already held when the pad appears does not count. */
export function watchGamepad() {
  let index = -1;
  let held = true;
  const poll = () => {
    const pads = teleoperating.get() ? [...(navigator.getGamepads?.() ?? [])] : [];
    const pad = pads.find((each) => each?.connected && each.buttons.length > 7) ?? null;
    gamepad.set(pad?.id ?? "");
    const same = pad !== null && pad.index === index;
    index = pad?.index ?? -1;
    const pulled = pad !== null && [6, 7].some((button) => (pad.buttons[button]?.value ?? 0) > 0.5);
    const begins = same && pulled && !held;
    held = pulled;
    if (!same || !pulled || !document.hasFocus()) hold.release("gamepad");
    else if (begins) {
      const why = drive("gamepad", () => read(index));
      if (why) showToast("warning", reasonText(why));
    }
  };
  window.setInterval(poll, POLL_MS);
  window.addEventListener("gamepaddisconnected", poll);
}

/**
 * @param {number} index
 * @returns {DriveInput}
 */
function read(index) {
  const axes = navigator.getGamepads()[index]?.axes ?? [];
  const [left = 0, ahead = 0, right = 0] = axes.map((each) => (Math.abs(each) < DEAD_ZONE ? 0 : each));
  return { ahead: -ahead, left: -(left || right) };
}
