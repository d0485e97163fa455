// The screen for motion by hand.

import "./rp-teleoperation.js";

class RpDrive extends HTMLElement {
  connectedCallback() {
    this.replaceChildren(document.createElement("rp-teleoperation"));
  }
}
customElements.define("rp-drive", RpDrive);
