// Asks, inside a row of the queue, why a point is rejected. One key or press is enough; a reason can be written.

import { reject } from "../decisions.js";
import { element } from "../element.js";
import { TEXT_MAX_LENGTH } from "../messages.js";

/** @typedef {import("../messages.js").PagePoint} PagePoint */

const USUAL = Object.freeze(["wrong cane", "wrong place", "too near a wire", "leave it"]);

export class RpReason extends HTMLElement {
  constructor() {
    super();
    /** @type {PagePoint|null} */
    this.row = null;
    this.input = element("input", {
      id: "reject-reason",
      attributes: { placeholder: "Why? (may stay empty)", maxlength: String(TEXT_MAX_LENGTH), "aria-label": "Why it is rejected" },
    });
  }

  connectedCallback() {
    if (this.childElementCount > 0) return;
    const send = element("button", { id: "reject-send", text: "Reject", attributes: { type: "submit" } });
    const form = element("form", {}, this.input, send);
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.send(this.input.value.trim());
    });
    const usual = element("div", { class: "usual" });
    for (const words of USUAL) {
      usual.append(element("button", { class: "quiet", text: words, attributes: { type: "button" }, onclick: () => this.send(words) }));
    }
    this.append(form, usual);
    this.addEventListener("keydown", (event) => {
      // The queue's own keys mean letters here.
      event.stopPropagation();
      if (event.key !== "Escape") return;
      event.preventDefault();
      this.close();
    });
  }

  /**
   * @param {PagePoint} row
   * @param {HTMLElement} item Its row.
   */
  open(row, item) {
    this.row = row;
    this.input.value = "";
    item.append(this);
    this.input.focus();
    this.scrollIntoView({ block: "nearest" });
  }

  close() {
    const item = this.parentElement;
    this.row = null;
    this.remove();
    item?.focus();
  }

  /** @param {string} reason */
  send(reason) {
    const row = this.row;
    this.close();
    if (row) void reject(row, reason);
  }
}
customElements.define("rp-reason", RpReason);
