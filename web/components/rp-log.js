// What happened, and why something was refused.

import { element, setText } from "../element.js";
import { icon } from "../icons.js";
import { log } from "../state.js";
import { drawOn } from "../store.js";
import { clockWords, inWords } from "../words.js";

/** @typedef {import("../messages.js").PageEvent} PageEvent */

const FILTERS = Object.freeze([
  ["info", "Everything"],
  ["warning", "Warnings and errors"],
  ["error", "Errors"],
]);

class RpLog extends HTMLElement {
  connectedCallback() {
    const filter = element("select", { id: "log-filter", attributes: { "aria-label": "Show in the log" } });
    for (const [value, words] of FILTERS) filter.append(element("option", { text: words, attributes: { value } }));
    const list = element("ol", {
      class: "lines",
      attributes: { role: "log", "aria-live": "polite", "aria-label": "Event log", tabindex: "0" },
    });
    const empty = element("p", { class: "empty" });
    this.id = "log";
    this.dataset.least = "info";
    this.append(element("div", { class: "panel-head" }, element("h2", { text: "Log" }), filter), list, empty);
    filter.addEventListener("change", () => {
      this.dataset.least = filter.value;
      draw();
      toEnd();
    });
    // Follow the newest line until somebody scrolls away from it; turning the screen is no such wish.
    let following = true;
    const toEnd = () => {
      list.scrollTop = list.scrollHeight;
    };
    list.addEventListener("scroll", () => {
      following = list.scrollHeight - list.scrollTop - list.clientHeight < 24;
    });
    new ResizeObserver(() => following && toEnd()).observe(list);

    /** @type {Map<PageEvent, HTMLElement>} */
    const rows = new Map();
    const draw = () => {
      const lines = log.get();
      const wanted = new Set(lines);
      for (const [line, row] of rows) {
        if (wanted.has(line)) continue;
        row.remove();
        rows.delete(line);
      }
      let previous = /** @type {HTMLElement|null} */ (null);
      for (const line of lines) {
        let row = rows.get(line);
        if (!row) {
          row = lineRow(line);
          rows.set(line, row);
          if (previous) previous.after(row);
          else list.prepend(row);
        }
        previous = row;
      }
      const left = lines.filter((line) => filter.value === "info" || line.severity === "error" || line.severity === filter.value);
      empty.hidden = left.length > 0;
      setText(empty, lines.length === 0 ? "Nothing has happened yet." : "Nothing of this severity.");
      if (following) toEnd();
    };
    drawOn([log], draw);
  }
}

/** @param {PageEvent} line */
function lineRow(line) {
  return element(
    "li",
    { data: { severity: line.severity } },
    element("time", { text: clockWords(line.wall_time) }),
    element("span", { class: "severity", attributes: { title: line.severity } }, icon(line.severity), line.severity),
    element("span", { class: "process", text: line.process }),
    element("span", { class: "text", text: inWords(line.text) }),
  );
}
customElements.define("rp-log", RpLog);
