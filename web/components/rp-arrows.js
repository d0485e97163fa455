// Arrows beside the gizmo: hold one to move the tool along or about an axis of tool, base or world, freely or by a step.

import { axes, hold, moving, teleoperating } from "../js/control/teleoperation.js";
import { link, now, pageState } from "../js/state/page-state.js";
import { drawOn, signal } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setAttribute, setEnabled, setText } from "../js/views/dom.js";
import { holdButton } from "../js/views/hold-button.js";

/** Full speed (m/s, rad/s). */
const SPEED = 0.1;
const TURN = 0.35;
/** Steps as times at full speed (s): 10 mm and 2° take 0.1 s. */
const STEPS = Object.freeze({ free: null, small: 0.01, middle: 0.1, large: 0.5 });
const AXES = Object.freeze(/** @type {const} */ (["x", "y", "z"]));

/** @typedef {keyof typeof STEPS} Step */
/** How far one press goes. */
export const step = signal(/** @type {Step} */ ("free"));

class RpArrows extends HTMLElement {
  connectedCallback() {
    const buttons = /** @type {{ node: HTMLButtonElement, key: string }[]} */ ([]);
    const names = /** @type {{ node: HTMLElement, axis: string }[]} */ ([]);
    const grid = element(
      "div",
      { class: "arrows" },
      element("span"),
      element("span", { class: "hint", text: text("arrows.move") }),
      element("span", { class: "hint", text: text("arrows.turn") }),
    );
    for (const [place, axis] of AXES.entries()) {
      const name = element("span", { class: "axis", data: { axis } });
      names.push({ node: name, axis });
      grid.append(name);
      for (const kind of /** @type {const} */ (["move", "turn"])) {
        const pair = element("span", { class: "pair" });
        for (const way of [-1, 1]) {
          const key = `${kind}.${way > 0 ? "up" : "down"}`;
          const node = element("button", { text: text(`arrows.${key}`), data: { axis, kind, way: String(way) } });
          const linear = vector(kind === "move" ? place : -1, way * SPEED);
          const angular = vector(kind === "turn" ? place : -1, way * TURN);
          holdButton(
            node,
            () => hold.press("arrow", () => ({ along: { linear, angular, axes: axes.get(), duration_s: STEPS[step.get()] } })),
            () => hold.release("arrow"),
          );
          buttons.push({ node, key });
          pair.append(node);
        }
        grid.append(pair);
      }
    }
    const steps = element("div", { class: "choice", attributes: { role: "group", "aria-label": text("arrows.step") } });
    for (const each of /** @type {Step[]} */ (Object.keys(STEPS))) {
      const title = text(`arrows.step.${each}.hint`);
      const button = element("button", { text: text(`arrows.step.${each}`), data: { step: each }, attributes: { title } });
      button.addEventListener("click", () => step.set(each));
      drawOn([step], () => setAttribute(button, "aria-pressed", String(step.get() === each)));
      steps.append(button);
    }
    this.append(grid, steps);
    drawOn([teleoperating, moving, axes, pageState, link, now], () => {
      if (this.hidden) return;
      const why = hold.whyNot();
      for (const { node, axis } of names) setText(node, text(`arrows.${axes.get()}.${axis}`));
      for (const { node, key } of buttons) {
        const words = text(`arrows.${key}.label`, { axis: text(`arrows.${axes.get()}.${node.dataset.axis}`) });
        setEnabled(node, why, words);
        setAttribute(node, "aria-label", words);
      }
    });
  }
}
customElements.define("rp-arrows", RpArrows);

/**
 * @param {number} place −1 for none.
 * @param {number} value
 * @returns {[number, number, number]}
 */
function vector(place, value) {
  return [place === 0 ? value : 0, place === 1 ? value : 0, place === 2 ? value : 0];
}
