// Head of the labelling page: the picture, what it is for, and what is saved.

import { assign, listed, loadOther, open, problem, rows, saveMine, saving, step } from "../js/label/session.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setAttribute, setText } from "../js/views/dom.js";
import { icon, setIcon } from "../js/views/icons.js";

const ICONS = Object.freeze({ nothing: "info", unsaved: "info", saved: "present", failed: "warning", conflict: "error" });

class RpLabelBar extends HTMLElement {
  connectedCallback() {
    const back = arrow("‹", "label.previous", -1);
    const on = arrow("›", "label.next", 1);
    const name = element("strong", { class: "label-name" });
    const place = element("span", { class: "hint number" });
    const split = element("div", { class: "label-split", attributes: { role: "group", "aria-label": text("label.split") } });
    for (const each of /** @type {const} */ (["train", "held-out"])) {
      const button = element("button", {
        text: text(`label.${each}`),
        data: { split: each },
        attributes: { title: text(`label.${each}.hint`) },
        onclick: () => void assign(each),
      });
      split.append(button);
    }
    const sign = element("span", { class: "shape" }, icon("info"));
    const words = element("span", { attributes: { role: "status" } });
    const saved = element("span", { class: "label-saved" }, sign, words);
    const mine = element("button", { text: text("label.save_mine"), onclick: () => void saveMine() });
    const other = element("button", { text: text("label.load_other"), onclick: () => void loadOther() });
    const trouble = element("p", { class: "problem label-problem", attributes: { role: "alert" } });
    const title = element("h1", { text: text("label.title") });
    const pages = element("div", { class: "label-pages" }, back, element("div", {}, name, place), on);
    this.append(title, pages, split, mine, other, saved, trouble);

    drawOn([open, rows, listed], () => {
      const [all, now] = [rows.get(), open.get()];
      const at = all.findIndex((row) => row.name === now?.name);
      setText(name, now?.name ?? "–");
      setText(place, now ? text("label.place", { number: at + 1, count: all.length }) : "");
      for (const button of split.children) {
        const chosen = button instanceof HTMLElement && button.dataset.split === all[at]?.split;
        button.setAttribute("aria-pressed", String(chosen));
      }
      split.hidden = now === null;
      setAttribute(back, "aria-disabled", String(at <= 0));
      setAttribute(on, "aria-disabled", String(at < 0 || at + 1 >= all.length));
    });
    drawOn([saving, open, listed], () => {
      const { state, words: told } = saving.get();
      const [now, all] = [open.get(), listed.get()];
      const file = now && all ? `${all.masks}/${now.name.replace(/\.[^.]*$/, "")}.png` : "";
      this.dataset.saving = state;
      setIcon(sign, ICONS[state]);
      setText(words, state === "nothing" ? text("label.autosave") : told);
      saved.title = file && all ? text("label.file", { file: `${all.folder}/${file}` }) : "";
      mine.hidden = other.hidden = state !== "conflict";
    });
    drawOn([problem], () => {
      setText(trouble, problem.get());
      trouble.hidden = problem.get() === "";
    });
  }
}

/**
 * @param {string} sign
 * @param {"label.previous"|"label.next"} key
 * @param {number} by
 */
function arrow(sign, key, by) {
  const words = key === "label.next" ? text("label.next") : text("label.previous");
  return element("button", {
    class: "quiet label-arrow",
    text: sign,
    attributes: { "aria-label": words, title: words },
    onclick: () => step(by),
  });
}
customElements.define("rp-label-bar", RpLabelBar);
