// The row at a glance, below the header: a bar for each vine, how many cuts are decided and done, and the time left.

import { vines } from "../js/control/progress.js";
import { durationWords } from "../js/state/format.js";
import { points } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setAttribute, setText } from "../js/views/dom.js";

class RpVines extends HTMLElement {
  connectedCallback() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("vines.label"));
    const list = element("ul");
    const words = element("p", { class: "number", attributes: { role: "status" } });
    this.append(list, words);
    /** @type {Map<number, ReturnType<typeof vineBar>>} */
    const bars = new Map();
    drawOn([points], () => {
      const found = vines();
      const kept = new Set(found.map((each) => each.vine));
      for (const [vine, bar] of bars) {
        if (kept.has(vine)) continue;
        bar.item.remove();
        bars.delete(vine);
      }
      for (const vine of found) {
        const bar = bars.get(vine.vine) ?? vineBar(vine.vine);
        bars.set(vine.vine, bar);
        bar.show(vine);
        // In the order of the row.
        list.append(bar.item);
      }
      setText(words, wordsOf(found));
    });
  }
}

/** @param {readonly import("../js/control/progress.js").VineProgress[]} all */
function wordsOf(all) {
  const sum = (/** @type {"done"|"count"} */ name) => all.reduce((total, vine) => total + vine[name], 0);
  if (sum("count") === 0) return text("vines.none");
  const plan = points.get()?.plan;
  const left = plan?.state === "valid" && plan.duration_s > 0 ? ` · ${text("vines.left", { time: durationWords(plan.duration_s) })}` : "";
  return text("vines.done", { done: sum("done"), count: sum("count") }) + left;
}

/** @param {number} vine */
function vineBar(vine) {
  const done = element("span", { class: "vine-done" });
  const decided = element("span", { class: "vine-decided" });
  const item = element(
    "li",
    { data: { vine: String(vine) } },
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
