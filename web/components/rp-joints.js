// The arm's joints one by one: where each is between its limits, and a button either way to hold.

import { fetchJson } from "../api.js";
import { element, setEnabled, setText } from "../element.js";
import { holdButton } from "../hold-button.js";
import { link, now, pageState } from "../state.js";
import { drawOn } from "../store.js";
import { hold, moving, teleoperating } from "../teleoperation.js";

/** At the whole of the usual speed (rad/s). */
const SPEED = 0.35;
/** Nearer to a limit than this (rad) is told. */
const NEAR = 0.15;
/** θ_l and θ_r come before the arm's joints. */
const WHEELS = 2;
const DEGREE = 180 / Math.PI;

class RpJoints extends HTMLElement {
  connectedCallback() {
    const limits = fetchJson("api/robot").then((robot) => /** @type {[number, number][]} */ (robot?.arm_limits ?? []));
    for (let joint = 0; joint < 7; joint++) {
      const turn = (/** @type {1|-1} */ way) => {
        const word = way > 0 ? "up" : "down";
        const button = element("button", {
          text: way > 0 ? "+" : "−",
          attributes: { type: "button", "aria-label": `Joint ${joint + 1} ${word}` },
          data: { joint: String(joint + 1), way: word },
        });
        const joints = /** @type {import("../messages.js").ArmVelocities} */ (
          Array.from({ length: 7 }, (_, each) => (each === joint ? way * SPEED : 0))
        );
        holdButton(button, () => hold.press("joint", () => ({ joints })), () => hold.release("joint"));
        return button;
      };
      const [up, down] = [turn(1), turn(-1)];
      const needle = element("span", { class: "needle" });
      const unknown = `Joint ${joint + 1}: where it is between its limits is not known yet`;
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
        setEnabled(up, why, `Turn joint ${joint + 1} up while held`);
        setEnabled(down, why, `Turn joint ${joint + 1} down while held`);
        scale.classList.toggle("near", left < NEAR);
        setText(angle, at === null ? "–" : `${(at * DEGREE).toFixed(0)}°`);
        if (at === null || !range) return;
        needle.style.bottom = `${(100 * (at - low)) / (high - low)}%`;
        const ends = `${(low * DEGREE).toFixed(0)}° to ${(high * DEGREE).toFixed(0)}°`;
        scale.ariaLabel = `Joint ${joint + 1}: ${(at * DEGREE).toFixed(0)}° of ${ends}`;
        scale.title = `${ends}${left < NEAR ? `: ${(left * DEGREE).toFixed(0)}° to its limit` : ""}`;
      });
    }
  }
}
customElements.define("rp-joints", RpJoints);
