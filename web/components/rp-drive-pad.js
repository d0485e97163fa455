// The pad that drives the base, and the picture of a gamepad that does the same.

import { drive, gamepad, whyNoDriving } from "../js/control/driving.js";
import { hold, moving, teleoperating } from "../js/control/teleoperation.js";
import { link, now, pageState, showToast } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setText, svg } from "../js/views/dom.js";

class RpDrivePad extends HTMLElement {
  connectedCallback() {
    const knob = element("span", { class: "knob" });
    const label = text("drive.label");
    const pad = element("div", { id: "drive-pad", attributes: { role: "img", "aria-label": label } }, knob);
    const words = element("p", { class: "hint" });
    const picture = gamepadPicture();
    this.append(pad, element("div", { class: "pad-words" }, words, picture));
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
      picture.classList.toggle("connected", gamepad.get() !== "");
      setText(words, `${text("drive.how")} ${text(gamepad.get() ? "drive.gamepad" : "drive.no_gamepad")}`);
    });
  }
}
customElements.define("rp-drive-pad", RpDrivePad);

/** A gamepad from above: what is used is marked and named. */
function gamepadPicture() {
  const word = (/** @type {string} */ words, /** @type {Record<string, string|number>} */ where) => {
    const node = svg("text", where);
    node.textContent = words;
    return node;
  };
  return svg(
    "svg",
    { viewBox: "0 0 240 120", class: "gamepad", role: "img", "aria-label": text("drive.gamepad") },
    svg("path", {
      d: "M78 44h84c30 0 46 18 52 46c4 20-14 26-26 12l-14-16h-108l-14 16c-12 14-30 8-26-12c6-28 22-46 52-46z",
    }),
    svg("rect", { class: "used", x: 66, y: 26, width: 34, height: 14, rx: 6 }),
    svg("rect", { class: "used", x: 140, y: 26, width: 34, height: 14, rx: 6 }),
    svg("circle", { class: "used", cx: 86, cy: 66, r: 12 }),
    svg("circle", { cx: 152, cy: 66, r: 12 }),
    word(text("drive.gamepad.hold"), { x: 120, y: 16, "text-anchor": "middle" }),
    word(text("drive.gamepad.steer"), { x: 86, y: 116, "text-anchor": "middle" }),
  );
}
