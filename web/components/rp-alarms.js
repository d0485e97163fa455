// Panel with the alarms, errors first, each with what to do.

import { clockWords, counted } from "../js/state/format.js";
import { link, now, pageState, points } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { alarms } from "../js/views/alarms.js";
import { element, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";

/** A cleared alarm stays for this time (ms), so that it can be read and the list does not flicker. */
const LINGER_MS = 2000;

class RpAlarms extends HTMLElement {
  connectedCallback() {
    this.id = "alarms";
    const count = element("span", { class: "alarm-count number" });
    const list = element("ul", { class: "alarm-list", attributes: { tabindex: "0", "aria-label": "Alarms" } });
    const live = element("div", { class: "live", attributes: { role: "log", "aria-live": "assertive" } }, list);
    const empty = element("p", { class: "empty" }, element("span", { class: "calm" }, icon("present"), "No alarms"));
    this.append(element("div", { class: "panel-head" }, element("h2", { text: "Alarms" }), count), live, empty);
    /** @type {Map<string, { row: HTMLElement, text: Element, act: Element, seen: number }>} */
    const rows = new Map();
    drawOn([now, pageState, points, link], () => {
      const found = alarms();
      const at = performance.now();
      for (const each of found) {
        const known = rows.get(each.id) ?? newRow(each.severity);
        rows.set(each.id, known);
        known.seen = at;
        setText(known.text, each.text);
        setText(known.act, each.act);
      }
      for (const [id, { row, seen }] of rows) {
        // Its advice is hidden.
        row.classList.toggle("gone", seen < at);
        if (at - seen < LINGER_MS) continue;
        row.remove();
        rows.delete(id);
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
      this.dataset.worst = found[0]?.severity ?? "";
      setText(count, rows.size > 0 ? counted(rows.size, "alarm") : "");
    });
  }
}

/** @param {HTMLElement} row */
function rank(row) {
  return Number(row.dataset.severity === "warning");
}

/** @param {"error"|"warning"} severity */
function newRow(severity) {
  const text = element("strong");
  const act = element("span", { class: "act" });
  const since = element("time", { text: clockWords(Date.now() / 1000), attributes: { title: "Since" } });
  const row = element(
    "li",
    { data: { severity } },
    icon(severity),
    element("span", { class: "alarm-words" }, text, act),
    since,
  );
  return { row, text, act, seen: 0 };
}
customElements.define("rp-alarms", RpAlarms);
