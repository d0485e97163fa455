// The software stop button, always visible and on top.

import { multiRobot, stopProgress, stopRobot } from "../js/control/stop.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";

class RpStop extends HTMLElement {
  connectedCallback() {
    const label = element("span");
    const button = element(
      "button",
      {
        id: "stop",
        attributes: {
          "aria-keyshortcuts": "Space",
          title: text(multiRobot ? "stop.all_hint" : "stop.hint"),
        },
      },
      icon("ESTOP_LATCHED"),
      element(
        "span",
        { class: "stop-words" },
        label,
        element("small", { text: text(multiRobot ? "stop.all" : "stop.name") }),
        element("small", { class: "keyboard", text: text("stop.key") }),
      ),
    );
    // On pointerdown, so that a finger that slides off has still stopped the robot.
    button.addEventListener("pointerdown", (event) => {
      if (event.button === 0) void stopRobot("stop button");
    });
    // A click without a pointer: Enter, or assistive technology.
    button.addEventListener("click", (event) => {
      if (event.detail === 0) void stopRobot("stop button");
    });
    this.append(button);
    drawOn([stopProgress], () => setText(label, text(`stop.${stopProgress.get()}`)));
  }
}
customElements.define("rp-stop", RpStop);
