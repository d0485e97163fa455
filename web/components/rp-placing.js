// Over the 3-D view while clicks are meant for new points: what to do, and how to end it.

import { placing, setPlacing } from "../by-hand.js";
import { element } from "../element.js";
import { drawOn } from "../store.js";

class RpPlacing extends HTMLElement {
  connectedCallback() {
    const done = element("button", { id: "placing-done", text: "Done", attributes: { type: "button", "aria-keyshortcuts": "Escape" } });
    done.addEventListener("click", () => setPlacing(false));
    this.append(element("p", { text: "Click a cane that has been seen: a blue line here, or a cane in the camera image.", attributes: { role: "status" } }), done);
    drawOn([placing], () => {
      this.hidden = !placing.get();
      document.body.classList.toggle("placing", placing.get());
    });
  }
}
customElements.define("rp-placing", RpPlacing);
