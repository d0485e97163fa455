// What the operator may ask of the whole robot. Only what the controller would take is enabled.

import { whyNot } from "../allowed.js";
import { ask } from "../api.js";
import { element, setEnabled } from "../element.js";
import { link, now, pageState, points } from "../state.js";
import { drawOn } from "../store.js";

/** @type {readonly (readonly [id: string, intent: string, word: string, hint: string])[]} */
const BUTTONS = Object.freeze([
  ["arm", "Arm", "Arm", "Switch the drives on; nothing moves yet"],
  ["survey", "Survey", "Survey", "Drive along the row and look at every vine; nothing is cut"],
  ["start", "Start", "Start", "Work through the accepted points"],
  ["pause", "Pause", "Pause", "Stop working and hold still"],
  ["resume", "Resume", "Resume", "Leave Paused; nothing moves until Start"],
  ["home", "Home", "Home", "Bring the arm back to the survey posture"],
  ["acknowledge", "Acknowledge", "Acknowledge", "The cause has been seen to"],
]);

class RpControls extends HTMLElement {
  connectedCallback() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", "Robot");
    for (const [id, intent, word, hint] of BUTTONS) {
      const button = element("button", { id, text: word, attributes: { type: "button" } });
      button.addEventListener("click", () => void ask(word, `/api/${id}`));
      this.append(button);
      drawOn([pageState, points, link, now], () => setEnabled(button, whyNot(intent), hint));
    }
  }
}
customElements.define("rp-controls", RpControls);
