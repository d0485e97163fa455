// The processes and since when one is gone.

import { PROCESSES } from "../js/link/messages.js";
import { ageWords } from "../js/state/format.js";
import { isLive, isOpening, link, now, pageState, processAge } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setText } from "../js/views/dom.js";
import { setIcon } from "../js/views/icons.js";

class RpProcesses extends HTMLElement {
  connectedCallback() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("presence.label"));
    this.append(...PROCESSES.map(presence));
  }
}

/** @param {import("../js/link/messages.js").Process} process */
function presence(process) {
  const name = text(`process.${process}`);
  const shape = element("span", { class: "shape" });
  const age = element("span", { class: "age" });
  const words = element("span", { class: "process-name", text: name });
  const chip = element("span", { class: "presence", data: { process, present: "false" } }, shape, words, age);
  drawOn([pageState, link, now], () => {
    const live = isLive(process);
    // A silent server says nothing about the others.
    const unknown = process === "server" ? isOpening() : !isLive("server");
    const seconds = processAge(process);
    const since = seconds === null ? text("presence.unseen") : text("presence.gone", { age: ageWords(seconds) });
    chip.dataset.present = unknown ? "unknown" : String(live);
    setIcon(shape, unknown ? "UNKNOWN" : live ? "present" : "gone");
    setText(age, live || unknown ? "" : since);
    chip.title = unknown
      ? text(isOpening() ? "presence.not_heard" : "presence.unknown", { process: name })
      : live
        ? text("presence.there", { process: name })
        : text("presence.told", { process: name, words: since });
  });
  return chip;
}
customElements.define("rp-processes", RpProcesses);
