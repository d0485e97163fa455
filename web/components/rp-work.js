// The screen for the work: what the robot does now, and the cuts with their states.

import { selectAndReveal } from "../js/control/selection.js";
import { pageState, points, selected } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { labelOf, text } from "../js/state/texts.js";
import { element, setAttribute, setText } from "../js/views/dom.js";
import { setIcon } from "../js/views/icons.js";

/** @typedef {import("../js/link/messages.js").PagePoint} PagePoint */

class RpWork extends HTMLElement {
  connectedCallback() {
    const words = element("p", { class: "work-now", attributes: { role: "status" } });
    const list = element("ol", { class: "cuts", attributes: { "aria-label": text("work.cuts") } });
    const empty = element("p", { class: "empty", text: text("work.none") });
    this.append(words, list, empty);
    drawOn([pageState], () => setText(words, reasonText(pageState.get()?.controller?.reason)));
    /** @type {Map<string, ReturnType<typeof cutRow>>} */
    const rows = new Map();
    drawOn([points, selected], () => {
      const wanted = (points.get()?.points ?? []).filter((row) => row.entry.state !== "REJECTED");
      const kept = new Set(wanted.map((row) => row.point.point_id));
      for (const [name, row] of rows) {
        if (kept.has(name)) continue;
        row.item.remove();
        rows.delete(name);
      }
      let previous = /** @type {Element|null} */ (null);
      for (const each of wanted) {
        const name = each.point.point_id;
        const row = rows.get(name) ?? cutRow(name);
        rows.set(name, row);
        row.show(each);
        if (row.item !== (previous ? previous.nextElementSibling : list.firstElementChild)) {
          if (previous) previous.after(row.item);
          else list.prepend(row.item);
        }
        previous = row.item;
      }
      empty.hidden = wanted.length > 0;
    });
  }
}

/** @param {string} name */
function cutRow(name) {
  const shape = element("span", { class: "shape" });
  const [place, state] = [element("span", { class: "cut-place" }), element("span", { class: "cut-state" })];
  const button = element("button", { class: "quiet", onclick: () => selectAndReveal(name) }, shape, place, state);
  const item = element("li", { data: { cut: name } }, button);
  return {
    item,
    /** @param {PagePoint} row */
    show({ point, entry }) {
      item.dataset.state = entry.state;
      setIcon(shape, entry.state);
      setText(place, text("work.place", { vine: point.vine, spur: point.spur }));
      setText(state, labelOf(entry.state));
      setAttribute(button, "aria-current", selected.get() === name ? "true" : "");
    },
  };
}
customElements.define("rp-work", RpWork);
