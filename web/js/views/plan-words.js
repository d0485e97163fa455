// Where the robot stands for a cut, and what the plan says of it, in words.

import { cutTime } from "../control/order.js";
import { decimal } from "../state/format.js";
import { labelOf, text } from "../state/texts.js";

/** @typedef {import("../link/messages.js").PagePoint} PagePoint */

/** Where the robot stands at the cut; empty without a plan. @param {PagePoint} row */
export function robotWords({ point, plan }) {
  const base = plan?.base;
  if (!base) return "";
  const [dx, dy] = [point.position[0] - base.x, point.position[1] - base.y];
  const left = -Math.sin(base.phi) * dx + Math.cos(base.phi) * dy;
  const ahead = Math.cos(base.phi) * dx + Math.sin(base.phi) * dy;
  return text(`plan.stands.${left > 0 ? "left" : "right"}.${ahead >= 0 ? "ahead" : "behind"}`, {
    aside: decimal(Math.abs(left), 1),
    ahead: decimal(Math.abs(ahead), 1),
  });
}

/** Order, time and room of a planned cut; empty without a plan. @param {PagePoint} row */
export function planWords({ plan }) {
  if (!plan?.order) return "";
  const shown = plan.rollout;
  if (!shown) return text("plan.order", { order: plan.order });
  const [one, other] = shown.between;
  return text("plan.cut", {
    order: plan.order,
    time: cutTime(plan),
    clearance: Math.round(1000 * shown.clearance),
    one: labelOf(one),
    other: labelOf(other),
  });
}
