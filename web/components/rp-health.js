// Whether robot, camera and link are there, in the header. The processes behind them are on the screen for engineers.

import { ageWords } from "../js/state/format.js";
import { isLive, isOpening, link, now, pageState, roundTrip, staleWords, stateAge } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setText } from "../js/views/dom.js";
import { icon, setIcon } from "../js/views/icons.js";

class RpHealth extends HTMLElement {
  connectedCallback() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("health.label"));
    this.append(part("robot", ["bridge", "controller"]), part("camera", ["bridge", "perception"]), linkChip());
  }
}

/**
 * @param {"robot"|"camera"} name
 * @param {readonly import("../js/link/messages.js").Process[]} processes All of which it needs.
 */
function part(name, processes) {
  const shape = element("span", { class: "shape" });
  const words = element("span", { class: "health-name", text: text(`health.${name}`) });
  const chip = element("span", { class: "health", data: { part: name } }, shape, words);
  drawOn([pageState, link, now], () => {
    const unknown = isOpening() || !isLive("server");
    const live = processes.every(isLive);
    chip.dataset.present = unknown ? "unknown" : String(live);
    setIcon(shape, unknown ? "UNKNOWN" : live ? "present" : "gone");
    chip.title = live ? text("presence.there", { process: text(`health.${name}`) }) : staleWords(...processes);
  });
  return chip;
}

function linkChip() {
  const words = element("span", { class: "number" });
  const chip = element("span", { id: "link", class: "link", attributes: { title: text("link.hint") } }, icon("link"), words);
  drawOn([roundTrip, now, link, pageState], () => {
    const age = stateAge();
    const trip = roundTrip.get();
    const open = link.get().status === "open";
    const opening = isOpening();
    const quality = !open || age === null || age > 1 ? "bad" : (trip ?? 0) > 200 || age > 0.5 ? "poor" : "good";
    chip.dataset.quality = opening ? "" : quality;
    const told = open && trip !== null ? `${trip.toFixed(0)} ms` : text(opening ? "link.connecting" : "link.none");
    setText(words, open && age !== null && age > 1 ? text("link.age", { age: ageWords(age) }) : told);
  });
  return chip;
}
customElements.define("rp-health", RpHealth);
