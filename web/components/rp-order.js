// The order of work, changed by dragging or keys. Only rows in view exist, so that thousands are possible.

import { placeOfCut } from "../js/control/decisions.js";
import { cutTime, moveTo, orderWords, resetOrder, whyNoMove, whyNoResetOrder, workOrder } from "../js/control/order.js";
import { select, selectAndReveal } from "../js/control/selection.js";
import { link, now, pageState, points, revealCount, selected } from "../js/state/page-state.js";
import { pointNames } from "../js/state/point-names.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setAttribute, setEnabled, setText } from "../js/views/dom.js";
import { reasonText } from "../js/state/reasons.js";

/** @typedef {import("../js/link/messages.js").PagePoint} PagePoint */

/** Height of a row (px), as in rule.css. */
const ROW = 48;
/** Extra rows above and below the view. */
const SPARE = 4;
/** A drag within EDGE of an end scrolls the list by SCROLL for each move (px). */
const EDGE = 30;
const SCROLL = 8;

/**
 * Keys that move the selection, or with Alt the selected row: (index, last index) → index.
 *
 * @type {Readonly<Record<string, (at: number, last: number) => number>>}
 */
const STEPS = Object.freeze({
  ArrowDown: (at, last) => Math.min(at + 1, last),
  ArrowUp: (at) => Math.max(at - 1, 0),
  Home: () => 0,
  End: (_, last) => last,
});

class RpOrder extends HTMLElement {
  /** @type {readonly PagePoint[]} */
  order = [];
  /** Existing rows by index. @type {Map<number, HTMLElement>} */
  rows = new Map();
  /** Index to drop the dragged point at, not counting itself; -1 without a drag. */
  target = -1;
  dragged = "";

  connectedCallback() {
    const words = element("span");
    const back = element("button", {
      id: "planners-order",
      class: "quiet",
      text: text("order.reset"),
      onclick: () => void resetOrder(),
    });
    this.space = element("div", { class: "order-space" });
    this.mark = element("div", { class: "order-mark" });
    this.mark.hidden = true;
    this.list = element(
      "div",
      {
        class: "order-list",
        attributes: {
          role: "listbox",
          tabindex: "0",
          "aria-label": text("order.label"),
          "aria-description": text("order.hint"),
          title: text("order.hint"),
        },
      },
      this.space,
      this.mark,
    );
    this.said = element("p", { class: "order-said", attributes: { role: "status" } });
    this.box = element(
      "details",
      { class: "rule order" },
      element("summary", {}, words),
      element(
        "div",
        { class: "order-body" },
        this.list,
        element("div", { class: "order-foot" }, element("span", { text: text("order.drag") }), back),
      ),
      this.said,
    );
    this.replaceChildren(this.box);
    this.list.addEventListener("scroll", () => this.draw());
    this.list.addEventListener("keydown", (event) => this.key(event));
    this.list.addEventListener("click", (event) => this.choose(event));
    this.list.addEventListener("pointerdown", (event) => this.drag(event));
    this.box.addEventListener("toggle", () => {
      this.reveal(this.place(selected.get()));
      this.draw();
    });
    drawOn([selected, revealCount], () => this.reveal(this.place(selected.get())));
    drawOn([points, pageState, link, now, selected], () => {
      setText(words, orderWords());
      setEnabled(back, whyNoResetOrder(), text("order.reset_hint"));
      this.order = workOrder();
      this.draw();
    });
  }

  /** Draw the rows in view. */
  draw() {
    const { list, space } = this;
    if (!this.box?.open || !list || !space) return;
    space.style.setProperty("height", `${this.order.length * ROW}px`);
    const first = Math.max(0, Math.floor(list.scrollTop / ROW) - SPARE);
    const last = Math.min(this.order.length - 1, Math.ceil((list.scrollTop + list.clientHeight) / ROW) + SPARE);
    for (const [at, row] of this.rows) {
      if (at >= first && at <= last) continue;
      row.remove();
      this.rows.delete(at);
    }
    for (let at = first; at <= last; at += 1) this.show(at);
    const chosen = this.place(selected.get());
    setAttribute(list, "aria-activedescendant", this.rows.has(chosen) ? `order-${chosen}` : "");
  }

