// Panel with the alarms, errors first, each with what to do.

import { clockWords } from "../js/state/format.js";
import { link, now, pageState, points } from "../js/state/page-state.js";
import { partsOf, reasonText, severityOf } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { counted, text } from "../js/state/texts.js";
import { alarms } from "../js/views/alarms.js";
import { element, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";

/** A cleared alarm stays for this time (ms), so that it can be read and the list does not flicker. */
const LINGER_MS = 2000;

class RpAlarms extends HTMLElement {
  connectedCallback() {
    this.id = "alarms";
    const count = element("span", { class: "alarm-count number" });
    const list = element("ul", { class: "alarm-list", attributes: { tabindex: "0", "aria-label": text("alarms.title") } });
    const live = element("div", { class: "live", attributes: { role: "log", "aria-live": "assertive" } }, list);
    const empty = element("p", { class: "empty" }, element("span", { class: "calm" }, icon("present"), text("alarms.none")));
    this.append(element("div", { class: "panel-head" }, element("h2", { text: text("alarms.title") }), count), live, empty);
    /** @type {Map<string, { row: HTMLElement, text: Element, act: HTMLElement, seen: number }>} */
    const rows = new Map();
    drawOn([now, pageState, points, link], () => {
      const found = alarms();
      const at = performance.now();
      for (const { reason, steps } of found) {
        const known = rows.get(reason.code) ?? newRow(reason);
        rows.set(reason.code, known);
        known.seen = at;
        const parts = partsOf(reason);
        setText(known.text, parts.text);
        setText(known.act, [parts.act, ...steps.map(reasonText)].filter(Boolean).map(sentence).join(" "));
        known.act.dataset.steps = steps.map((step) => step.code).join(" ");
      }
      for (const [code, { row, seen }] of rows) {
        // Its advice is hidden.
        row.classList.toggle("gone", seen < at);
        if (at - seen < LINGER_MS) continue;
        row.remove();
        rows.delete(code);
      }
      let previous = /** @type {Element|null} */ (null);
      for (const { row } of [...rows.values()].sort((a, b) => rank(a.row) - rank(b.row))) {
        if (row !== (previous ? previous.nextElementSibling : list.firstElementChild)) {
          if (previous) previous.after(row);
          else list.prepend(row);
        }
        previous = row;
      }
      empty.hidden = rows.size > 0;
      this.dataset.worst = found[0] ? severityOf(found[0].reason) : "";
      setText(count, rows.size > 0 ? counted("alarms.count", rows.size) : "");
    });
  }
}

/** @param {HTMLElement} row */
function rank(row) {
  return Number(row.dataset.severity === "warning");
}

/** @param {string} words */
function sentence(words) {
  return `${words.charAt(0).toUpperCase()}${words.slice(1)}.`;
}

/** @param {import("../js/state/reasons.js").Reason} reason */
function newRow(reason) {
  const severity = severityOf(reason);
  const words = element("strong");
  const act = element("span", { class: "act" });
  const since = element("time", { text: clockWords(Date.now() / 1000), attributes: { title: text("alarms.since") } });
  const row = element(
    "li",
    { data: { severity, code: reason.code } },
    icon(severity),
    element("span", { class: "alarm-words" }, words, act),
    since,
  );
  return { row, text: words, act, seen: 0 };
}
customElements.define("rp-alarms", RpAlarms);
