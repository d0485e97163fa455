// A button that means something only while it is held: by a finger, the mouse, or Enter.

import { showToast } from "../state/page-state.js";

/**
 * @param {HTMLElement} button
 * @param {() => string} press Returns why it was refused.
 * @param {() => void} release
 */
export function holdButton(button, press, release) {
  let held = false;
  const begin = () => {
    const why = press();
    held = !why;
    if (why) showToast("warning", why);
  };
  // Of this button alone: it loses the focus only when the next one has been pressed already.
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
  // A long touch must not become a menu that swallows the release.
  button.addEventListener("contextmenu", (event) => event.preventDefault());
  button.addEventListener("keydown", (event) => {
    if (event.code === "Enter" && !event.repeat) begin();
  });
  button.addEventListener("keyup", (event) => {
    if (event.code === "Enter") end();
  });
}
