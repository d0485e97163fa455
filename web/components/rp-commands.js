// Buttons for the robot's commands. Only those that the controller would accept are enabled.

import { whyNot } from "../js/control/allowed.js";
import { ask } from "../js/link/api.js";
import { link, now, pageState, points } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { dropDown, element, setEnabled } from "../js/views/dom.js";

const COMMANDS = Object.freeze(["Arm", "Survey", "Start", "Pause", "Resume", "Home", "Acknowledge"]);

/** Lengths of a survey (m). */
const DISTANCES = Object.freeze([1, 2, 4, 8, 15, 30, 60, 120]);
const USUAL_DISTANCE = 4;

class RpCommands extends HTMLElement {
  connectedCallback() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("command.label"));
    const distance = surveyDistance();
    for (const command of COMMANDS) {
      const [id, word] = [command.toLowerCase(), text(`command.${command}`)];
      const button = element("button", { id, text: word });
      button.addEventListener("click", () => {
        void ask(word, `api/${id}`, command === "Survey" ? { distance: Number(distance.value) } : {});
      });
      this.append(button);
      if (command === "Survey") this.append(distance);
      drawOn([pageState, points, link, now], () => setEnabled(button, whyNot(command), text(`command.${command}.hint`)));
    }
  }
}

function surveyDistance() {
  const attributes = {
    "aria-label": text("command.distance"),
    title: text("command.distance_hint"),
  };
  const select = dropDown(
    { id: "survey-distance", attributes },
    DISTANCES.map((metres) => [String(metres), `${metres} m`]),
  );
  select.value = String(USUAL_DISTANCE);
  return select;
}
customElements.define("rp-commands", RpCommands);
