// The sequence in which a person decides: the points and the undecided places along the row, one at a time.

import { ask } from "../link/api.js";
import { points, selected } from "../state/page-state.js";
import { statusOf } from "../state/point-status.js";
import { signal } from "../state/signals.js";
import { counted, text } from "../state/texts.js";
import { isAccepted, isUncertain, reconsider, sendAcceptance, undoable } from "./decisions.js";
import { isFollowed, selectAndReveal } from "./selection.js";

/** @typedef {import("../link/messages.js").PagePoint} PagePoint */
/** @typedef {import("../link/messages.js").UndecidedSite} UndecidedSite */
/** @typedef {import("../state/point-status.js").Status} Status */
/**
 * A point, or a place without one with all that is undecided there.
 *
 * @typedef {{ key: string, vine: number, spur: number, status: Status, row: PagePoint|null, sites: readonly UndecidedSite[] }} Item
 */

/** A decision that was sent counts as made for this time, until the robot tells (ms). */
const SENT_MS = 4000;

/** The item that is looked at; empty before the first. */
export const current = signal("");
/** Grows with every change of what is decided here and not yet told by the robot. */
export const changes = signal(0);
/** Decisions under way, by key: when they were sent, and about which state. @type {Map<string, { at: number, state: string }>} */
const sent = new Map();

/** @param {PagePoint} row */
export function keyOfPoint(row) {
  return row.point.point_id;
}

/** @type {readonly Item[]} */
let built = [];
/** @type {unknown} */
let builtFrom = null;

/** All points and places, in the order of the row. @returns {readonly Item[]} */
export function items() {
  const page = points.get();
  if (page === builtFrom) return built;
  builtFrom = page;
  built = [...(page?.points ?? []).map(ofPoint), ...places(page?.undecided_sites ?? [])].sort(
    (a, b) => a.vine - b.vine || a.spur - b.spur || Number(a.row === null) - Number(b.row === null),
  );
  return built;
}

/**
 * @param {PagePoint} row
 * @returns {Item}
 */
function ofPoint(row) {
  const { vine, spur } = row.point;
  return { key: keyOfPoint(row), vine, spur, status: statusOf(row.entry.state), row, sites: [] };
}

/**
 * @param {readonly UndecidedSite[]} sites Those of no spur in particular are none to decide about.
 * @returns {Item[]}
 */
function places(sites) {
  /** @type {Map<string, UndecidedSite[]>} */
  const bySpur = new Map();
  for (const site of sites) {
    if (site.vine === 0) continue;
    const key = `place-${site.vine}-${site.spur}`;
    bySpur.set(key, [...(bySpur.get(key) ?? []), site]);
  }
  return [...bySpur].map(([key, all]) => {
    const { vine, spur } = /** @type {UndecidedSite} */ (all[0]);
    const status = all.every((site) => site.needs === "nothing") ? "left" : "decide";
    return { key, vine, spur, status, row: null, sites: all };
  });
}

/** @param {string} key */
export function itemOf(key) {
  return items().find((item) => item.key === key);
}

/** Does a person have to decide about it? @param {Item} item */
export function isOpen(item) {
  if (isSent(item.key)) return false;
  return item.status === "proposed" || item.status === "decide";
}

/** Places that another look of the camera may settle come last. @param {Item} item */
function canWait(item) {
  return item.sites.length > 0 && item.sites.every((site) => site.needs !== "operator");
}

/**
 * Items to decide after one of them, the next first; those before it follow, as on a round.
 *
 * @param {Pick<Item, "key"|"vine"|"spur">|undefined} after
 * @returns {Item[]}
 */
export function openAfter(after) {
  const all = items();
  const at = all.findIndex((item) => item.key === after?.key);
  // One that has vanished: after its place along the row.
  const passed = all.filter((item) => after && (item.vine < after.vine || (item.vine === after.vine && item.spur <= after.spur)));
  const from = at >= 0 ? at + 1 : passed.length;
  const round = [...all.slice(from), ...all.slice(0, from)].filter((item) => isOpen(item) && item.key !== after?.key);
  return [...round.filter((item) => !canWait(item)), ...round.filter(canWait)];
}

/** Where the picture of an item is. @param {Item} item */
export function pathOf({ row, vine, spur }) {
  return row ? `api/points/${encodeURIComponent(row.point.point_id)}` : `api/spurs/${vine}/${spur}`;
}

/** What makes it another cut. A restarted perception reuses ids: the hash distinguishes the points. @param {Item} item */
export function versionOf({ row, sites }) {
  return row ? `${row.point.revision} ${row.point.digest}` : sites.map((site) => site.reason.code).join();
}

