// A whole vine at once: the pictures of its sure cuts and of its undecided places. One press accepts the cuts that were
// seen here, each as it was shown; another one leaves the places. A press on a picture takes it out of either.
// Keys: A accept, R leave, Z undo, Esc close.

import { whyNot } from "../js/control/allowed.js";
import { nameOf } from "../js/control/decisions.js";
import { whyNoPlacing } from "../js/control/placing.js";
import { acceptAll, changes, leaveAll, ofVine, openAfter, pathOf, versionOf } from "../js/control/review.js";
import { cutOn, fetchPicture } from "../js/link/pictures.js";
import { link, now, pageState, points } from "../js/state/page-state.js";
import { reason, reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { counted, text } from "../js/state/texts.js";
import { element, setAttribute, setEnabled, setText } from "../js/views/dom.js";
import { icon, setIcon } from "../js/views/icons.js";
import { cutWords, pictureWords, placeName } from "../js/views/item-words.js";
import { RpCutPicture } from "./rp-cut-picture.js";

/** @typedef {import("../js/control/review.js").Item} Item */

/** A picture counts as seen after so much of it has been in sight for this time, with the cut as it is now (ms). */
const IN_SIGHT = 0.7;
const SEEN_MS = 700;
/** A missing picture is asked for again after this time (ms), this many times. */
const AGAIN_MS = 1500;
const TRIES = 20;

/** The picture of a cut or a place, and what a person has made of it. */
class Card {
  /**
   * @param {Item} item
   * @param {() => void} changed
   * @param {(item: Item) => void} enlarge
   */
  constructor(item, changed, enlarge) {
    this.item = item;
    this.changed = changed;
    this.version = "";
    /** @type {"loading"|"shown"|"older"|"none"} */
    this.pictured = "loading";
    this.isInSight = false;
    this.isOut = false;
    this.isSeen = false;
    this.timer = 0;
    this.tries = 0;
    this.picture = new RpCutPicture();
    this.picture.inert = true;
    this.name = element("h4");
    this.words = element("p");
    this.note = element("p", { class: "vine-card-note", attributes: { role: "status" } });
    this.out = element("button");
    this.large = element("button", { class: "vine-card-large" }, icon("swap"));
    this.node = element(
      "article",
      { class: "vine-card", data: { key: item.key } },
      this.picture,
      this.name,
      this.words,
      this.note,
      this.out,
      this.large,
    );
    this.node.addEventListener("click", (event) => (event.composedPath().includes(this.large) ? enlarge(this.item) : this.toggle()));
    this.follow(item);
  }

  /** Taken out: the next press does not decide about it. */
  toggle() {
    this.isOut = !this.isOut;
    this.changed();
  }

  /** The item as it is now; another cut has to be seen anew. @param {Item} item */
  follow(item) {
    this.item = item;
    const version = versionOf(item);
    if (version === this.version) return;
    setText(this.note, this.version ? text("review.changed") : "");
    this.version = version;
    this.isSeen = false;
    this.tries = 0;
    this.pictured = "loading";
    this.picture.show(null, null, text("picture.loading"));
    void this.load(item);
  }

  /** @param {Item} item */
  async load(item) {
    window.clearTimeout(this.timer);
    const picture = await fetchPicture(pathOf(item));
    if (versionOf(item) !== this.version) return;
    const { cut, pictured } = cutOn(picture, item.row);
    this.pictured = pictured;
    if (pictured === "none") this.picture.show(null, null, text("picture.none"));
    else this.picture.show(picture, cut, pictureWords(item));
    if (pictured === "shown") this.watch();
    else if (this.tries++ < TRIES) this.timer = window.setTimeout(() => void this.load(item), AGAIN_MS);
    this.changed();
  }

  /** @param {boolean} isInSight */
  sight(isInSight) {
    this.isInSight = isInSight;
    this.watch();
  }

  /** It is seen when it has been in sight for long enough. */
  watch() {
    window.clearTimeout(this.timer);
    if (!this.isInSight || this.isSeen || this.pictured !== "shown") return;
    this.timer = window.setTimeout(() => {
      this.isSeen = true;
      this.changed();
    }, SEEN_MS);
  }

  draw() {
    const { item } = this;
    const name = item.row ? nameOf(item.row) : placeName(item);
    setText(this.name, text("review.spur", { spur: item.spur }));
    setText(this.words, item.row ? cutWords(item.row.point) : item.sites.map((site) => reasonText(site.reason)).join(" "));
    setIcon(this.out, this.isOut ? "add" : "REJECTED");
    nameButton(this.out, text(this.isOut ? "review.put_back" : "review.take_out"), name);
    nameButton(this.large, text("review.show"), name);
    setAttribute(this.node, "data-out", this.isOut ? "yes" : "no");
    setAttribute(this.node, "data-seen", this.isSeen ? "yes" : "no");
  }
}

/**
 * @param {Element} button
 * @param {string} does
 * @param {string} name Of what it does that to.
 */
function nameButton(button, does, name) {
  setAttribute(button, "aria-label", `${does}: ${name}`);
  setAttribute(button, "title", does);
}

export class RpVineSheet extends HTMLElement {
  vine = 0;
  /** @type {Map<string, Card>} */
  cards = new Map();

  connectedCallback() {
    if (this.scroller) return;
    this.hidden = true;
    this.heading = element("h2", { attributes: { tabindex: "-1" } });
    this.told = element("p", { attributes: { role: "status" } });
    this.cuts = element("div", { class: "vine-cards", attributes: { role: "group", "aria-label": text("review.sure_cuts") } });
    this.places = element("div", { class: "vine-cards", attributes: { role: "group", "aria-label": text("review.place.decide") } });
    this.placesHead = element("h3", { text: text("review.place.decide") });
    this.scroller = element("div", { class: "vine-scroller", attributes: { tabindex: "0" } }, this.cuts, this.placesHead, this.places);
    this.acceptButton = element("button", { id: "vine-accept", onclick: () => void this.accept() });
    this.leaveButton = element("button", { id: "vine-leave", onclick: () => void this.leave() });
    const close = element("button", { id: "vine-close", text: text("sheet.close"), onclick: () => this.close() });
    this.content = [
      element("div", { class: "vine-head" }, this.heading, this.told, close),
      this.scroller,
      element("div", { class: "vine-decide" }, this.leaveButton, this.acceptButton),
    ];
    this.sights = new IntersectionObserver(
      (all) => {
        for (const { target, intersectionRatio } of all) this.cardOf(target)?.sight(intersectionRatio >= IN_SIGHT);
      },
      { root: this.scroller, threshold: IN_SIGHT },
    );
    drawOn([points, changes, pageState, link, now], () => this.draw());
  }

  /** @param {Element} picture */
  cardOf(picture) {
    return [...this.cards.values()].find((card) => card.picture === picture);
  }

  /** @param {number} vine */
  open(vine) {
    this.vine = vine;
    this.hidden = false;
    this.replaceChildren(...(this.content ?? []));
    this.draw();
    this.scroller?.scrollTo(0, 0);
    this.heading?.focus();
  }

  /** @param {string} [key] What is looked at then; the next to decide if not given. */
  close(key) {
    if (this.hidden) return;
    this.hidden = true;
    for (const card of this.cards.values()) window.clearTimeout(card.timer);
    this.cards.clear();
    this.sights?.disconnect();
    this.cuts?.replaceChildren();
    this.places?.replaceChildren();
    this.replaceChildren();
    this.dispatchEvent(new CustomEvent("closed", { detail: { key: key ?? openAfter(undefined)[0]?.key ?? "" } }));
  }

  draw() {
    if (this.hidden) return;
    const { cuts, places } = ofVine(this.vine);
    this.follow(this.cuts, cuts);
    this.follow(this.places, places);
    const open = new Set([...cuts, ...places].map(({ key }) => key));
    for (const [key, card] of this.cards) {
      card.node.hidden = !open.has(key);
      card.draw();
    }
    if (this.placesHead) this.placesHead.hidden = places.length === 0;
    const unseen = this.chosen(cuts).filter((card) => !card.isSeen).length;
    setText(/** @type {Element} */ (this.heading), text("review.vine", { vine: this.vine }));
    setText(/** @type {Element} */ (this.told), unseen > 0 ? counted("review.unseen", unseen) : text("review.sheet_how"));
    this.drawButtons();
  }

  /**
   * @param {Element|undefined} box
   * @param {readonly Item[]} found
   */
  follow(box, found) {
    for (const item of found) {
      const card = this.cards.get(item.key);
      if (card) card.follow(item);
      else {
        const made = new Card(item, () => this.draw(), (each) => this.close(each.key));
        this.cards.set(item.key, made);
        box?.append(made.node);
        this.sights?.observe(made.picture);
      }
    }
  }

  drawButtons() {
    const [accept, leave] = [this.acceptButton, this.leaveButton];
    if (!accept || !leave) return;
    const [cuts, places] = [this.toAccept().length, this.toLeave().length];
    setText(accept, counted("review.accept_seen", cuts));
    setText(leave, counted("review.leave_places", places));
    setEnabled(accept, whyNot("AcceptPoint") ?? (cuts === 0 ? reason("none_seen") : null), text("review.accept_seen_hint"));
    setEnabled(leave, whyNoPlacing() ?? (places === 0 ? reason("none_undecided") : null), text("review.leave_places_hint"));
  }

  /** @param {readonly Item[]} found */
  chosen(found) {
    return found.flatMap(({ key }) => this.cards.get(key) ?? []).filter((card) => !card.isOut);
  }

  /** The sure cuts that were seen, each as its picture shows it. */
  toAccept() {
    return this.chosen(ofVine(this.vine).cuts).flatMap((card) => (card.isSeen && card.item.row ? [card.item.row] : []));
  }

  toLeave() {
    return this.chosen(ofVine(this.vine).places).map((card) => card.item);
  }

  async accept() {
    const rows = this.toAccept();
    if (rows.length === 0 || whyNot("AcceptPoint")) return;
    await acceptAll(rows);
    this.closeIfDone();
  }

  async leave() {
    const places = this.toLeave();
    if (places.length === 0 || whyNoPlacing()) return;
    await leaveAll(places);
    this.closeIfDone();
  }

  /** Nothing of the vine is left for a press here. */
  closeIfDone() {
    const { cuts, places } = ofVine(this.vine);
    if (this.chosen([...cuts, ...places]).length === 0) this.close();
  }
}
customElements.define("rp-vine-sheet", RpVineSheet);
