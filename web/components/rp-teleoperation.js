// Moving the tool by hand: the switch that shows the gizmo, and the button to hold.

import { whyNoTeleoperation } from "../allowed.js";
import { element, setEnabled, setText } from "../element.js";
import { icon } from "../icons.js";
import { link, now, pageState, showToast } from "../state.js";
import { drawOn } from "../store.js";
import { hold, setTeleoperating, teleoperating } from "../teleoperation.js";

class RpTeleoperation extends HTMLElement {
  connectedCallback() {
    const toggle = element(
      "button",
      { id: "teleop", attributes: { type: "button", "aria-pressed": "false" } },
      icon("TELEOP"),
      "Teleoperate",
    );
    toggle.addEventListener("click", () => setTeleoperating(!teleoperating.get()));

    const holdWords = element("span", { text: "Hold to move" });
    const button = element(
      "button",
      { id: "hold", attributes: { type: "button", "aria-keyshortcuts": "H" } },
      holdWords,
      element("kbd", { text: "H" }),
    );
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      button.setPointerCapture(event.pointerId);
      const why = hold.press("button");
      if (why) showToast("warning", why);
    });
    const release = () => hold.release("button");
    for (const name of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) button.addEventListener(name, release);
    // A long touch must not become a menu that swallows the release.
    button.addEventListener("contextmenu", (event) => event.preventDefault());
    button.addEventListener("keydown", (event) => {
      if (event.code === "Enter" && !event.repeat) hold.press("button");
    });
    button.addEventListener("keyup", (event) => {
      if (event.code === "Enter") release();
    });

    const words = element("p", { class: "hint", attributes: { role: "status" } });
    this.append(toggle, button, words);

    drawOn([teleoperating, hold.holding, pageState, link, now], () => {
      const on = teleoperating.get();
      const why = whyNoTeleoperation();
      const holding = hold.holding.get();
      setEnabled(toggle, why, on ? "Hide the gizmo" : "Show the gizmo at the tool");
      toggle.setAttribute("aria-pressed", String(on));
      setEnabled(button, why || (on ? "" : "Switch on Teleoperate first"), "The tool follows the gizmo while you hold");
      button.classList.toggle("held", holding);
      setText(holdWords, holding ? "Moving…" : "Hold to move");
      setText(words, explanation(on, why, holding));
    });
  }
}

/**
 * @param {boolean} on
 * @param {string} why
 * @param {boolean} holding
 */
function explanation(on, why, holding) {
  if (why) return `${why}.`;
  if (!on) return "Shows a gizmo at the tool, to drag where the tool should go.";
  if (holding) return "The tool follows the gizmo. Let go to stop.";
  return "Drag the gizmo: the tool follows while you drag, or while you hold the button or H. Let go and it stops.";
}
customElements.define("rp-teleoperation", RpTeleoperation);
