// Decisions about points: accept, reject, resolve, move; each with its undo.

import { ask } from "../link/api.js";
import { SURE } from "../link/messages.js";
import { points, say } from "../state/page-state.js";
import { pointNames } from "../state/point-names.js";
import { signal } from "../state/signals.js";
import { text } from "../state/texts.js";
import { whyNot, whyNotPoint, whyNothingOf } from "./allowed.js";
import { reason, saidText } from "../state/reasons.js";

/** @typedef {import("../link/messages.js").PagePoint} PagePoint */
/** @typedef {import("../link/messages.js").PointState} PointState */
/**
 * `about` is the key of the point or place that it was about; empty for several.
 *
 * @typedef {{ words: () => string, undo: () => Promise<boolean>, about: string }} Decision
 */

/** From the order to cut on, what was decided of a point before stands. @type {readonly PointState[]} */
const CUT = ["CUTTING", "DONE", "FAILED_NOT_CUT", "UNKNOWN"];
/** Depth of the undo stack. */
const MOST = 100;

/** Undo stack of this page, oldest first. @type {import("../state/signals.js").Signal<readonly Decision[]>} */
export const decisions = signal(/** @type {readonly Decision[]} */ ([]));

/**
 * The outcome of such a cut is known only by looking; Accept and Reject then answer "cut" and "not cut".
 *
 * @param {PagePoint} row
 */
export function isUnknown(row) {
  return row.entry.state === "UNKNOWN";
}

/**
 * Accepted, reachable or not.
 *
 * @param {PagePoint|undefined} row
 */
export function isAccepted(row) {
  return row?.entry.state === "ACCEPTED" || row?.entry.state === "UNREACHABLE";
}

/** @param {PagePoint} row */
export function whyNotAccept(row) {
  if (isUnknown(row)) return whyNot("ResolvePoint");
  return whyNotPoint("AcceptPoint", row) ?? whyNot("AcceptPoint");
}

/** @param {PagePoint} row */
export function whyNotReject(row) {
  if (isUnknown(row)) return whyNot("ResolvePoint");
  return whyNotPoint("RejectPoint", row) ?? whyNot("RejectPoint");
}

/** @param {PagePoint} row */
export function accept(row) {
  if (isUnknown(row)) return resolve(row, "DONE", "seen by eye");
  return undoable(sendAcceptance(row), () => text("undo.accepting", { point: nameOf(row) }), () => restore(row), row.point.point_id);
}

/**
 * @param {PagePoint} row
 * @param {string} reason
 */
export function reject(row, reason) {
  if (isUnknown(row)) return resolve(row, "FAILED_NOT_CUT", reason || "seen by eye");
  const sent = send(row, "rejecting", "reject", { reason });
  return undoable(sent, () => text("undo.rejecting", { point: nameOf(row) }), () => restore(row), row.point.point_id);
}

/**
 * Say why a point was left, after it was.
 *
 * @param {PagePoint} row
 * @param {string} reason
 */
export function explain(row, reason) {
  return send(row, "rejecting", "reject", { reason });
}

/** What a person calls a point. @param {PagePoint} row */
export function nameOf({ point }) {
  return text("point.name", { vine: point.vine, spur: point.spur });
}

/**
 * A cut's place, and its kind where its spur has several.
 *
 * @param {string} place
 * @param {PagePoint} row
 */
export function placeOfCut(place, { point }) {
  const isOfSpur = (/** @type {PagePoint} */ { point: { point_id, vine, spur }, entry }) =>
    vine === point.vine && spur === point.spur && point_id !== point.point_id && entry.state !== "REJECTED";
  return points.get()?.points.some(isOfSpur) ? `${place} · ${text(`details.kind.${point.kind}`)}` : place;
}

/**
 * A proposal below the confidence for accepting it with others at once.
 *
 * @param {PagePoint} row
 */
export function isUncertain(row) {
  return row.entry.state === "PROPOSED" && row.point.confidence < SURE;
}

/**
 * Accept a point as it was shown: the controller refuses another one.
 *
 * @param {PagePoint} row
 */
