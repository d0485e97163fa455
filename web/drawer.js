// What is opened beside the queue, over the view: charts, or the report. One at a time.

import { element } from "./element.js";
import { drawOn, signal } from "./store.js";

/** @typedef {"charts"|"report"} Sheet */

/** What is open now; empty when nothing is. */
export const drawer = signal(/** @type {Sheet|""} */ (""));

/**
 * A button that opens a sheet and closes it again.
 *
 * @param {Sheet} sheet
 * @param {string} words
 */
export function drawerButton(sheet, words) {
  const button = element("button", {
    class: "quiet opens",
    text: words,
    attributes: { type: "button", "aria-controls": "drawer" },
    data: { opens: sheet },
    onclick: () => drawer.set(drawer.get() === sheet ? "" : sheet),
  });
  drawOn([drawer], () => button.setAttribute("aria-expanded", String(drawer.get() === sheet)));
  return button;
}
