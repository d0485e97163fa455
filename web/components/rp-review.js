// The screen for decisions: one picture at a time, a press a decision, the next one by itself.
// Keys: A accept, R leave, arrows, Z undo, N by hand, L look again, V the whole vine, + and − zoom.

import { whyNot } from "../js/control/allowed.js";
import {
  accept,
  decisions,
  explain,
  isUnknown,
  lastDecision,
  move,
  nameOf,
  reject,
  undo,
  whyNoUndo,
  whyNotAccept,
  whyNotMove,
  whyNotReject,
} from "../js/control/decisions.js";
import { nextStep } from "../js/control/next-step.js";
import { placePoint, placing, setPlacing, whyNoPlacing } from "../js/control/placing.js";
import { changes, current, isOpen, itemOf, items, leavePlace, look, ofVine, openAfter, pathOf, step, versionOf, whileSent } from "../js/control/review.js";
import { isTyping } from "../js/control/stop.js";
import { ask } from "../js/link/api.js";
import { TEXT_MAX_LENGTH } from "../js/link/messages.js";
import { cutOn, fetchPicture } from "../js/link/pictures.js";
import { link, now, pageState, points, showToast, staleWords } from "../js/state/page-state.js";
import { reason, reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { counted, joined, labelOf, text } from "../js/state/texts.js";
import { element, setAttribute, setEnabled, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";
import { keepsWords, pictureWords, placeName } from "../js/views/item-words.js";
import { setStatus } from "../js/views/point-status.js";
import { planWords, robotWords } from "../js/views/plan-words.js";
import { RpAdjust } from "./rp-adjust.js";
import { RpCutPicture } from "./rp-cut-picture.js";
import { stateWords } from "./rp-point-strip.js";
import { RpVineSheet } from "./rp-vine-sheet.js";
import "./rp-order.js";
import "./rp-rule.js";

/** @typedef {import("../js/control/review.js").Item} Item */
/** @typedef {import("../js/link/messages.js").PagePoint} PagePoint */
/** @typedef {import("../js/link/pictures.js").CutPicture} CutPicture */
/** @typedef {import("../js/state/reasons.js").Reason} Reason */

/** Usual reasons for leaving a cane; labels of names. */
const USUAL = Object.freeze(["not a cane", "wrong cane", "wrong place", "too near a wire", "leave it"]);
/** A missing picture is asked for again after this time (ms), this many times. */
const AGAIN_MS = 1500;
const TRIES = 20;
/** A decision waits for the picture for this time at most (ms). */
const LOADING_MS = 2000;
/** No decision for this time after the cut has changed, and after another picture has come: nobody sees faster (ms). */
const CHANGED_MS = 700;
const TURNED_MS = 200;
/** How long it stands that what is looked at has vanished (ms). */
const GONE_MS = 3000;
/** A moved cut is drawn anew by perception within this time (ms). */
const MOVED_MS = 3000;

class RpReview extends HTMLElement {
  /** What is looked at, as it was drawn. @type {Item|null} */
  item = null;
  /** Has it vanished? */
  gone = false;
  /** @type {"loading"|"shown"|"older"|"none"} */
  pictured = "loading";
  /** When another item, or another cut of the same, came into view (ms). */
  turnedAt = -Infinity;
  changedAt = -Infinity;
  fetches = 0;
  tries = 0;
  timer = 0;
  /** The point that was left last: it may be said why. @type {PagePoint|null} */
  explained = null;

  connectedCallback() {
    if (this.picture) return;
    this.picture = new RpCutPicture();
    this.adjust = new RpAdjust();
    this.sheet = new RpVineSheet();
    this.build(this.picture, this.adjust);
    this.picture.addEventListener("place", (event) => void this.place(/** @type {CustomEvent} */ (event).detail));
    this.picture.addEventListener("move-cut", (event) => void this.moveCut(/** @type {CustomEvent} */ (event).detail.along));
    this.sheet.addEventListener("closed", (event) => this.closeVine(/** @type {CustomEvent} */ (event).detail.key));
    current.subscribe((key) => this.sheet?.close(key));
    window.addEventListener("keydown", (event) => this.key(event));
    drawOn([points, pageState, link, now, current, changes, placing, decisions], () => this.draw());
    // On a telephone the button is below the picture that is tapped then.
    placing.subscribe((on) => on && this.picture?.scrollIntoView({ block: "nearest" }));
  }

  /**
   * @param {RpCutPicture} picture
   * @param {RpAdjust} adjust
   */
  build(picture, adjust) {
    const button = (/** @type {string} */ id, /** @type {string} */ sign, /** @type {string} */ words, /** @type {() => void} */ act) =>
      element("button", { id, onclick: act }, icon(sign), element("span", { text: words }));
    this.back = element("button", { id: "review-back", text: "‹", attributes: { "aria-label": text("review.back") }, onclick: () => step(-1) });
    this.forth = element("button", { id: "review-forth", text: "›", attributes: { "aria-label": text("review.forth") }, onclick: () => step(1) });
    this.count = element("p", { class: "review-count number" });
    this.stale = element("span", { class: "stale-note", attributes: { role: "status" } });
    this.name = element("h2");
    this.sign = element("span", { class: "sign" });
    this.state = element("span", { class: "review-state" });
    this.keeps = element("p", { class: "review-keeps" });
    this.why = element("div", { class: "review-why" });
    this.robot = element("p", { class: "review-robot" });
    this.changed = element("p", { class: "review-changed", attributes: { role: "status" } });
    this.leaveButton = button("review-leave", "REJECTED", text("review.leave"), () => void this.leave());
    this.acceptButton = button("review-accept", "DONE", text("review.accept"), () => void this.accept());
    this.lookAgain = button("look-again", "again", text("sites.look"), () => this.askLook());
    this.reasons = this.reasonChoices();
    this.notes = element("div", { class: "review-notes", attributes: { role: "status" } });
    this.refusals = element("div", { class: "review-refusals", attributes: { role: "alert" } });
    this.done = element("p", { class: "review-done", attributes: { role: "status" } });
    this.facts = element(
      "div",
      { class: "review-facts" },
      element("div", { class: "review-head" }, this.back, element("div", {}, this.count, this.name), this.forth),
      element("p", { class: "review-status" }, this.sign, this.state, this.stale),
      this.keeps,
      this.changed,
      this.why,
      this.robot,
    );
    this.empty = element("p", { class: "empty", attributes: { role: "status" } });
    this.replaceChildren(
      picture,
      element(
        "div",
        { class: "review-side" },
        this.notes,
        this.facts,
        element("div", { class: "review-decide" }, this.leaveButton, this.acceptButton, this.lookAgain),
        this.reasons,
        this.refusals,
        this.done,
        element("div", { class: "review-tools" }, undoButton(() => void this.undo()), addByHand(), openVine(() => this.openVine())),
        adjust,
        document.createElement("rp-rule"),
        document.createElement("rp-order"),
      ),
      this.empty,
      /** @type {RpVineSheet} */ (this.sheet),
      document.createElement("rp-point-strip"),
    );
  }

  draw() {
    const all = items();
    const key = current.get();
    const found = itemOf(key);
    const shown = this.item;
    setText(/** @type {Element} */ (this.empty), emptyWords(all));
    setAttribute(this, "data-empty", all.length === 0 && !shown ? "yes" : "no");
    if (!found && !shown) {
      const first = openAfter(undefined)[0] ?? all[0];
      if (first) current.set(first.key);
      return;
    }
    if (found && found.key !== shown?.key) this.turnTo(found);
    else if (found && shown) this.follow(found, shown);
    else if (shown && key === shown.key) this.miss(shown);
    this.drawItem(all);
  }

  /** What is looked at has vanished: the next comes once that could be read. @param {Item} item */
  miss(item) {
    if (this.gone) return;
    this.gone = true;
    window.setTimeout(() => this.gone && this.item === item && this.sheet?.hidden !== false && this.goOn(item), GONE_MS);
  }

  /** Another item is looked at. @param {Item} item */
  turnTo(item) {
    this.item = item;
    this.gone = false;
    this.turnedAt = performance.now();
    this.changedAt = -Infinity;
    setText(/** @type {Element} */ (this.changed), "");
    this.load(item);
  }

  /**
   * The item that is looked at, as it is now.
   *
   * @param {Item} item
   * @param {Item} shown
   */
  follow(item, shown) {
    this.item = item;
    this.gone = false;
    if (versionOf(item) === versionOf(shown)) return;
    this.changedAt = performance.now();
    setText(/** @type {Element} */ (this.changed), changeWords(item, shown));
    this.load(item);
  }

  // --- the picture ---

  /** @param {Item} item */
  load(item) {
    window.clearTimeout(this.timer);
    this.pictured = "loading";
    this.tries = 0;
    this.picture?.show(null, null, text("picture.loading"));
    void this.fetch(item);
  }

  /** @param {Item} item */
  async fetch(item) {
    const number = ++this.fetches;
    const picture = await fetchPicture(pathOf(item));
    if (number !== this.fetches || item.key !== this.item?.key) return;
    this.pictured = this.showPicture(item, picture);
    if (this.pictured !== "shown" && this.tries++ < TRIES) this.timer = window.setTimeout(() => void this.fetch(item), AGAIN_MS);
    for (const next of openAfter(item).slice(0, 2)) void fetchPicture(pathOf(next));
    this.draw();
  }

  /**
   * @param {Item} item
   * @param {CutPicture|null} picture
   * @returns {"shown"|"older"|"none"}
   */
  showPicture(item, picture) {
    const { row } = item;
    const { cut, pictured } = cutOn(picture, row);
    if (pictured === "none") this.picture?.show(null, null, text("picture.none"));
    else this.picture?.show(picture, cut, pictureWords(item));
    return pictured;
  }

  // --- what is told of it ---

  /** @param {readonly Item[]} all */
  drawItem(all) {
    const item = /** @type {Item} */ (this.item);
    const { row } = item;
    const open = all.filter(isOpen).length;
    const at = all.findIndex((each) => each.key === item.key);
    if (at >= 0) setText(/** @type {Element} */ (this.count), text("review.count", { at: at + 1, count: all.length }));
    setText(/** @type {Element} */ (this.name), placeName(item));
    const stale = staleWords("controller", "perception");
    setText(/** @type {Element} */ (this.stale), stale);
    this.classList.toggle("stale", stale !== "");
    setStatus(/** @type {HTMLElement} */ (this.sign), item.status);
    setAttribute(this, "data-kind", row ? "point" : "place");
    setAttribute(this, "data-key", item.key);
    setAttribute(this, "data-pictured", this.pictured);
    setAttribute(this, "data-status", item.status);
    setAttribute(this, "data-unknown", row && isUnknown(row) ? "yes" : "");
    const state = this.gone ? reasonText(reason("point_vanished")) : stateWords(item);
    setText(/** @type {Element} */ (this.state), state);
    setText(/** @type {Element} */ (this.keeps), !row ? text("review.how") : isUnknown(row) ? text("review.ask_cut") : keepsWords(row));
    lines(/** @type {Element} */ (this.why), whyWords(item, this.pictured));
    setText(/** @type {Element} */ (this.robot), row ? [robotWords(row), planWords(row)].filter(Boolean).join(" ") : "");
    setText(/** @type {Element} */ (this.done), open === 0 && all.length > 0 ? finishedWords(all) : "");
    lines(/** @type {Element} */ (this.notes), noteWords());
    this.drawButtons(item);
    if (row) this.adjust?.show(row);
    if (this.adjust) this.adjust.hidden = row === null;
    this.picture?.allow(row !== null && !placing.get() && this.pictured === "shown" && whyNotMove(row) === null, this.takesPlaces(item));
  }

  /** Does a tap on the picture place a cut? @param {Item} item */
  takesPlaces(item) {
    return (placing.get() || item.row === null) && whyNoPlacing() === null;
  }

  /** @param {Item} item */
  drawButtons(item) {
    const { row } = item;
    const unknown = row !== null && isUnknown(row);
    const [leave, accept, again] = [this.leaveButton, this.acceptButton, this.lookAgain];
    if (!leave || !accept || !again) return;
    setText(/** @type {Element} */ (leave.lastElementChild), text(unknown ? "review.was_not_cut" : "review.leave"));
    setText(/** @type {Element} */ (accept.lastElementChild), text(unknown ? "review.was_cut" : "review.accept"));
    setEnabled(leave, this.whyNotNow() ?? (row ? whyNotReject(row) : whyNoPlacing()), text(unknown ? "row.was_not_cut_hint" : "review.leave_hint"));
    accept.hidden = row === null;
    if (row) setEnabled(accept, this.whyNotNow() ?? whyNotAccept(row), text(unknown ? "row.was_cut_hint" : "review.accept_hint"));
    again.hidden = row !== null || !item.sites.some((site) => site.position !== null);
    setEnabled(again, this.gone ? reason("point_vanished") : whyNot("LookAgain"), text("sites.look_hint"));
  }

  /** Why nothing can be decided about this at this moment. @returns {Reason|null} */
  whyNotNow() {
    const at = performance.now();
    if (this.gone) return reason("point_vanished");
    if (at - this.changedAt < CHANGED_MS) return reason("cut_just_changed");
    if (this.pictured === "loading" && at - this.turnedAt < LOADING_MS) return reason("picture_loading");
    return null;
  }

  // --- decisions ---

  /** A press right after another picture has come, or before it has, was meant for the one before. */
  isTooSoon() {
    return this.item?.key !== current.get() || performance.now() - this.turnedAt < TURNED_MS;
  }

  /** Accept the cut as it was drawn: the controller refuses another one. */
  async accept() {
    const item = this.item;
    if (!item?.row || this.isTooSoon()) return;
    const { row } = item;
    const why = this.whyNotNow() ?? whyNotAccept(row);
    if (why) showToast("info", reasonText(why));
    else await this.decide(item, accept(row));
  }

  async leave() {
    const item = this.item;
    if (!item || this.isTooSoon()) return;
    const { row } = item;
    const why = this.whyNotNow() ?? (row ? whyNotReject(row) : whyNoPlacing());
    if (why) return showToast("info", reasonText(why));
    if (row === null) return this.decide(item, leavePlace(item));
    const asked = !isUnknown(row);
    await this.decide(item, reject(row, ""), asked ? row : null);
  }

  /**
   * Go on to the next item while the decision is under way. A refused one stays to be decided, and is told of: the
   * picture that is looked at by then does not change under a press.
   *
   * @param {Item} item
   * @param {Promise<boolean>} asked
   * @param {PagePoint|null} explained Of which it may be said why.
   */
  async decide(item, asked, explained = null) {
    this.explain(explained);
    const done = whileSent(item.key, asked);
    this.goOn(item);
    if (await done) return;
    if (this.explained === explained) this.explain(null);
    this.refuse(item);
  }

  /** Look at the next item to decide. @param {Item} item The one decided now. */
  goOn(item) {
    const next = openAfter(item)[0];
    if (next) look(next.key);
  }

  /** @param {Item} item */
  refuse(item) {
    const name = placeName(item);
    const note = element("p", {}, element("span", { text: text("review.refused", { point: name }) }));
    note.append(
      element("button", {
        text: text("review.show"),
        onclick: () => {
          note.remove();
          look(item.key);
        },
      }),
    );
    this.refusals?.replaceChildren(note);
  }

  async undo() {
    const about = lastDecision()?.about ?? "";
    this.explain(null);
    await undo();
    if (about && itemOf(about) && this.sheet?.hidden !== false) look(about);
  }

  askLook() {
    const { vine, spur } = /** @type {Item} */ (this.item);
    void ask(text("sites.look"), "api/look-again", { vine, spur });
  }

  /** @param {{ sequence: number, u: number, v: number }} at */
  async place(at) {
    if (await placePoint("api/points/by-hand-in-image", at)) setPlacing(false);
  }

  /** @param {number} along (m) */
  async moveCut(along) {
    const row = this.item?.row;
    const moved = row && (await move(row, Math.round(1000 * along)));
    // Until the moved cut is drawn.
    window.setTimeout(() => this.picture?.putBack(), moved ? MOVED_MS : 0);
  }

  // --- a whole vine ---

  openVine() {
    const vine = vineToDecide();
    if (vine === 0) return;
    this.explain(null);
    setAttribute(this, "data-vine", String(vine));
    this.sheet?.open(vine);
  }

  /** @param {string} key What is looked at now. */
  closeVine(key) {
    setAttribute(this, "data-vine", "");
    if (key && key !== current.get()) look(key);
    /** @type {HTMLElement|null} */ (this.querySelector("#open-vine"))?.focus();
  }

  // --- why it was left ---

  reasonChoices() {
    const box = element("div", { class: "review-reasons", attributes: { role: "group" } });
    this.explainedName = element("p");
    const input = element("input", {
      id: "reject-reason",
      attributes: { placeholder: text("review.other_reason"), maxlength: String(TEXT_MAX_LENGTH), "aria-label": text("review.other_reason") },
    });
    const form = element("form", {}, input);
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.say(input.value.trim());
      input.value = "";
    });
    const choices = USUAL.map((each) => element("button", { text: labelOf(each), onclick: () => this.say(each) }));
    box.append(this.explainedName, element("div", { class: "usual" }, ...choices), form);
    box.hidden = true;
    return box;
  }

  /** Offer to say why a point was left. @param {PagePoint|null} row */
  explain(row) {
    this.explained = row;
    if (!this.reasons) return;
    this.reasons.hidden = row === null;
    if (row) setText(/** @type {Element} */ (this.explainedName), text("review.why_left", { point: nameOf(row) }));
  }

  /** @param {string} why */
  say(why) {
    const row = this.explained;
    this.explain(null);
    if (row && why) void explain(row, why);
  }

  // --- keys ---

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target) || !this.checkVisibility()) return;
    const { target } = event;
    const slides = target instanceof HTMLInputElement;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    /** @type {Readonly<Record<string, () => void>>} */
    const once = {
      a: () => void this.accept(),
      r: () => void this.leave(),
      z: () => whyNoUndo() === null && void this.undo(),
      v: () => this.openVine(),
      n: () => whyNoPlacing() === null && setPlacing(!placing.get()),
      l: () => this.lookAgain?.hidden === false && this.lookAgain.click(),
    };
    /** @type {Readonly<Record<string, () => void>>} */
    const repeated = {
      ArrowRight: () => step(1),
      ArrowDown: () => step(1),
      ArrowLeft: () => step(-1),
      ArrowUp: () => step(-1),
      "+": () => this.picture?.zoomTo(this.picture.zoom * 1.5),
      "-": () => this.picture?.zoomTo(this.picture.zoom / 1.5),
    };
    /** @type {Readonly<Record<string, () => void>>} */
    const ofVine = {
      a: () => void this.sheet?.accept(),
      r: () => void this.sheet?.leave(),
      z: once.z,
      v: () => this.sheet?.close(),
      Escape: () => this.sheet?.close(),
    };
    const act = this.sheet?.hidden === false ? ofVine[key] : (once[key] ?? (slides ? undefined : repeated[key]));
    if (!act) return;
    event.preventDefault();
    if (!(key in repeated) && event.repeat) return;
    act();
  }
}

