// The row at a glance, below the header: a bar for each vine, how many cuts are decided and done, and the time left.

import { timeLeft, vines } from "../js/control/progress.js";
import { durationWords } from "../js/state/format.js";
import { pageState, points } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, keepRows, setAttribute, setText } from "../js/views/dom.js";

class RpVines extends HTMLElement {
  connectedCallback() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("vines.label"));
    const list = element("ul");
    const words = element("p", { class: "number", attributes: { role: "status" } });
    this.append(list, words);
    const bars = keepRows(list, vineBar);
    drawOn([points, pageState], () => {
      const found = vines();
      bars(found.map((vine) => [String(vine.vine), vine]));
      setText(words, wordsOf(found));
    });
  }
}

/** @param {readonly import("../js/control/progress.js").VineProgress[]} all */
function wordsOf(all) {
  const sum = (/** @type {"done"|"count"} */ name) => all.reduce((total, vine) => total + vine[name], 0);
  if (sum("count") === 0) return text(points.get() ? "vines.none" : "screen.loading");
  const seconds = timeLeft();
  const left = seconds ? ` · ${text("vines.left", { time: durationWords(seconds).replaceAll(" ", "\u00a0") })}` : "";
  return text("vines.done", { done: sum("done"), count: sum("count") }) + left;
}

/** @param {string} vine Its number. */
function vineBar(vine) {
  const done = element("span", { class: "vine-done" });
  const decided = element("span", { class: "vine-decided" });
  const item = element(
    "li",
    { data: { vine } },
    element("span", { class: "vine-name", text: text("vines.vine", { vine }) }),
    element("span", { class: "vine-bar" }, decided, done),
  );
  return {
    item,
    /** @param {import("../js/control/progress.js").VineProgress} progress */
    show(progress) {
      const share = (/** @type {number} */ part) => `${(100 * part) / Math.max(1, progress.count)}%`;
      done.style.setProperty("width", share(progress.done));
      decided.style.setProperty("width", share(progress.decided));
      const words = text("vines.hint", { vine, count: progress.count, decided: progress.decided, done: progress.done });
      setAttribute(item, "title", words);
      setAttribute(item, "aria-label", words);
    },
  };
}
customElements.define("rp-vines", RpVines);
