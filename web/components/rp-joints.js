// The arm's joints: each with its name, angle, limits and margin, buttons to turn it, and a field for an angle to go to.

import { aim, armAngles, goal, refuse } from "../js/control/posture-goal.js";
import { hold, moving, teleoperating } from "../js/control/teleoperation.js";
import { fetchJson } from "../js/link/api.js";
import { link, now, pageState } from "../js/state/page-state.js";
import { reason } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setEnabled, setText } from "../js/views/dom.js";
import { holdButton } from "../js/views/hold-button.js";

/** @typedef {import("../js/link/messages.js").ArmVelocities} ArmVelocities */

/** Full speed (rad/s). */
const SPEED = 0.35;
/** Margin to a limit that is shown as near (rad). */
const NEAR_LIMIT = 0.15;
const DEGREE = 180 / Math.PI;
const JOINTS = 7;

class RpJoints extends HTMLElement {
  connectedCallback() {
    /** @type {[number, number][]} */
    let limits = [];
    const range = (/** @type {number} */ joint) => {
      const kept = pageState.get()?.controller?.kept_margin ?? 0;
      const [low, high] = limits[joint] ?? [NaN, NaN];
      return limits[joint] ? /** @type {[number, number]} */ ([low + kept, high - kept]) : null;
    };
    const rows = Array.from({ length: JOINTS }, (_, joint) => jointRow(joint, () => range(joint)));
    this.append(...rows.map((row) => row.node));
    const draw = () => {
      if (!this.hidden) for (const row of rows) row.show();
    };
    void fetchJson("api/robot").then((robot) => {
      limits = robot?.arm_limits ?? [];
      draw();
    });
    drawOn([moving, teleoperating, pageState, link, now], draw);
    // Another goal was chosen, or none is left: what was typed before is void.
    goal.subscribe(() => {
      const name = goal.get()?.name;
      for (const row of rows) if (row.typed() && row.goalName() !== name) row.clear();
    });
  }
}
customElements.define("rp-joints", RpJoints);

/**
 * @param {number} joint From 0.
 * @param {() => [number, number]|null} range Where the controller lets it turn (rad); null before that is known.
 */
function jointRow(joint, range) {
  const number = joint + 1;
  const name = text(`joint.name.${number}`);
  const button = (/** @type {1|-1} */ way) => {
    const words = text(way > 0 ? "joint.up" : "joint.down", { joint: number });
    const made = element("button", {
      text: way > 0 ? "+" : "−",
      attributes: { "aria-label": words },
      data: { joint: String(number), way: way > 0 ? "up" : "down" },
    });
    const joints = /** @type {ArmVelocities} */ (Array.from({ length: JOINTS }, (_, each) => (each === joint ? way * SPEED : 0)));
    holdButton(
      made,
      () => hold.press("joint", () => ({ joints })),
      () => hold.release("joint"),
    );
    return made;
  };
  const [up, down] = [button(1), button(-1)];
  const needle = element("span", { class: "needle" });
  const unknown = text("joint.unknown", { joint: number });
  const scale = element("div", { class: "scale", attributes: { role: "img", "aria-label": unknown } }, needle);
  const angle = element("output", { class: "number" });
  const target = element("input", {
    class: "target",
    attributes: {
      inputmode: "decimal",
      autocomplete: "off",
      placeholder: text("joint.target"),
      "aria-label": text("joint.target_label", { joint: number, name }),
    },
  });
  let goalName = "";
  target.addEventListener("input", () => {
    const typed = target.value.trim().replace(",", ".").replace("−", "-");
    goalName = text("joint.goal", { name, angle: typed || "–" });
    const [at, limits] = [armAngles(), range()];
    const degrees = typed === "" ? NaN : Number(typed);
    if (!Number.isFinite(degrees)) refuse(goalName, reason("angle_no_number", { text: typed }));
    else if (!at || !limits) refuse(goalName, reason("no_state_yet"));
    else if (degrees < limits[0] * DEGREE || degrees > limits[1] * DEGREE) {
      const [low_deg, high_deg] = [limits[0] * DEGREE, limits[1] * DEGREE];
      refuse(goalName, reason("posture_out_of_range", { joint: number, angle_deg: degrees, low_deg, high_deg }));
    } else {
      const angles = /** @type {import("../js/link/messages.js").ArmAngles} */ (
        at.map((each, place) => (place === joint ? degrees / DEGREE : each))
      );
      aim(goalName, angles);
    }
  });
  const words = element("span", { class: "joint-words" }, name, element("small", { text: String(number) }), angle);
  const node = element("div", { class: "joint" }, words, down, scale, up, target);
  return {
    node,
    typed: () => target.value !== "",
    goalName: () => goalName,
    clear: () => {
      target.value = "";
    },
    show() {
      const why = hold.whyNot();
      const at = armAngles()?.[joint] ?? null;
      const limits = range();
      setEnabled(up, why, text("joint.up_hint", { joint: number }));
      setEnabled(down, why, text("joint.down_hint", { joint: number }));
      setText(angle, at === null ? "–" : `${(at * DEGREE).toFixed(0)}°`);
      if (at === null || !limits) return;
      const [low, high] = limits;
      const left = Math.min(at - low, high - at);
      const near = left < NEAR_LIMIT;
      scale.classList.toggle("near", near);
      needle.style.left = `${(100 * (at - low)) / (high - low)}%`;
      const [from, to, rest] = [low, high, left].map((each) => (each * DEGREE).toFixed(0));
      scale.ariaLabel = text("joint.at", { joint: number, angle: (at * DEGREE).toFixed(0), from, to });
      scale.title = near ? text("joint.near", { from, to, left: rest }) : text("joint.range", { from, to });
      angle.classList.toggle("near", near);
    },
  };
}