function undoButton(/** @type {() => void} */ act) {
  const button = element("button", { id: "undo", text: text("queue.undo"), onclick: act });
  drawOn([decisions, points, pageState, link, now], () => {
    setEnabled(button, whyNoUndo(), text("queue.undo_hint", { words: lastDecision()?.words() ?? "" }));
  });
  return button;
}

function addByHand() {
  const button = element("button", { id: "add-by-hand", text: text("review.add"), onclick: () => setPlacing(!placing.get()) });
  drawOn([placing, pageState, link, now], () => {
    setEnabled(button, whyNoPlacing(), text("review.add_hint"));
    button.setAttribute("aria-pressed", String(placing.get()));
  });
  return button;
}

/** Look at all of a vine at once. @param {() => void} act */
function openVine(act) {
  const button = element("button", { id: "open-vine", text: text("review.whole_vine"), onclick: act });
  drawOn([points, current, changes, pageState, link, now], () => {
    setEnabled(button, vineToDecide() === 0 ? reason("none_proposed") : null, text("review.whole_vine_hint"));
  });
  return button;
}

/** The vine that is looked at if something of it can be decided at once, else the next such one; 0 without one. */
function vineToDecide() {
  const here = itemOf(current.get());
  const vines = [here, ...openAfter(here)].map((item) => item?.vine ?? 0);
  return vines.find((vine) => Object.values(ofVine(vine)).some((some) => some.length > 0)) ?? 0;
}

