// The saved postures: choose one to see and check it, save the present one, delete.

import { aim, goal } from "../js/control/posture-goal.js";
import { ask } from "../js/link/api.js";
import { pageState } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { joined, text } from "../js/state/texts.js";
import { element, setAttribute } from "../js/views/dom.js";

/** Longest name that the controller takes. */
const LONGEST = 40;

class RpPostures extends HTMLElement {
  connectedCallback() {
    const list = element("ul", { class: "postures", attributes: { "aria-label": text("posture.list") } });
    const name = element("input", {
      id: "posture-name",
      attributes: {
        maxlength: String(LONGEST),
        autocomplete: "off",
        placeholder: text("posture.name"),
        "aria-label": text("posture.name_label"),
      },
    });
    const save = element("button", { id: "save-posture", text: text("posture.save"), attributes: { type: "submit" } });
    const form = element("form", { class: "save-posture" }, name, save);
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      if (await ask(text("posture.save"), "api/postures/save", { posture: name.value.trim() })) name.value = "";
      else name.focus();
    });
    this.append(list, form);
    let drawn = "";
    drawOn([pageState, goal], () => {
      const postures = pageState.get()?.controller?.postures ?? [];
      const key = JSON.stringify(postures);
      if (key !== drawn) {
        drawn = key;
        list.replaceChildren(...postures.map(item));
      }
      const chosen = goal.get()?.name;
      for (const button of list.querySelectorAll(".posture")) {
        setAttribute(button, "aria-pressed", String(button.textContent === joined(chosen ?? "")));
      }
    });
  }
}
customElements.define("rp-postures", RpPostures);

/** @param {import("../js/link/messages.js").SavedPosture} posture */
function item({ name, angles, user }) {
  const words = user === "" ? text(`posture.own.${name}`) : name;
  const choose = element("button", { class: "posture", text: words, onclick: () => aim(words, angles) });
  if (user === "") return element("li", {}, choose);
  const label = text("posture.delete", { name });
  const remove = element("button", { class: "delete", text: "×", attributes: { "aria-label": label, title: label } });
  remove.addEventListener("click", () => void ask(label, "api/postures/delete", { posture: name }));
  return element("li", {}, choose, remove);
}
