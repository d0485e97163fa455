// The order of work: its points, who set it, and changing it.

import { ask } from "../link/api.js";
import { decimal, durationWords } from "../state/format.js";
import { pageState, points } from "../state/page-state.js";
import { pointNames } from "../state/point-names.js";
import { counted, text } from "../state/texts.js";
import { countOf, whyNot, whyNotPoint } from "./allowed.js";
import { nameOf, undoable } from "./decisions.js";
import { timeLeft } from "./progress.js";

/** @typedef {import("../link/messages.js").PagePoint} PagePoint */
/** @typedef {import("../link/messages.js").PointPlan} PointPlan */

/** Accepted points in the order of work. @returns {PagePoint[]} */
export function workOrder() {
  return (points.get()?.points ?? []).filter((row) => row.entry.state === "ACCEPTED");
}

/** Who set the order; empty for the plan's. */
function orderedBy() {
  return pageState.get()?.controller?.order.user ?? "";
}

/** Summary: number of points, who set the order, duration. */
export function orderWords() {
  const rows = workOrder();
  const beyond = countOf("UNREACHABLE");
  const more = beyond > 0 ? ` · ${counted("work.beyond", beyond)}` : "";
  if (rows.length === 0) return text(beyond > 0 ? "order.none_left" : "order.none_accepted") + more;
  const seconds = timeLeft();
  const long = seconds ? `, ${durationWords(seconds)}` : "";
  const whose = orderedBy() ? text("order.by", { user: orderedBy() }) : text("order.by_plan");
  return `${counted("order.points", rows.length)}, ${whose}${long}${more}`;
}

/** Time that a planned cut takes; empty until it is rolled out. @param {PointPlan} plan */
export function cutTime({ rollout }) {
  return rollout ? `${decimal(rollout.ends_s - rollout.begins_s, 1)} s` : "";
}

/** Why the order cannot be changed. */
export function whyNoMove() {
  return whyNot("MoveInQueue");
}

/** Why the order cannot be reset to the plan's. */
export function whyNoResetOrder() {
  return whyNot("ResetOrder");
}

/**
 * Move a point to index `to`.
 *
 * @param {string} pointId
 * @param {number} to
 */
export async function moveTo(pointId, to) {
  const rest = workOrder().filter((row) => row.point.point_id !== pointId);
  const before = rest[to]?.point.point_id ?? "";
  const revision = pageState.get()?.controller?.order.revision ?? 0;
  return ask(text("decision.moving", { point: pointNames(pointId) }), `api/points/${encodeURIComponent(pointId)}/work-before`, { before, revision });
}

export async function resetOrder() {
  const revision = pageState.get()?.controller?.order.revision ?? 0;
  return ask(text("order.reset"), "api/order/planners", { revision });
}

/**
 * Why the approach to a point cannot be turned.
 *
 * @param {PagePoint} row
 */
export function whyNotTurn(row) {
  return whyNotPoint("SetApproach", row) ?? whyNot("SetApproach");
}

/**
 * @param {PagePoint} row
 * @param {number|null} azimuth About the cane (rad); null leaves it to the search.
 */
export function turnApproach(row, azimuth) {
  const name = row.point.point_id;
  const turn = (/** @type {number|null} */ to) =>
    ask(text("order.turning", { point: nameOf(row) }), `api/points/${encodeURIComponent(name)}/approach`, { azimuth: to });
  return undoable(turn(azimuth), () => text("undo.turning", { point: nameOf(row) }), () => turn(row.entry.azimuth), name);
}
