// The open picture with its mask and proposal, the chosen tool, and the saving of every step.

import { reasonText } from "../state/reasons.js";
import { signal } from "../state/signals.js";
import { text } from "../state/texts.js";
import { CLASSES, REST, UNLABELLED } from "./classes.js";
import { Mask } from "./mask.js";

/**
 * @typedef {{ name: string, split: "train"|"held-out", labelled: number, problem: string }} Row
 * @typedef {object} Listed
 * @property {string} folder
 * @property {string} masks
 * @property {string} model
 * @property {Record<string, number>} classes
 * @typedef {object} Open
 * @property {string} name
 * @property {ImageBitmap} image
 * @property {Mask} mask
 * @property {Uint8Array|null} proposal
 * @property {string} revision
 * @typedef {{ state: "nothing"|"unsaved"|"saved"|"failed"|"conflict", words: string }} Saving
 */

/** Diameters of the brush, in pixels of the picture. */
export const SIZES = Object.freeze([1, 2, 3, 5, 8, 12, 18, 28, 45, 70, 110]);
/** After a failed attempt to save (ms). */
const RETRY_MS = 2000;

export const listed = signal(/** @type {Listed|null} */ (null));
export const rows = signal(/** @type {readonly Row[]} */ ([]));
export const open = signal(/** @type {Open|null} */ (null));
/** Name of the class that is painted; "unlabelled" erases, "proposal" paints what is proposed. */
export const tool = signal("cane");
export const sizeStep = signal(4);
export const proposalShown = signal(true);
export const labelsShown = signal(true);
/** Opacity of the overlay, 0 to 1. */
export const strength = signal(0.6);
export const saving = signal(/** @type {Saving} */ ({ state: "nothing", words: "" }));
/** Why no picture is shown, or what could not be done. */
export const problem = signal("");
/** Counts changes of the mask. */
export const changes = signal(0);

/** @type {Uint8Array} */
let restValues = new Uint8Array();
let opening = 0;
/** Has the open mask changes that are not on disk? */
let unsaved = false;
/** @type {Promise<void>|null} */
let running = null;

/** @param {string} name */
export function valueOf(name) {
  return listed.get()?.classes[name] ?? UNLABELLED;
}

/** @param {string} name */
function pathOf(name) {
  return `api/pictures/${encodeURIComponent(name)}`;
}

/**
 * @param {Response} response
 * @returns {Promise<string>} Why it was refused.
 */
async function refusal(response) {
  if (response.status === 401) return text("label.signed_out");
  /** @type {any} */
  let body = null;
  try {
    body = await response.json();
  } catch {
    // Not JSON: the status has to do.
  }
  if (typeof body?.code !== "string") return text("label.answered", { status: response.status });
  return reasonText({ code: body.code, values: /** @type {[string, string][]} */ (Object.entries(body.values)) });
}

/**
 * @param {string} path
 * @param {RequestInit} [options]
 * @returns {Promise<Response>} An answer that is not a refusal.
 * @throws {Error} With the words for the person.
 */
async function asked(path, options = {}) {
  /** @type {Response} */
  let response;
  try {
    response = await fetch(path, { credentials: "same-origin", ...options });
  } catch {
    throw new Error(text("label.unreachable"));
  }
  if (!response.ok) throw new Error(await refusal(response), { cause: response.status });
  return response;
}

/** Fetch the list and open the picture of the address, or the first without labels. */
export async function begin() {
  window.addEventListener("beforeunload", (event) => {
    if (unsaved) event.preventDefault();
  });
  try {
    const found = await (await asked("api/pictures")).json();
    listed.set(found);
    rows.set(found.pictures);
    restValues = Uint8Array.from(REST, (name) => found.classes[name]);
    for (const each of CLASSES) if (!(each.name in found.classes)) throw new Error(each.name);
  } catch (error) {
    problem.set(wordsOf(error));
    return;
  }
  const wanted = decodeURIComponent(location.hash.slice(1));
  const all = rows.get();
  const first = all.find((row) => row.name === wanted) ?? all.find((row) => row.labelled === 0) ?? all[0];
  if (first) await show(first.name);
  else problem.set(text("label.no_pictures"));
}

/** @param {unknown} error */
function wordsOf(error) {
  return error instanceof Error ? error.message : String(error);
}

/**
 * Open a picture, after the changes of the one before are on disk.
 *
 * @param {string} name
 */
