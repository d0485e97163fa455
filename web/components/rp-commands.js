// Buttons for the robot's commands. Only those that the controller would accept are enabled.

import { whyNot } from "../js/control/allowed.js";
import { ask } from "../js/link/api.js";
import { link, now, pageState, points } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { dropDown, element, setEnabled } from "../js/views/dom.js";

/**
 * @type {readonly (readonly [id: string, intent: string, word: string, hint:
 * string])[]}
 */
const BUTTONS = Object.freeze([
  ["arm", "Arm", "Arm", "Switch the drives on; nothing moves yet"],
  ["survey", "Survey", "Survey", "Drive along the row and look at every vine; nothing is cut"],
  ["start", "Start", "Start", "Work through the accepted points"],
  ["pause", "Pause", "Pause", "Stop working and hold still"],
  ["resume", "Resume", "Resume", "Leave Paused; nothing moves until Start"],
  ["home", "Home", "Home", "Bring the arm back to the survey posture"],
  ["acknowledge", "Acknowledge", "Acknowledge", "The cause has been seen to"],
]);

/** Lengths of a survey (m). */
const DISTANCES = Object.freeze([1, 2, 4, 8, 15, 30, 60, 120]);
const USUAL_DISTANCE = 4;

class RpCommands extends HTMLElement {
  connectedCallback() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", "Robot");
    const distance = surveyDistance();
    for (const [id, intent, word, hint] of BUTTONS) {
      const button = element("button", { id, text: word });
      button.addEventListener("click", () => {
        void ask(word, `api/${id}`, intent === "Survey" ? { distance: Number(distance.value) } : {});
      });
      this.append(button);
      if (intent === "Survey") this.append(distance);
      drawOn([pageState, points, link, now], () => setEnabled(button, whyNot(intent), hint));
    }
  }
}

function surveyDistance() {
  const attributes = {
    "aria-label": "How far ahead the survey goes",
    title: "How far ahead along the row the survey goes",
  };
  const select = dropDown(
    { id: "survey-distance", attributes },
    DISTANCES.map((metres) => [String(metres), `${metres} m`]),
  );
  select.value = String(USUAL_DISTANCE);
  return select;
}
customElements.define("rp-commands", RpCommands);
