// All points and places of the row in a strip, vine by vine. A press looks at one.

import { changes, current, isSent, items, look } from "../js/control/review.js";
import { pageState, points, revealCount } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { labelOf, text } from "../js/state/texts.js";
import { element, setAttribute, setText } from "../js/views/dom.js";
import { setStatus } from "../js/views/point-status.js";

/** @typedef {import("../js/control/review.js").Item} Item */

class RpPointStrip extends HTMLElement {
  connectedCallback() {
    if (this.childElementCount > 0) return;
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("review.strip"));
    this.addEventListener("click", (event) => {
      const key = /** @type {Element} */ (event.target).closest("button")?.dataset.key;
      if (key) look(key);
    });
    drawOn([points, changes], () => this.draw());
    drawOn([current], () => this.mark());
    drawOn([revealCount], () => this.reveal(this.marks.get(current.get())?.button));
    drawOn([pageState], () => this.markActive());
  }

  /** @type {Map<string, { button: HTMLButtonElement, sign: HTMLElement, number: HTMLElement }>} */
  marks = new Map();
  /** @type {Map<number, HTMLElement>} */
  vines = new Map();
  chosen = "";
  active = "";

  draw() {
    const all = items();
    const kept = new Set(all.map((item) => item.key));
    for (const [key, { button }] of this.marks) if (!kept.has(key)) this.marks.delete(key), button.remove();
    /** @type {Element|null} */
    let lastVine = null;
    /** @type {Element|null} */
    let last = null;
    for (const item of all) {
      const vine = this.vineOf(item.vine);
      if (vine !== lastVine) {
        putAfter(this, vine, lastVine);
        [lastVine, last] = [vine, vine.firstElementChild];
      }
      const { button } = this.show(item);
      putAfter(vine, button, last);
      last = button;
    }
    for (const [number, vine] of this.vines) if (vine.childElementCount < 2) this.vines.delete(number), vine.remove();
    this.mark();
  }

  /** @param {number} number */
  vineOf(number) {
    const known = this.vines.get(number);
    if (known) return known;
    const name = text("review.vine", { vine: number });
    const vine = element("div", { class: "strip-vine", attributes: { role: "group", "aria-label": name } }, element("h3", { text: name }));
    this.vines.set(number, vine);
    return vine;
  }

  /** @param {Item} item */
  show(item) {
    let mark = this.marks.get(item.key);
    if (!mark) {
      const [sign, number] = [element("span", { class: "sign" }), element("span", { class: "number" })];
      mark = { button: element("button", { class: "strip-mark", data: { key: item.key } }, sign, number), sign, number };
      mark.button.tabIndex = -1;
      this.marks.set(item.key, mark);
    }
    const { button, sign, number } = mark;
    setStatus(sign, item.status);
    setText(number, String(item.spur));
    setAttribute(button, "data-point-id", item.row?.point.point_id ?? "");
    setAttribute(button, "data-state", item.row?.entry.state ?? "");
    setAttribute(button, "data-status", item.status);
    button.classList.toggle("sent", isSent(item.key));
    const words = text("review.mark", { vine: item.vine, spur: item.spur, status: stateWords(item) });
    setAttribute(button, "title", words);
    setAttribute(button, "aria-label", words);
    return mark;
  }

  /** Mark the one that is looked at; the Tab key reaches it, or else the first. */
  mark() {
    const key = current.get();
    for (const name of [this.chosen, key]) {
      const button = this.marks.get(name)?.button;
      if (!button) continue;
      setAttribute(button, "aria-current", name === key ? "true" : "");
      setAttribute(button, "tabindex", name === key ? "0" : "-1");
    }
    const first = items()[0];
    const none = !this.marks.has(key);
    const button = first && this.marks.get(first.key)?.button;
    if (button && first.key !== key) setAttribute(button, "tabindex", none ? "0" : "-1");
    if (key !== this.chosen) this.reveal(this.marks.get(key)?.button);
    this.chosen = key;
  }

  markActive() {
    const active = pageState.get()?.controller?.active_point_id ?? "";
    if (active === this.active) return;
    for (const name of [this.active, active]) this.marks.get(name)?.button.classList.toggle("active", name === active);
    this.active = active;
  }

  /** Scroll only the strip. @param {HTMLElement|undefined} button */
  reveal(button) {
    if (!button) return;
    const [box, frame] = [button.getBoundingClientRect(), this.getBoundingClientRect()];
    this.scrollLeft += box.left + box.width / 2 - frame.left - frame.width / 2;
  }
}
customElements.define("rp-point-strip", RpPointStrip);

/** @param {Item} item */
export function stateWords(item) {
  return item.row ? labelOf(item.row.entry.state) : text(`review.place.${item.status}`);
}

/**
 * @param {Element} parent
 * @param {Element} node
 * @param {Element|null} previous
 */
function putAfter(parent, node, previous) {
  const next = previous ? previous.nextElementSibling : parent.firstElementChild;
  if (node.parentElement === parent && next === node) return;
  parent.insertBefore(node, next);
}
