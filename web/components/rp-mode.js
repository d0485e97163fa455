// The mode with its phase.

import { isLive, link, now, pageState } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setAttribute, setText } from "../js/views/dom.js";
import { setIcon } from "../js/views/icons.js";

class RpMode extends HTMLElement {
  connectedCallback() {
    this.setAttribute("role", "status");
    this.setAttribute("aria-label", text("mode.label"));
    const shape = element("span", { class: "shape" });
    const [word, phase] = [element("span"), element("span", { class: "phase" })];
    const chip = element("span", { id: "mode", class: "chip mode", data: { mode: "" } }, shape, element("span", { class: "word" }, word, phase));
    this.append(chip);
    drawOn([pageState, link, now], () => {
      const controller = pageState.get()?.controller ?? null;
      const mode = controller?.mode ?? "";
      chip.dataset.mode = mode;
      chip.classList.toggle("stale", !isLive("controller"));
      setIcon(shape, mode || "UNKNOWN");
      setText(word, text(`mode.${mode || "none"}`));
      const words = controller?.phase ? ` · ${text(`phase.${controller.phase}`)}` : "";
      setText(phase, words);
      setAttribute(chip, "title", reasonText(controller?.reason));
    });
  }
}
customElements.define("rp-mode", RpMode);
