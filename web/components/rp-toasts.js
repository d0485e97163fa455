// Toasts above the log, which contains them too.

import { dismissToast, toasts } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";

class RpToasts extends HTMLElement {
  connectedCallback() {
    this.setAttribute("role", "status");
    this.setAttribute("aria-live", "polite");
    /** @type {Map<number, HTMLElement>} */
    const shown = new Map();
    drawOn([toasts], () => {
      const wanted = new Set(toasts.get().map((toast) => toast.id));
      for (const [id, node] of shown) {
        if (wanted.has(id)) continue;
        node.remove();
        shown.delete(id);
      }
      for (const toast of toasts.get()) {
        if (shown.has(toast.id)) continue;
        const close = element("button", {
          class: "quiet",
          text: "×",
          attributes: { "aria-label": text("toast.close") },
          onclick: () => dismissToast(toast.id),
        });
        const node = element(
          "div",
          { class: "toast", data: { severity: toast.severity } },
          icon(toast.severity),
          element("span", { text: toast.text }),
          close,
        );
        shown.set(toast.id, node);
        this.append(node);
      }
    });
  }
}
customElements.define("rp-toasts", RpToasts);
