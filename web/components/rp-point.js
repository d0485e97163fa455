// One row of the queue, with the form for the reason of a rejection.

import { accept, isUncertain, isUnknown, reject, whyNotAccept, whyNotReject } from "../js/control/decisions.js";
import { cutTime } from "../js/control/order.js";
import { select, selectAndReveal } from "../js/control/selection.js";
import { TEXT_MAX_LENGTH } from "../js/link/messages.js";
import { counted, labelOf, text } from "../js/state/texts.js";
import { element, setEnabled, setText } from "../js/views/dom.js";
import { icon, setIcon } from "../js/views/icons.js";
import { reasonText } from "../js/state/reasons.js";

/** @typedef {import("../js/link/messages.js").PagePoint} PagePoint */

const USUAL = Object.freeze(["not a cane", "wrong cane", "wrong place", "too near a wire", "leave it"]);

export class RpRejectForm extends HTMLElement {
  constructor() {
    super();
    /** @type {PagePoint|null} */
    this.row = null;
    this.input = element("input", {
      id: "reject-reason",
      attributes: {
        placeholder: text("reject.why"),
        maxlength: String(TEXT_MAX_LENGTH),
        "aria-label": text("reject.why_label"),
      },
    });
  }

  connectedCallback() {
    if (this.childElementCount > 0) return;
    const send = element("button", { id: "reject-send", text: text("row.reject"), attributes: { type: "submit" } });
    const form = element("form", {}, this.input, send);
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.send(this.input.value.trim());
    });
    const usual = element("div", { class: "usual" });
    for (const each of USUAL) {
      usual.append(element("button", { class: "quiet", text: labelOf(each), onclick: () => this.send(each) }));
    }
    this.append(form, usual);
    this.addEventListener("keydown", (event) => {
      // Letters are text here, not the queue's keys.
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
customElements.define("rp-reject-form", RpRejectForm);

/** @param {PagePoint} row */
function planWords({ plan }) {
  if (!plan?.order) return "";
  const shown = plan.rollout;
  if (!shown) return text("row.planned", { order: plan.order });
  const [one, other] = shown.between;
  return text("row.planned_cut", {
    order: plan.order,
    time: cutTime(plan),
    clearance: Math.round(1000 * shown.clearance),
    one: labelOf(one),
    other: labelOf(other),
    omega: shown.manipulability.toFixed(3),
  });
}

export class RpPoint extends HTMLElement {
  constructor() {
    super();
    /** @type {PagePoint|null} */
    this.row = null;
    this.shape = element("span", { class: "shape" });
    this.word = element("span");
    this.chip = element("span", { class: "chip point-state" }, this.shape, this.word);
    this.place = element("span", { class: "point-name" });
    this.facts = element("p", { class: "facts number" });
    this.reason = element("p", { class: "reason" });
    this.acceptButton = element(
      "button",
      { class: "accept", onclick: () => this.row && void accept(this.row) },
      icon("DONE"),
    );
    this.rejectButton = element("button", { class: "reject", onclick: () => this.reject() }, icon("REJECTED"));
  }

  connectedCallback() {
    if (this.childElementCount > 0) return;
    this.setAttribute("role", "listitem");
    this.tabIndex = -1;
    this.append(
      element("div", {}, element("div", { class: "point-head" }, this.chip, this.place), this.facts),
      element("div", { class: "point-actions" }, this.acceptButton, this.rejectButton),
      this.reason,
    );
    this.addEventListener("click", (event) => {
      if (this.row && !(/** @type {Element} */ (event.target).closest("button")))
        selectAndReveal(this.row.point.point_id);
    });
    this.addEventListener("focus", () => this.choose());
  }

  /** An unknown cut is resolved at once; a rejection may have a reason, which the queue asks for. */
  reject() {
    if (!this.row) return;
    if (isUnknown(this.row)) void reject(this.row, "");
    else this.dispatchEvent(new CustomEvent("reject", { bubbles: true }));
  }

  choose() {
    if (this.row) select(this.row.point.point_id);
  }

  /** Key of what is drawn. */
  drawn = "";

  /** @param {boolean} active Is the robot at this point? */
  mark(active) {
    this.classList.toggle("active", active);
  }

  /**
   * Skipped if nothing has changed: of thousands of points that arrive, one has.
   *
   * @param {PagePoint} row
   * @param {string} may Key of what is allowed now.
   */
  show(row, may) {
    this.row = row;
    const drawn = `${JSON.stringify(row)}\n${may}`;
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const { point, entry } = row;
    this.dataset.pointId = point.point_id;
    this.dataset.state = entry.state;
    setIcon(this.shape, entry.state);
    setText(this.word, labelOf(entry.state));
    setText(this.place, point.point_id);
    const thick = `${(2000 * point.radius).toFixed(1)} mm`;
    // Rounded down, so that a value shown as enough for "Accept all" is enough.
    const sure = `${Math.floor(100 * point.confidence + 1e-9)} %`;
    const planned = row.plan?.order ? [text("row.number", { order: row.plan.order }), cutTime(row.plan)].filter(Boolean).join(", ") : "";
    setText(
      this.facts,
      text(isUncertain(row) ? "row.facts_unsure" : "row.facts", { kept: point.nodes_kept, seen: point.nodes_seen, thick, sure }),
    );
    const kept = counted("point.keeps", point.nodes_seen, { kept: point.nodes_kept });
    this.facts.title = [text("row.hint", { kept, thick, sure }), planWords(row)].filter(Boolean).join("; ");
    setText(this.reason, [planned, reasonText(entry.reason), reasonText(point.reason)].filter(Boolean).join(" · "));
    this.reason.title = this.reason.textContent ?? "";
    const unknown = isUnknown(row);
    setEnabled(this.acceptButton, whyNotAccept(row), text(unknown ? "row.was_cut_hint" : "row.accept_hint"));
    setEnabled(this.rejectButton, whyNotReject(row), text(unknown ? "row.was_not_cut_hint" : "row.reject_hint"));
    this.acceptButton.ariaLabel = text(unknown ? "row.was_cut" : "row.accept_named", { point: point.point_id });
    this.rejectButton.ariaLabel = text(unknown ? "row.was_not_cut" : "row.reject_named", { point: point.point_id });
  }
}
customElements.define("rp-point", RpPoint);
