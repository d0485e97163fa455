// The screen for the decisions: the queue of pruning points.

import "./rp-order.js";
import "./rp-queue.js";
import "./rp-rule.js";

class RpReview extends HTMLElement {
  connectedCallback() {
    this.replaceChildren(document.createElement("rp-queue"));
  }
}
customElements.define("rp-review", RpReview);