export async function show(name) {
  const turn = ++opening;
  if (unsaved) {
    await save();
    if (unsaved || turn !== opening) return;
  }
  try {
    const [picture, mask] = await Promise.all([asked(pathOf(name)), asked(`${pathOf(name)}/mask`)]);
    const image = await createImageBitmap(await picture.blob());
    const labels = new Uint8Array(await mask.arrayBuffer());
    const [width = 0, height = 0] = (mask.headers.get("Picture-Size") ?? "").split("x").map(Number);
    if (turn !== opening) return;
    if (image.width !== width || image.height !== height || labels.length !== width * height) {
      throw new Error(text("label.other_size", { name }));
    }
    problem.set("");
    saving.set({ state: "nothing", words: "" });
    const revision = mask.headers.get("Revision") ?? "";
    open.set({ name, image, mask: new Mask(width, height, labels), proposal: null, revision });
    history.replaceState(null, "", `#${encodeURIComponent(name)}`);
  } catch (error) {
    if (turn !== opening) return;
    open.set(null);
    problem.set(wordsOf(error));
    return;
  }
  try {
    const proposal = new Uint8Array(await (await asked(`${pathOf(name)}/proposal`)).arrayBuffer());
    const now = open.get();
    if (turn === opening && now?.name === name) open.set({ ...now, proposal });
  } catch (error) {
    if (turn === opening) problem.set(text("label.no_proposal", { why: wordsOf(error) }));
  }
}

/** @param {number} by 1 for the next picture, -1 for the one before. */
export function step(by) {
  const all = rows.get();
  const at = all.findIndex((row) => row.name === open.get()?.name);
  const next = all[at + by];
  if (next) void show(next.name);
}

/**
 * What the chosen brush paints.
 *
 * @param {Open} now
 * @returns {(index: number) => number}
 */
export function brush({ mask, proposal }) {
  const name = tool.get();
  if (name !== "proposal") {
    const value = valueOf(name);
    return () => value;
  }
  const far = valueOf("far");
  return (index) => {
    const value = proposal?.[index];
    if (value === undefined) return mask.labels[index] ?? UNLABELLED;
    return restValues.includes(value) ? far : value;
  };
}

/** Take the wood that is proposed, where nothing is labelled yet. */
export function takeProposal() {
  const now = open.get();
  const proposal = now?.proposal;
  if (!now || !proposal) return;
  const labels = now.mask.labels;
  const changed = now.mask.fill((index) => {
    const [old = UNLABELLED, value = UNLABELLED] = [labels[index], proposal[index]];
    return old === UNLABELLED && !restValues.includes(value) ? value : old;
  });
  if (changed) noteChange();
}

/** Label what is unlabelled as far. */
export function takeRest() {
  const now = open.get();
  if (!now) return;
  const [labels, far] = [now.mask.labels, valueOf("far")];
  if (now.mask.fill((index) => (labels[index] === UNLABELLED ? far : (labels[index] ?? far)))) noteChange();
}

export function undo() {
  if (open.get()?.mask.undo()) noteChange();
}

export function redo() {
  if (open.get()?.mask.redo()) noteChange();
}

/** The mask has changed: show it, and save it at once. */
export function noteChange() {
  unsaved = true;
  changes.set(changes.get() + 1);
  if (saving.get().state !== "conflict") void save();
}

/** Save until all is on disk or an attempt fails. */
export function save() {
  running ??= saveAll().finally(() => (running = null));
  return running;
}

async function saveAll() {
  while (unsaved) {
    const now = open.get();
    if (!now) return;
    if (saving.get().state !== "failed") saving.set({ state: "unsaved", words: text("label.saving") });
    unsaved = false;
    try {
      const packed = new Blob([now.mask.labels.slice()]).stream().pipeThrough(new CompressionStream("gzip"));
      const body = await new Response(packed).blob();
      const headers = { Revision: now.revision, "Content-Type": "application/octet-stream" };
      const answer = await (await asked(`${pathOf(now.name)}/mask`, { method: "PUT", headers, body })).json();
      now.revision = answer.revision;
      replaceRow(answer.row);
      saving.set({ state: "saved", words: text("label.saved", { time: new Date().toLocaleTimeString() }) });
    } catch (error) {
      unsaved = true;
      const conflict = error instanceof Error && error.cause === 409;
      saving.set({ state: conflict ? "conflict" : "failed", words: text("label.unsaved", { why: wordsOf(error) }) });
      if (!conflict) window.setTimeout(() => void save(), RETRY_MS);
      return;
    }
  }
}

/** Save over a mask that another window has changed. */
export async function saveMine() {
  const now = open.get();
  if (!now) return;
  try {
    const there = await asked(`${pathOf(now.name)}/mask`);
    now.revision = there.headers.get("Revision") ?? "";
  } catch (error) {
    saving.set({ state: "conflict", words: text("label.unsaved", { why: wordsOf(error) }) });
    return;
  }
  saving.set({ state: "unsaved", words: text("label.saving") });
  await save();
}

/** Drop the changes of this window and load what is on disk. */
export async function loadOther() {
  const now = open.get();
  if (!now) return;
  unsaved = false;
  await show(now.name);
}

/** @param {Row["split"]} split */
export async function assign(split) {
  const now = open.get();
  if (!now) return;
  try {
    const body = JSON.stringify({ split });
    const headers = { "Content-Type": "application/json" };
    replaceRow((await (await asked(`${pathOf(now.name)}/split`, { method: "POST", headers, body })).json()).row);
    problem.set("");
  } catch (error) {
    problem.set(wordsOf(error));
  }
}

/** @param {Row} row */
function replaceRow(row) {
  rows.set(rows.get().map((each) => (each.name === row.name ? row : each)));
}