/** Look at an item: the views go there. @param {string} key */
export function look(key) {
  current.set(key);
  selectAndReveal(itemOf(key)?.row ? key : "");
}

/**
 * Look at the neighbour of an item along the row.
 *
 * @param {1|-1} step
 */
export function step(step) {
  const all = items();
  const at = all.findIndex((item) => item.key === current.get());
  const next = all[at < 0 ? 0 : Math.max(0, Math.min(all.length - 1, at + step))];
  if (next) look(next.key);
}

/**
 * Count an item as decided while its decision is under way.
 *
 * @param {string} key
 * @param {Promise<boolean>} done Was it accepted?
 */
export async function whileSent(key, done) {
  sent.set(key, { at: performance.now(), state: stateOf(key) });
  changes.set(changes.get() + 1);
  const ok = await done;
  if (!ok) sent.delete(key);
  changes.set(changes.get() + 1);
  return ok;
}

/** Is a decision about it under way? @param {string} key */
export function isSent(key) {
  const decision = sent.get(key);
  if (!decision) return false;
  // Told by the robot, or waited for long enough.
  const told = stateOf(key) !== decision.state;
  if (told || performance.now() - decision.at > SENT_MS) sent.delete(key);
  return sent.has(key);
}

/** What is decided about an item. @param {string} key */
function stateOf(key) {
  const item = itemOf(key);
  return item?.row?.entry.state ?? item?.status ?? "";
}

/** Leave a place as it is: nothing is cut there. @param {Item} item */
export function leavePlace(item) {
  const words = () => text("review.undo_place", { vine: item.vine, spur: item.spur });
  return undoable(sendLeft(item, true), words, () => sendLeft(item, false), item.key);
}

/**
 * @param {Item} item
 * @param {boolean} left Or to be decided again.
 */
function sendLeft({ vine, spur }, left) {
  return ask(text("command.LeaveSite"), "api/sites/leave", { vine, spur, left });
}

// --- a whole vine ---

/**
 * Cuts of a vine that perception is sure of, and its undecided places: what a person may decide about at once.
 *
 * @param {number} vine
 */
export function ofVine(vine) {
  const open = items().filter((item) => item.vine === vine && isOpen(item));
  const cuts = open.filter(({ row, status }) => row !== null && status === "proposed" && !isUncertain(row));
  return { cuts, places: open.filter(({ row }) => row === null) };
}

/**
 * Accept points, each as it was shown. One that has changed since is refused with its reason; one undo takes all back.
 *
 * @param {readonly PagePoint[]} rows
 */
export function acceptAll(rows) {
  const stands = (/** @type {PagePoint} */ row) => isAccepted(itemOf(keyOfPoint(row))?.row ?? undefined);
  return decideAll(rows, (count) => counted("undo.accepted", count), keyOfPoint, sendAcceptance, stands, reconsider);
}

/** Leave places as they are; one undo takes all back. @param {readonly Item[]} places */
export function leaveAll(places) {
  const stands = (/** @type {Item} */ { key }) => itemOf(key)?.status === "left";
  const send = (/** @type {boolean} */ left) => (/** @type {Item} */ item) => sendLeft(item, left);
  return decideAll(places, (count) => counted("undo.left", count), ({ key }) => key, send(true), stands, send(false));
}

/**
 * The undo leaves alone what was cut or decided again since. What the robot has not told of yet still stands.
 *
 * @template T
 * @param {readonly T[]} all
 * @param {(count: number) => string} words
 * @param {(each: T) => string} keyOf
 * @param {(each: T) => Promise<boolean>} decide
 * @param {(each: T) => boolean} stands
 * @param {(each: T) => Promise<boolean>} back
 */
async function decideAll(all, words, keyOf, decide, stands, back) {
  /** @type {T[]} */
  const done = [];
  const send = async (/** @type {T} */ each) => {
    if (await whileSent(keyOf(each), decide(each))) done.push(each);
  };
  const takeBack = async () => {
    const still = done.filter((each) => isSent(keyOf(each)) || stands(each));
    const taken = await Promise.all(still.map(back));
    return taken.length > 0 && taken.every(Boolean);
  };
  const sent = Promise.all(all.map(send)).then(() => done.length > 0);
  await undoable(sent, () => words(done.length || all.length), takeBack);
}

// A point that is chosen anywhere is looked at. The work does not take a picture away under a press.
selected.subscribe((pointId) => {
  if (pointId && !(isFollowed() && items().some(isOpen))) current.set(pointId);
});
