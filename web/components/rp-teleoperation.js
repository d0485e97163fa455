// Moving the robot by hand: the switch, what is moved, how fast, and what is in the way.

import { whyNoTeleoperation } from "../allowed.js";
import { element, setEnabled, setText } from "../element.js";
import { holdButton } from "../hold-button.js";
import { icon } from "../icons.js";
import { link, now, pageState } from "../state.js";
import { drawOn } from "../store.js";
import { axes, hold, moving, setTeleoperating, showAxes, showMoving, teleoperating } from "../teleoperation.js";
import { nearWords } from "../words.js";
import "./rp-drive-pad.js";
import "./rp-joints.js";

/** Nearer than this (m) is worth a warning. */
const NEAR = 0.03;

class RpTeleoperation extends HTMLElement {
  connectedCallback() {
    const toggle = element(
      "button",
      { id: "teleop", attributes: { type: "button", "aria-pressed": "false" } },
      icon("TELEOP"),
      "Teleoperate",
    );
    toggle.addEventListener("click", () => setTeleoperating(!teleoperating.get()));
    const what = choice("What moves", moving, showMoving, [
      ["tool", "Tool", "The tool follows the gizmo, base and arm together"],
      ["base", "Base", "Drive; the arm stands"],
      ["joints", "Joints", "Turn one joint; the base stands"],
    ]);
    const frame = choice("Gizmo along", axes, showAxes, [
      ["tool", "tool", "Arrows along the tool's own axes"],
      ["base", "base", "Arrows ahead, left and up of the base"],
      ["world", "world", "Arrows along the row, across it and up"],
    ]);
    const speed = element("input", {
      id: "share",
      attributes: { type: "range", min: "10", max: "100", step: "10", value: "100", "aria-label": "Speed by hand in per cent" },
    });
    const percent = element("span", { class: "number", text: "100 %" });
    speed.addEventListener("input", () => hold.share.set(Number(speed.value) / 100));
    const pace = element("label", { class: "pace" }, "Speed", speed, percent);

    const holdWords = element("span", { text: "Hold to move" });
    const button = element(
      "button",
      { id: "hold", attributes: { type: "button", "aria-keyshortcuts": "H" } },
      holdWords,
      element("kbd", { text: "H" }),
    );
    holdButton(button, () => hold.press("button"), () => hold.release("button"));

    const pad = document.createElement("rp-drive-pad");
    const joints = document.createElement("rp-joints");
    const words = element("p", { class: "hint", attributes: { role: "status" } });
    this.append(toggle, what, pace, frame, button, pad, joints, words);

    drawOn([teleoperating, moving, axes, hold.holding, hold.share, pageState, link, now], () => {
      const on = teleoperating.get();
      const why = whyNoTeleoperation();
      const holding = hold.holding.get();
      const part = moving.get();
      setEnabled(toggle, why, on ? "Hide the gizmo" : "Show the gizmo at the tool");
      toggle.setAttribute("aria-pressed", String(on));
      setEnabled(button, hold.whyNot(), "The tool follows the gizmo while you hold");
      button.classList.toggle("held", holding);
      this.classList.toggle("on", on);
      what.hidden = pace.hidden = !on;
      frame.hidden = !on || part !== "tool";
      button.hidden = !on || part !== "tool";
      words.hidden = !on;
      pad.hidden = !on || part !== "base";
      joints.hidden = !on || part !== "joints";
      setText(holdWords, holding ? "Moving…" : "Hold to move");
      setText(percent, `${Math.round(100 * hold.share.get())} %`);
      const controller = pageState.get()?.controller ?? null;
      const held = (holding && controller?.held_by) || "";
      setText(words, held ? `${held[0]?.toUpperCase()}${held.slice(1)}.` : explanation(why, holding, part, nearWords(controller)));
      words.classList.toggle("warned", held !== "" || (controller?.near?.distance ?? 1) < NEAR);
    });
  }
}

/**
 * Buttons of which one is pressed.
 *
 * @template {string} T
 * @param {string} label
 * @param {import("../store.js").Signal<T>} chosen
 * @param {(value: T) => void} choose
 * @param {readonly (readonly [T, string, string])[]} values Each with its word and what it does.
 */
function choice(label, chosen, choose, values) {
  const buttons = values.map(([value, text, title]) => {
    const button = element("button", { text, data: { choice: value }, attributes: { type: "button", title } });
    button.addEventListener("click", () => choose(value));
    drawOn([chosen], () => button.setAttribute("aria-pressed", String(chosen.get() === value)));
    return button;
  });
  return element("div", { class: "choice", attributes: { role: "group", "aria-label": label } }, ...buttons);
}

/**
 * @param {string} why
 * @param {boolean} holding
 * @param {import("../teleoperation.js").Part} part
 * @param {string} near
 */
function explanation(why, holding, part, near) {
  if (why) return `${why}.`;
  if (holding) return near || (part === "tool" ? "The tool follows the gizmo. Let go to stop." : "Let go to stop.");
  if (part === "base") return "The base moves while you hold, and stops when you let go.";
  if (part === "joints") return "A joint turns while you hold + or −. The bar is its range.";
  return "Drag the gizmo: the tool follows while you drag, or while you hold the button or H. Let go and it stops.";
}
customElements.define("rp-teleoperation", RpTeleoperation);
