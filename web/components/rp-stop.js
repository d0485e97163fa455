// The software stop button, always visible and on top.

import { multiRobot, stopProgress, stopRobot } from "../js/control/stop.js";
import { drawOn } from "../js/state/signals.js";
import { element, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";

/** @type {Readonly<Record<import("../js/control/stop.js").StopProgress, string>>} */
const WORDS = Object.freeze({
  idle: "Software stop",
  sending: "Stopping…",
  sent: "Software stop",
  failed: "Not reached — press again",
});

class RpStop extends HTMLElement {
  connectedCallback() {
    const label = element("span");
    const button = element(
      "button",
      {
        id: "stop",
        attributes: {
          "aria-keyshortcuts": "Space",
          title: `Stops base and arm${multiRobot ? " of every robot" : ""}. Space bar does the same.`,
        },
      },
      icon("ESTOP_LATCHED"),
      element(
        "span",
        { class: "stop-words" },
        label,
        element("small", { text: multiRobot ? "all robots · space bar" : "space bar" }),
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
    drawOn([stopProgress], () => setText(label, WORDS[stopProgress.get()]));
  }
}
customElements.define("rp-stop", RpStop);
