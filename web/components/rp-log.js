// The log, with filters by severity, process and text.

import { PROCESSES } from "../js/link/messages.js";
import { clockWords } from "../js/state/format.js";
import { log } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { labelOf, text } from "../js/state/texts.js";
import { dropDown, element, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";

/** @typedef {import("../js/link/messages.js").PageEvent} PageEvent */

const LEAST = Object.freeze(["info", "warning", "error"]);
/** With the page's own lines. */
const FROM = Object.freeze(["all", ...PROCESSES, "page"]);

class RpLog extends HTMLElement {
  connectedCallback() {
    // Moved among the panels.
    if (this.childElementCount > 0) return;
    const least = dropDown(
      { id: "log-filter", attributes: { "aria-label": text("log.least_label") } },
      LEAST.map((each) => [each, text(`log.least.${each}`)]),
    );
    const from = dropDown({ id: "log-process", attributes: { "aria-label": text("log.process_label") } }, FROM.map((each) => [each, text(`process.${each}`)]));
    const words = element("input", {
      id: "log-words",
      attributes: { type: "search", placeholder: text("log.find"), "aria-label": text("log.find_label"), autocomplete: "off" },
    });
    const list = element("ol", { class: "lines", attributes: { "aria-label": text("log.label"), tabindex: "0" } });
    const live = element("div", { class: "live", attributes: { role: "log", "aria-live": "polite" } }, list);
    const empty = element("p", { class: "empty" });
    this.id = "log";
    const tools = element("div", { class: "log-tools" }, words, from, least);
    this.append(tools, live, empty);

    // Follow the newest line until the operator scrolls up; a resize does not count.
    let following = true;
    const toEnd = () => {
      list.scrollTop = list.scrollHeight;
    };
    let width = 0;
    list.addEventListener("scroll", () => {
      // A list that becomes narrower scrolls by itself.
      if (width === list.clientWidth) following = list.scrollHeight - list.scrollTop - list.clientHeight < 24;
    });
    new ResizeObserver(() => {
      width = list.clientWidth;
      if (following) toEnd();
    }).observe(list);

    /** @param {PageEvent} line */
    const isWanted = (line) =>
      (least.value === "info" || line.severity === "error" || line.severity === least.value) &&
      (from.value === "all" || line.process === from.value) &&
      wordsOf(line).toLowerCase().includes(words.value.trim().toLowerCase());

    /** @type {Map<PageEvent, HTMLElement>} */
    const rows = new Map();
    const draw = () => {
      const lines = log.get();
      const kept = new Set(lines);
      for (const [line, row] of rows) {
        if (kept.has(line)) continue;
        row.remove();
        rows.delete(line);
      }
      let previous = /** @type {HTMLElement|null} */ (null);
      let left = 0;
      for (const line of lines) {
        let row = rows.get(line);
        if (!row) {
          row = lineRow(line);
          rows.set(line, row);
          if (previous) previous.after(row);
          else list.prepend(row);
        }
        const wanted = isWanted(line);
        if (row.hidden === wanted) row.hidden = !wanted;
        left += Number(wanted);
        previous = row;
      }
      empty.hidden = left > 0;
      setText(empty, text(lines.length === 0 ? "log.nothing" : "log.none_like_that"));
      if (following) toEnd();
    };
    for (const control of [least, from, words]) {
      control.addEventListener("input", () => {
        draw();
        toEnd();
      });
    }
    drawOn([log], draw);
  }
}

/** @param {PageEvent} line */
function wordsOf(line) {
  return line.reason ? reasonText(line.reason) : line.text;
}

/** @param {PageEvent} line */
function lineRow(line) {
  return element(
    "li",
    { data: { severity: line.severity } },
    element("time", { text: clockWords(line.wall_time) }),
    element("span", { class: "severity", attributes: { title: text(`severity.${line.severity}`) } }, icon(line.severity), text(`severity.${line.severity}`)),
    element("span", { class: "process", text: labelOf(line.process) }),
    element("span", { class: "text", text: wordsOf(line) }),
  );
}
customElements.define("rp-log", RpLog);
