// A button that acts while it is held with a finger, the mouse, or Enter.

import { showToast } from "../state/page-state.js";
import { reasonText } from "../state/reasons.js";

/**
 * @param {HTMLElement} button
 * @param {() => import("../state/reasons.js").Reason|null} press Returns why it was refused.
 * @param {() => void} release
 */
export function holdButton(button, press, release) {
  let held = false;
  const begin = () => {
    const why = press();
    held = !why;
    if (why) showToast("warning", reasonText(why));
  };
  // Only if this button is held: blur arrives after the next one has been pressed.
  const end = () => {
    if (held) release();
    held = false;
  };
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    button.setPointerCapture(event.pointerId);
    begin();
  });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) button.addEventListener(name, end);
  // The context menu of a long touch would swallow the release.
  button.addEventListener("contextmenu", (event) => event.preventDefault());
  button.addEventListener("keydown", (event) => {
    if (event.code === "Enter" && !event.repeat) begin();
  });
  button.addEventListener("keyup", (event) => {
    if (event.code === "Enter") end();
  });
}
