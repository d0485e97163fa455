// A pad to drive the base with a finger: how far from its middle is how fast. A second finger anywhere ends it.

import { drive, gamepad, whyNoDriving } from "../driving.js";
import { element, setText } from "../element.js";
import { link, now, pageState, showToast } from "../state.js";
import { drawOn } from "../store.js";
import { hold, moving, teleoperating } from "../teleoperation.js";

class RpDrivePad extends HTMLElement {
  connectedCallback() {
    const knob = element("span", { class: "knob" });
    const label = "Drive the base: ahead, back and around. W A S D and the arrow keys do the same.";
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
        showToast("warning", why);
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
    document.addEventListener(
      "pointerdown",
      (event) => finger !== null && event.pointerId !== finger && end(),
      { capture: true },
    );
    hold.holding.subscribe((holding) => !holding && finger !== null && end());

    drawOn([moving, teleoperating, gamepad, pageState, link, now], () => {
      const why = whyNoDriving();
      pad.title = why || label;
      pad.classList.toggle("greyed", why !== "");
      const held = gamepad.get() ? "Gamepad: hold a trigger and steer with the left stick." : "A gamepad works too.";
      setText(words, `Drag in the pad, or hold W A S D or the arrow keys. ${held}`);
    });
  }
}
customElements.define("rp-drive-pad", RpDrivePad);
