// A small window over the page. Unlike a modal one it leaves everything else usable, the stop above all.

import { text } from "../state/texts.js";
import { element } from "./dom.js";

/**
 * @param {string} id
 * @param {string} title
 * @param {...Node} content
 */
export function sheet(id, title, ...content) {
  const close = element("button", { class: "quiet", text: text("sheet.close"), onclick: () => box.close() });
  const head = element("div", { class: "panel-head" }, element("h2", { id: `${id}-title`, text: title }), close);
  const box = element("dialog", { id, class: "sheet", attributes: { "aria-labelledby": `${id}-title` } }, head, ...content);
  box.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    event.stopPropagation();
    box.close();
  });
  document.body.append(box);
  return box;
}

/**
 * Open a sheet in place of another one.
 *
 * @param {HTMLDialogElement} box
 */
export function openSheet(box) {
  for (const other of document.querySelectorAll("dialog")) if (other !== box) other.close();
  box.show();
}
