// The posture that the arm is to go to: chosen or typed, checked by the controller, shown as a ghost, reached while held.

import { post } from "../link/api.js";
import { socket } from "../link/socket.js";
import { pageState } from "../state/page-state.js";
import { reason } from "../state/reasons.js";
import { signal } from "../state/signals.js";
import { hold, moving, teleoperating } from "./teleoperation.js";

/** @typedef {import("../link/messages.js").ArmAngles} ArmAngles */
/** @typedef {import("../state/reasons.js").Reason} Reason */

/** θ_l and θ_r precede the arm's joints. */
const WHEELS = 2;
/** A posture is reached when every joint is this near to it (rad). */
const NEAR = 0.012;
/** Typing pauses this long before the controller is asked (ms). */
const PAUSE_MS = 250;

/**
 * Where the arm is to go, or a refused wish without angles. `why` is the reason of a refusal; null if it can go there.
 *
 * @type {import("../state/signals.js").Signal<{ name: string, angles: ArmAngles|null, why: Reason|null }|null>}
 */
export const goal = signal(/** @type {any} */ (null));
let asked = 0;
let timer = 0;

/** @returns {ArmAngles|null} The measured angles of the arm (rad). */
export function armAngles() {
  const all = pageState.get()?.joints?.position;
  return all ? /** @type {ArmAngles} */ (/** @type {unknown} */ (all.slice(WHEELS))) : null;
}

/**
 * Choose where the arm is to go. Nothing moves before it is held.
 *
 * @param {string} name For the button.
 * @param {ArmAngles} angles
 */
export function aim(name, angles) {
  hold.release("posture");
  goal.set({ name, angles, why: reason("posture_unchecked") });
  socket.send({ type: "ShowPosture", angles });
  asked += 1;
  const mine = asked;
  clearTimeout(timer);
  timer = window.setTimeout(async () => {
    const answer = await post("api/postures/check", { angles });
    if (mine === asked) goal.set({ name, angles, why: answer.ok ? null : (answer.why ?? reason("server_unreachable")) });
  }, PAUSE_MS);
}

/**
 * What was typed is no goal.
 *
 * @param {string} name
 * @param {Reason} why
 */
export function refuse(name, why) {
  forget();
  goal.set({ name, angles: null, why });
}

/** There is no goal any more. */
export function forget() {
  asked += 1;
  clearTimeout(timer);
  hold.release("posture");
  if (goal.get() === null) return;
  if (goal.get()?.angles) socket.send({ type: "ShowPosture", angles: null });
  goal.set(null);
}

/** Is the arm there? */
export function arrived() {
  const [at, to] = [armAngles(), goal.get()?.angles];
  return Boolean(at && to && to.every((angle, joint) => Math.abs(angle - (at[joint] ?? Infinity)) < NEAR));
}

/** Why the arm cannot go to the goal now. */
export function whyNoGoing() {
  const to = goal.get();
  return hold.whyNot() ?? (to ? to.why : reason("no_posture_chosen"));
}

/** Go there for as long as this is held. */
export function go() {
  const angles = goal.get()?.angles ?? null;
  return whyNoGoing() ?? hold.press("posture", () => (angles ? { posture: angles } : {}));
}

moving.subscribe(forget);
teleoperating.subscribe(() => !teleoperating.get() && forget());