/**
 * Reasons in plain words, the nearest to a decision first.
 *
 * @param {Item} item
 * @param {string} pictured
 */
function whyWords({ row, sites }, pictured) {
  const told = row ? [row.point.reason, row.entry.state === "PROPOSED" && row.entry.reason?.code === "not_queued_yet" ? null : row.entry.reason] : sites.map((site) => site.reason);
  const older = pictured === "older" ? text("picture.older") : "";
  return [older, ...told.map(reasonText)].filter(Boolean);
}

/**
 * @param {Item} item
 * @param {Item} before
 */
function changeWords({ row }, { row: old }) {
  if (!row || !old) return text("review.changed");
  const moved = Math.hypot(...row.point.position.map((value, k) => value - (old.point.position[k] ?? value)));
  const parts = [
    moved >= 0.0005 ? text("review.changed_place", { distance: (1000 * moved).toFixed(0) }) : "",
    row.point.nodes_kept === old.point.nodes_kept ? "" : counted("review.changed_keeps", row.point.nodes_kept, { before: old.point.nodes_kept }),
  ];
  return [text("review.changed"), ...parts.filter(Boolean)].join(" ");
}

/** @param {readonly Item[]} all */
function finishedWords(all) {
  const count = (/** @type {string} */ status) => all.filter((item) => item.status === status).length;
  return text("review.finished", { accepted: count("accepted") + count("unreachable") + count("done"), left: count("left") });
}

/** @param {readonly Item[]} all */
function emptyWords(all) {
  if (all.length > 0) return "";
  const page = points.get();
  if (link.get().status !== "open") return text("queue.unknown");
  if (page === null || page.frames === 0) return text("queue.looking");
  const unseen = pageState.get()?.controller && ["Arm", "Survey"].includes(nextStep());
  const told = unseen ? text("work.none") : counted("queue.none", page.frames);
  return [told, ...noteWords()].join(" ");
}

/** What is undecided about no spur in particular. */
function noteWords() {
  return (points.get()?.undecided_sites ?? []).filter((site) => site.vine === 0).map((site) => reasonText(site.reason));
}

/**
 * @param {Element} box
 * @param {readonly string[]} words
 */
function lines(box, words) {
  if (box.textContent === words.map(joined).join("") && box.childElementCount === words.length) return;
  box.replaceChildren(...words.map((each) => element("p", { text: each })));
}
customElements.define("rp-review", RpReview);
