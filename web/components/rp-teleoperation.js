// The teleoperation panel: switch, part, speed, hold button; the pad for the base and buttons for single joints.

import { whyNoTeleoperation } from "../js/control/allowed.js";
import { drive, gamepad, whyNoDriving } from "../js/control/driving.js";
import {
  axes,
  hold,
  moving,
  setTeleoperating,
  showAxes,
  showMoving,
  teleoperating,
} from "../js/control/teleoperation.js";
import { fetchJson } from "../js/link/api.js";
import { nearWords } from "../js/state/format.js";
import { link, now, pageState, showToast } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { labelOf, text } from "../js/state/texts.js";
import { element, setEnabled, setText } from "../js/views/dom.js";
import { holdButton } from "../js/views/hold-button.js";
import { icon } from "../js/views/icons.js";

/** Full speed (rad/s). */
const SPEED = 0.35;
/** Margin to a limit that is shown as near (rad). */
const NEAR_LIMIT = 0.15;
/** θ_l and θ_r precede the arm's joints. */
const WHEELS = 2;
const DEGREE = 180 / Math.PI;

class RpJoints extends HTMLElement {
  connectedCallback() {
    const limits = fetchJson("api/robot").then((robot) => /** @type {[number, number][]} */ (robot?.arm_limits ?? []));
    for (let joint = 0; joint < 7; joint++) {
      const turn = (/** @type {1|-1} */ way) => {
        const button = element("button", {
          text: way > 0 ? "+" : "−",
          attributes: { "aria-label": text(way > 0 ? "joint.up" : "joint.down", { joint: joint + 1 }) },
          data: { joint: String(joint + 1), way: way > 0 ? "up" : "down" },
        });
        const joints = /** @type {import("../js/link/messages.js").ArmVelocities} */ (
          Array.from({ length: 7 }, (_, each) => (each === joint ? way * SPEED : 0))
        );
        holdButton(
          button,
          () => hold.press("joint", () => ({ joints })),
          () => hold.release("joint"),
        );
        return button;
      };
      const [up, down] = [turn(1), turn(-1)];
      const needle = element("span", { class: "needle" });
      const unknown = text("joint.unknown", { joint: joint + 1 });
      const scale = element("div", { class: "scale", attributes: { role: "img", "aria-label": unknown } }, needle);
      const angle = element("span", { class: "number" });
      this.append(element("div", { class: "joint" }, up, scale, down, angle));
      /** @type {[number, number]|null} */
      let range = null;
      void limits.then((all) => {
        range = all[joint] ?? null;
      });
      drawOn([moving, teleoperating, pageState, link, now], () => {
        if (this.hidden) return;
        const why = hold.whyNot();
        const at = pageState.get()?.joints?.position[WHEELS + joint] ?? null;
        const [low, high] = range ?? [0, 0];
        const left = at === null || !range ? Infinity : Math.min(at - low, high - at);
        setEnabled(up, why, text("joint.up_hint", { joint: joint + 1 }));
        setEnabled(down, why, text("joint.down_hint", { joint: joint + 1 }));
        scale.classList.toggle("near", left < NEAR_LIMIT);
        setText(angle, at === null ? "–" : `${(at * DEGREE).toFixed(0)}°`);
        if (at === null || !range) return;
        needle.style.bottom = `${(100 * (at - low)) / (high - low)}%`;
        const [from, to] = [(low * DEGREE).toFixed(0), (high * DEGREE).toFixed(0)];
        scale.ariaLabel = text("joint.at", { joint: joint + 1, angle: (at * DEGREE).toFixed(0), from, to });
        const near = left < NEAR_LIMIT;
        scale.title = near ? text("joint.near", { from, to, left: (left * DEGREE).toFixed(0) }) : text("joint.range", { from, to });
      });
    }
  }
}
customElements.define("rp-joints", RpJoints);