  /** @param {number} at */
  show(at) {
    const point = this.order[at];
    if (!point) return;
    let row = this.rows.get(at);
    if (!row) {
      row = element(
        "div",
        { id: `order-${at}`, class: "order-row", attributes: { role: "option" } },
        element("span", { class: "order-grip", text: "⠿", attributes: { "aria-hidden": "true" } }),
        element("span", { class: "order-number number" }),
        element("span", { class: "order-name" }),
        element("span", { class: "order-way number" }),
      );
      row.style.setProperty("top", `${at * ROW}px`);
      this.rows.set(at, row);
      this.space?.append(row);
    }
    const [, number, name, way] = row.children;
    const why = reasonText(point.entry.reason);
    if (number) setText(number, `${at + 1}`);
    if (name) setText(name, placeOfCut(text("work.place", { vine: point.point.vine, spur: point.point.spur }), point));
    if (way) setText(way, point.plan ? cutTime(point.plan) : "");
    setAttribute(row, "data-point-id", point.point.point_id);
    setAttribute(row, "title", why || reasonText(point.point.reason));
    row.classList.toggle("dragged", point.point.point_id === this.dragged);
    setAttribute(row, "aria-selected", String(point.point.point_id === selected.get()));
  }

  /** @param {string} pointId */
  place(pointId) {
    return this.order.findIndex((row) => row.point.point_id === pointId);
  }

  /** @param {MouseEvent} event */
  choose(event) {
    const row = /** @type {Element} */ (event.target).closest(".order-row");
    if (row instanceof HTMLElement) selectAndReveal(row.dataset.pointId ?? "");
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const step = STEPS[event.key];
    if (!step || event.ctrlKey || event.metaKey || this.order.length === 0) return;
    event.preventDefault();
    const at = this.place(selected.get());
    const to = step(at, this.order.length - 1);
    const point = this.order[at];
    if (event.altKey && point) {
      if (to !== at && !whyNoMove()) void this.move(point.point.point_id, to);
    } else {
      select(this.order[to]?.point.point_id ?? "");
    }
    this.reveal(to);
  }

  /** @param {number} at */
  reveal(at) {
    const { list } = this;
    if (!list || at < 0 || list.clientHeight === 0) return;
    if (at * ROW < list.scrollTop) list.scrollTop = at * ROW;
    else if ((at + 1) * ROW > list.scrollTop + list.clientHeight) list.scrollTop = (at + 1) * ROW - list.clientHeight;
  }

  /**
   * @param {string} pointId
   * @param {number} to
   */
  async move(pointId, to) {
    if ((await moveTo(pointId, to)) && this.said) setText(this.said, text("order.moved", { point: pointNames(pointId), number: to + 1 }));
  }

  /** @param {PointerEvent} event */
  drag(event) {
    const grip = /** @type {Element} */ (event.target).closest(".order-grip");
    const row = grip?.closest(".order-row");
    const { list, mark } = this;
    if (!(row instanceof HTMLElement) || !list || !mark || !event.isPrimary || event.button !== 0) return;
    event.preventDefault();
    const pointId = row.dataset.pointId ?? "";
    select(pointId);
    if (whyNoMove()) return;
    this.dragged = pointId;
    const follow = (/** @type {PointerEvent} */ moved) => {
      const box = list.getBoundingClientRect();
      if (moved.clientY < box.top + EDGE) list.scrollTop -= SCROLL;
      if (moved.clientY > box.bottom - EDGE) list.scrollTop += SCROLL;
      const gap = Math.round((moved.clientY - box.top + list.scrollTop) / ROW);
      const place = Math.max(0, Math.min(gap, this.order.length));
      const from = this.place(pointId);
      this.target = place > from ? place - 1 : place;
      mark.hidden = this.target === from;
      mark.style.setProperty("top", `${place * ROW}px`);
    };
    const end = (/** @type {Event} */ ended) => {
      const to = ended.type === "pointerup" ? this.target : -1;
      for (const kind of ["pointermove", "pointerup", "pointercancel"])
        list.removeEventListener(kind, kind === "pointermove" ? /** @type {EventListener} */ (follow) : end);
      this.dragged = "";
      this.target = -1;
      mark.hidden = true;
      if (to >= 0 && to !== this.place(pointId)) void this.move(pointId, to);
      this.draw();
    };
    list.setPointerCapture(event.pointerId);
    list.addEventListener("pointermove", /** @type {EventListener} */ (follow));
    list.addEventListener("pointerup", end);
    list.addEventListener("pointercancel", end);
    this.draw();
  }
}
customElements.define("rp-order", RpOrder);
