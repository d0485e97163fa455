// Keys of the labelling page.

import { CLASSES } from "./classes.js";
import { proposalShown, redo, SIZES, sizeStep, step, takeProposal, takeRest, tool, undo } from "./session.js";
import { fitView, zoomView } from "./view.js";

/** @param {number} by */
export function changeSize(by) {
  sizeStep.set(Math.max(0, Math.min(SIZES.length - 1, sizeStep.get() + by)));
}

/** @type {Readonly<Record<string, () => void>>} */
const KEYS = Object.freeze({
  ...Object.fromEntries(CLASSES.filter((each) => each.key).map((each) => [each.key, () => tool.set(each.name)])),
  0: () => tool.set("unlabelled"),
  e: () => tool.set("unlabelled"),
  p: () => tool.set("proposal"),
  "[": () => changeSize(-1),
  "]": () => changeSize(1),
  z: undo,
  y: redo,
  " ": () => proposalShown.set(!proposalShown.get()),
  ArrowLeft: () => step(-1),
  ArrowRight: () => step(1),
  "+": () => zoomView(1.5),
  "-": () => zoomView(1 / 1.5),
  f: fitView,
  t: takeProposal,
  r: takeRest,
});

/** @param {Window} target */
export function listenForLabelKeys(target) {
  target.addEventListener("keydown", (event) => {
    // A slider has the arrows itself.
    if (event.target instanceof HTMLInputElement && event.key.startsWith("Arrow")) return;
    if (event.altKey) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (event.ctrlKey || event.metaKey) {
      if (key !== "z" && key !== "y") return;
      event.preventDefault();
      if (key === "y" || event.shiftKey) redo();
      else undo();
      return;
    }
    const act = key === "z" && event.shiftKey ? redo : KEYS[key];
    if (!act) return;
    event.preventDefault();
    act();
  });
  // The space bar would press the button that has the focus.
  target.addEventListener("keyup", (event) => {
    if (event.key === " ") event.preventDefault();
  });
}