class RpDrivePad extends HTMLElement {
  connectedCallback() {
    const knob = element("span", { class: "knob" });
    const label = text("drive.label");
    const pad = element("div", { id: "drive-pad", attributes: { role: "img", "aria-label": label } }, knob);
    const words = element("p", { class: "hint" });
    this.append(pad, words);
    /** @type {number|null} */
    let finger = null;
    const way = { ahead: 0, left: 0 };

    const end = () => {
      finger = null;
      way.ahead = way.left = 0;
      knob.style.removeProperty("translate");
      hold.release("pad");
    };
    const follow = (/** @type {PointerEvent} */ event) => {
      const box = pad.getBoundingClientRect();
      const reach = box.width / 2;
      const x = event.clientX - box.left - reach;
      const y = event.clientY - box.top - reach;
      const shorten = Math.min(1, reach / Math.max(Math.hypot(x, y), 1));
      way.left = (-x * shorten) / reach;
      way.ahead = (-y * shorten) / reach;
      knob.style.translate = `${x * shorten * 0.6}px ${y * shorten * 0.6}px`;
    };
    pad.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || finger !== null) return;
      const why = drive("pad", () => way);
      if (why) {
        showToast("warning", reasonText(why));
        return;
      }
      finger = event.pointerId;
      pad.setPointerCapture(finger);
      follow(event);
    });
    pad.addEventListener("pointermove", (event) => event.pointerId === finger && follow(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      pad.addEventListener(name, (event) => /** @type {PointerEvent} */ (event).pointerId === finger && end());
    }
    pad.addEventListener("contextmenu", (event) => event.preventDefault());
    document.addEventListener("pointerdown", (event) => finger !== null && event.pointerId !== finger && end(), {
      capture: true,
    });
    hold.holding.subscribe((holding) => !holding && finger !== null && end());

    drawOn([moving, teleoperating, gamepad, pageState, link, now], () => {
      const why = whyNoDriving();
      pad.title = why ? reasonText(why) : label;
      pad.classList.toggle("disabled", why !== null);
      setText(words, `${text("drive.how")} ${text(gamepad.get() ? "drive.gamepad" : "drive.no_gamepad")}`);
    });
  }
}
customElements.define("rp-drive-pad", RpDrivePad);

/** Distance to an obstacle for a warning (m). */
const NEAR = 0.03;

class RpTeleoperation extends HTMLElement {
  connectedCallback() {
    const toggle = element(
      "button",
      { id: "teleop", attributes: { "aria-pressed": "false" } },
      icon("TELEOP"),
      text("teleop.toggle"),
    );
    toggle.addEventListener("click", () => setTeleoperating(!teleoperating.get()));
    const what = choice("part", moving, showMoving, ["tool", "base", "joints"]);
    const frame = choice("axes", axes, showAxes, ["tool", "base", "world"]);
    const speed = element("input", {
      id: "speed-scale",
      attributes: {
        type: "range",
        min: "10",
        max: "100",
        step: "10",
        value: "100",
        "aria-label": text("teleop.speed_label"),
      },
    });
    const percent = element("span", { class: "number", text: "100 %" });
    speed.addEventListener("input", () => hold.speedScale.set(Number(speed.value) / 100));
    const pace = element("label", { class: "pace" }, text("teleop.speed"), speed, percent);

    const holdWords = element("span", { text: text("teleop.hold") });
    const button = element(
      "button",
      { id: "hold", attributes: { "aria-keyshortcuts": "H" } },
      holdWords,
      element("kbd", { text: "H" }),
    );
    holdButton(
      button,
      () => hold.press("button"),
      () => hold.release("button"),
    );

    const pad = document.createElement("rp-drive-pad");
    const joints = document.createElement("rp-joints");
    const words = element("p", { class: "hint", attributes: { role: "status" } });
    this.append(toggle, what, pace, frame, button, pad, joints, words);

    drawOn([teleoperating, moving, axes, hold.holding, hold.speedScale, pageState, link, now], () => {
      const on = teleoperating.get();
      const why = whyNoTeleoperation();
      const holding = hold.holding.get();
      const part = moving.get();
      setEnabled(toggle, why, text(on ? "teleop.hide" : "teleop.show"));
      toggle.setAttribute("aria-pressed", String(on));
      setEnabled(button, hold.whyNot(), text("teleop.hold_hint"));
      button.classList.toggle("held", holding);
      this.classList.toggle("on", on);
      what.hidden = pace.hidden = !on;
      frame.hidden = !on || part !== "tool";
      button.hidden = !on || part !== "tool";
      words.hidden = !on;
      pad.hidden = !on || part !== "base";
      joints.hidden = !on || part !== "joints";
      setText(holdWords, text(holding ? "teleop.moving" : "teleop.hold"));
      setText(percent, `${Math.round(100 * hold.speedScale.get())} %`);
      const controller = pageState.get()?.controller ?? null;
      const held = (holding && controller?.limited_by) || "";
      setText(
        words,
        held ? text("teleop.held_back", { by: labelOf(held) }) : explanation(why, holding, part, nearWords(controller)),
      );
      words.classList.toggle("warned", held !== "" || (controller?.proximity?.distance ?? 1) < NEAR);
    });
  }
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
  return element("div", { class: "choice", attributes: { role: "group", "aria-label": text(`teleop.${name}`) } }, ...buttons);
}

/**
 * @param {import("../js/state/reasons.js").Reason|null} why
 * @param {boolean} holding
 * @param {import("../js/control/teleoperation.js").Part} part
 * @param {string} near
 */
function explanation(why, holding, part, near) {
  if (why) return `${reasonText(why)}.`;
  if (holding) return near || text(part === "tool" ? "teleop.tool_moves" : "teleop.moves");
  return text(`teleop.how.${part}`);
}
customElements.define("rp-teleoperation", RpTeleoperation);
