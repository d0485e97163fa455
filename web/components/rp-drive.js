// The screen for motion by hand: what moves, how fast, and the controls of tool, base, joints and saved postures.

import { whyNoTeleoperation } from "../js/control/allowed.js";
import { arrived, go, goal, whyNoGoing } from "../js/control/posture-goal.js";
import { PARTS, axes, hold, moving, setTeleoperating, showAxes, showMoving, teleoperating } from "../js/control/teleoperation.js";
import { showRobot } from "../js/control/view-tools.js";
import { nearWords } from "../js/state/format.js";
import { link, now, pageState, roundTrip } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { labelOf, text } from "../js/state/texts.js";
import { element, setEnabled, setText } from "../js/views/dom.js";
import { holdButton } from "../js/views/hold-button.js";
import { icon } from "../js/views/icons.js";
import { step } from "./rp-arrows.js";
import "./rp-drive-pad.js";
import "./rp-joints.js";
import "./rp-postures.js";

/** Distance to an obstacle for a warning (m). */
const NEAR = 0.03;
/** From this round trip on (ms) motion is slow and may end by itself. */
const SLOW_MS = 150;

class RpDrive extends HTMLElement {
  connectedCallback() {
    const toggle = element(
      "button",
      { id: "teleop", attributes: { "aria-pressed": "false" } },
      icon("TELEOP"),
      text("teleop.toggle"),
    );
    toggle.addEventListener("click", () => {
      setTeleoperating(!teleoperating.get());
      if (teleoperating.get()) showRobot();
    });
    const what = choice("part", moving, showMoving, PARTS);
    const frame = choice("axes", axes, showAxes, ["tool", "base", "world"]);
    const [pace, percent] = speedSlider();
    const holdWords = element("span", { text: text("teleop.hold") });
    const button = element(
      "button",
      { id: "hold", attributes: { "aria-keyshortcuts": "H" } },
      holdWords,
      element("kbd", { class: "keyboard", text: "H" }),
    );
    holdButton(
      button,
      () => hold.press("button"),
      () => hold.release("button"),
    );
    const goButton = element("button", { id: "go" });
    holdButton(goButton, go, () => hold.release("posture"));
    const slow = slowLink();
    const [arrows, pad, joints, postures] = ["rp-arrows", "rp-drive-pad", "rp-joints", "rp-postures"].map((name) =>
      document.createElement(name),
    );
    const words = element("p", { class: "hint", attributes: { role: "status" } });
    this.replaceChildren(
      element("div", { class: "drive-head" }, toggle, pace),
      slow,
      what,
      frame,
      .../** @type {HTMLElement[]} */ ([arrows, pad, joints, postures]),
      element("div", { class: "drive-foot" }, button, goButton, words),
    );

    drawOn([teleoperating, moving, axes, hold.holding, hold.speedScale, goal, pageState, link, now], () => {
      const on = teleoperating.get();
      const why = whyNoTeleoperation();
      const holding = hold.holding.get();
      const part = moving.get();
      const to = goal.get();
      const byPosture = part === "joints" || part === "postures";
      setEnabled(toggle, why, text(on ? "teleop.hide" : "teleop.show"));
      toggle.setAttribute("aria-pressed", String(on));
      setEnabled(button, hold.whyNot(), text("teleop.hold_hint"));
      button.classList.toggle("held", holding);
      this.classList.toggle("on", on);
      what.hidden = pace.hidden = !on;
      frame.hidden = button.hidden = !on || part !== "tool";
      for (const [node, shown] of /** @type {const} */ ([
        [arrows, "tool"],
        [pad, "base"],
        [joints, "joints"],
        [postures, "postures"],
      ])) {
        if (node) node.hidden = !on || part !== shown;
      }
      goButton.hidden = !on || !byPosture;
      goButton.classList.toggle("held", hold.sources.has("posture"));
      setEnabled(goButton, whyNoGoing(), text("posture.go_hint"));
      setText(goButton, to ? text("posture.go_to", { name: to.name }) : text("posture.go"));
      setText(holdWords, text(holding ? "teleop.moving" : "teleop.hold"));
      setText(percent, `${Math.round(100 * hold.speedScale.get())} %`);
      const controller = pageState.get()?.controller ?? null;
      const held = (holding && controller?.limited_by) || "";
      setText(words, held ? text("teleop.held_back", { by: labelOf(held) }) : this.explanation(on, why));
      const refused = on && byPosture && to !== null && to.why !== null && to.why.code !== "posture_unchecked";
      words.classList.toggle("warned", held !== "" || refused || (controller?.proximity?.distance ?? 1) < NEAR);
    });
  }

  /**
   * @param {boolean} on
   * @param {import("../js/state/reasons.js").Reason|null} why
   */
  explanation(on, why) {
    if (why) return `${reasonText(why)}.`;
    if (!on) return text("teleop.off");
    const part = moving.get();
    const near = nearWords(pageState.get()?.controller ?? null);
    if (hold.holding.get()) return near || text(part === "tool" ? "teleop.tool_moves" : "teleop.moves");
    const to = goal.get();
    if (to?.why) return reasonText(to.why);
    if (to) return text(arrived() ? "posture.there" : "posture.shown");
    return text(`teleop.how.${part}`);
  }
}
customElements.define("rp-drive", RpDrive);

/** @returns {[HTMLElement, HTMLElement]} The slider, and where its value is written. */
function speedSlider() {
  const speed = element("input", {
    id: "speed-scale",
    attributes: { type: "range", min: "10", max: "100", step: "10", value: "100", "aria-label": text("teleop.speed_label") },
  });
  const percent = element("span", { class: "number", text: "100 %" });
  speed.addEventListener("input", () => hold.speedScale.set(Number(speed.value) / 100));
  return [element("label", { class: "pace" }, text("teleop.speed"), speed, percent), percent];
}

/** Tells of a slow link, over which steps are better than a long hold. */
function slowLink() {
  const words = element("span");
  const steps = element("button", { text: text("drive.use_steps"), onclick: () => step.set("middle") });
  const note = element("p", { class: "slow-link", attributes: { role: "status" } }, words, steps);
  drawOn([roundTrip, moving, step, teleoperating], () => {
    const trip = roundTrip.get() ?? 0;
    note.hidden = trip <= SLOW_MS || !teleoperating.get();
    steps.hidden = moving.get() !== "tool" || step.get() !== "free";
    setText(words, text("drive.slow", { ms: Math.round(trip / 10) * 10 }));
  });
  return note;
}

/**
 * A group of toggle buttons, one of which is pressed.
 *
 * @template {string} T
 * @param {"part"|"axes"} name Of its words, `teleop.NAME`, and those of each value, `teleop.NAME.VALUE`.
 * @param {import("../js/state/signals.js").Signal<T>} chosen
 * @param {(value: T) => void} choose
 * @param {readonly T[]} values
 */
function choice(name, chosen, choose, values) {
  const buttons = values.map((value) => {
    const title = text(`teleop.${name}.${value}.hint`);
    const button = element("button", { text: text(`teleop.${name}.${value}`), data: { choice: value }, attributes: { title } });
    button.addEventListener("click", () => choose(value));
    drawOn([chosen], () => button.setAttribute("aria-pressed", String(chosen.get() === value)));
    return button;
  });
  const label = name === "axes" ? [element("span", { text: text("teleop.axes"), attributes: { "aria-hidden": "true" } })] : [];
  return element("div", { class: "choice", data: { choices: name }, attributes: { role: "group", "aria-label": text(`teleop.${name}`) } }, ...label, ...buttons);
}