export function sendAcceptance(row) {
  return send(row, "accepting", "accept", { revision: row.point.revision, digest: row.point.digest });
}

/** Have a point proposed again. @param {PagePoint} row */
export function reconsider(row) {
  return send(row, "reconsidering", "reconsider", {});
}

/**
 * Why a point cannot be moved now. An accepted point keeps its content.
 *
 * @param {PagePoint} row
 */
export function whyNotMove(row) {
  if (isAccepted(row)) return reason("acceptance_stands", { point: row.point.point_id });
  if (row.point.kind === "renewal cut") return reason("renewal_cut_fixed");
  if (row.point.kind === "removal") return reason("removal_fixed");
  return whyNotPoint("MovePoint", row) ?? whyNothingOf("perception");
}

/**
 * @param {PagePoint} row
 * @param {number} millimetres Along the cane, away from the cordon.
 */
export function move(row, millimetres) {
  const sent = send(row, "moving", "move", { along: millimetres / 1000 });
  const words = () => text("undo.moving", { point: nameOf(row), distance: millimetres });
  return undoable(sent, words, () => send(row, "moving_back", "move", { along: -millimetres / 1000 }), row.point.point_id);
}

/**
 * Call a finished cut wrong, or right after all.
 *
 * @param {string} point
 * @param {boolean} wrong
 */
export function judge(point, wrong) {
  const what = text(wrong ? "decision.calling_wrong" : "decision.calling_right", { point: pointNames(point) });
  return ask(what, `api/points/${encodeURIComponent(point)}/judge`, { wrong });
}

/** The last decision that can be undone; undefined without one. */
export function lastDecision() {
  const cut = points.get()?.points.filter(({ entry }) => CUT.includes(entry.state)) ?? [];
  const cutNames = new Set(cut.map(({ point }) => point.point_id));
  return decisions.get().filter(({ about }) => !cutNames.has(about)).at(-1);
}

/** Undo the last decision. */
export async function undo() {
  const last = lastDecision();
  if (!last) return;
  decisions.set(decisions.get().filter((each) => each !== last));
  if (await last.undo()) say("info", text("undo.done", { words: last.words() }));
}

/** Why there is nothing to undo. */
export function whyNoUndo() {
  return lastDecision() ? whyNot("ReconsiderPoint") : reason("nothing_decided");
}

/**
 * Note a decision while it is sent. An undo before the answer waits for it, so that it takes back this decision and none
 * before it. A refused one is forgotten.
 *
 * @param {Promise<boolean>} sent Was it done?
 * @param {() => string} words
 * @param {() => Promise<boolean>} back
 * @param {string} [about] Key of the one point or place that it is about.
 */
export async function undoable(sent, words, back, about = "") {
  const decision = { words, undo: async () => (await sent) && back(), about };
  decisions.set([...decisions.get(), decision].slice(-MOST));
  const done = await sent;
  if (!done) decisions.set(decisions.get().filter((each) => each !== decision));
  return done;
}

/**
 * Restore the former state: proposed, accepted with the former content, or rejected with the former reason.
 *
 * @param {PagePoint} before
 */
async function restore(before) {
  const { state, reason } = before.entry;
  if (isAccepted(before)) return sendAcceptance(before);
  if (state === "REJECTED") return send(before, "rejecting", "reject", { reason: saidText(reason) });
  return reconsider(before);
}

/**
 * @param {PagePoint} row
 * @param {"DONE"|"FAILED_NOT_CUT"} outcome
 * @param {string} reason
 */
function resolve(row, outcome, reason) {
  return send(row, "resolving", "resolve", { outcome, reason });
}

/**
 * @param {PagePoint} row
 * @param {string} what Of its words, `decision.WHAT`.
 * @param {string} action
 * @param {object} body
 */
function send(row, what, action, body) {
  return ask(text(`decision.${what}`, { point: nameOf(row) }), `api/points/${encodeURIComponent(row.point.point_id)}/${action}`, body);
}

