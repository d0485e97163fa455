// List of the pictures: which are labelled, and which are held out.

import { open, rows, show } from "../js/label/session.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setText } from "../js/views/dom.js";
import { setIcon } from "../js/views/icons.js";

class RpLabelList extends HTMLElement {
  connectedCallback() {
    const count = element("p", { class: "hint number" });
    const list = element("ul", { class: "label-pictures" });
    this.append(element("div", { class: "label-head" }, element("h2", { text: text("label.pictures") }), count), list);
    /** @type {Map<string, ReturnType<typeof made>>} */
    const shown = new Map();
    let chosen = "";
    drawOn([rows, open], () => {
      const all = rows.get();
      const done = all.filter((row) => row.labelled > 0).length;
      setText(count, all.length === 0 ? "" : text("label.count", { done, count: all.length }));
      for (const row of all) {
        const item = shown.get(row.name) ?? made(row.name);
        if (!shown.has(row.name)) list.append(item.line);
        shown.set(row.name, item);
        const percent = row.labelled > 0.995 && row.labelled < 1 ? 99 : Math.ceil(100 * row.labelled);
        const state = row.problem || (row.labelled === 0 ? text("label.none") : text("label.share", { percent }));
        setText(item.state, state);
        item.state.title = row.problem;
        item.button.classList.toggle("labelled", row.labelled > 0);
        setIcon(item.sign, row.problem ? "warning" : row.labelled > 0 ? "present" : "PROPOSED");
        item.out.hidden = row.split === "train";
        item.button.setAttribute("aria-current", String(row.name === open.get()?.name));
      }
      const now = open.get()?.name ?? "";
      if (now !== chosen) shown.get(now)?.line.scrollIntoView({ block: "nearest" });
      chosen = now;
    });
  }
}

/** @param {string} name */
function made(name) {
  const sign = element("span", { class: "shape" });
  const state = element("span", { class: "number" });
  const out = element("span", { class: "label-out", text: text("label.held-out") });
  const small = element("img", {
    attributes: { src: `api/pictures/${encodeURIComponent(name)}/small`, alt: "", loading: "lazy", decoding: "async" },
  });
  const words = element(
    "span",
    { class: "label-words" },
    element("strong", { text: name, attributes: { title: name } }),
    element("span", { class: "label-state" }, sign, state),
    out,
  );
  const button = element("button", { data: { picture: name }, onclick: () => void show(name) }, small, words);
  return { line: element("li", {}, button), button, sign, state, out };
}
customElements.define("rp-label-list", RpLabelList);
