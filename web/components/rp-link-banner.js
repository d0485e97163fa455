// Banner while the page has no link and shows the last known state.

import { ageWords } from "../js/state/format.js";
import { isOpening, link, now, stateAge } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { counted, text } from "../js/state/texts.js";
import { element, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";

class RpLinkBanner extends HTMLElement {
  connectedCallback() {
    this.hidden = true;
    const title = element("h2");
    const words = element("p");
    const hint = element("p", { class: "hint" });
    this.append(element("div", { class: "banner-head" }, icon("gone"), title), words, hint);
    drawOn([link, now], () => {
      const { status, attempts } = link.get();
      const shown = status !== "open" && !isOpening();
      document.body.classList.toggle("no-link", shown);
      if (this.hidden !== !shown) {
        this.hidden = !shown;
        this.setAttribute("role", shown ? "alert" : "none");
      }
      if (!shown) return;
      const age = stateAge();
      if (status === "signed-out") {
        setText(title, text("link.signed_out"));
        setText(words, text("link.sign_in"));
      } else {
        setText(title, text("link.lost"));
        const old = age === null ? [] : [text("link.old", { age: ageWords(age) })];
        const cause = navigator.onLine ? [] : [text("link.offline")];
        setText(words, [...cause, ...old, counted("link.tries", attempts)].join(" "));
      }
      setText(hint, text("link.stop"));
    });
  }
}
customElements.define("rp-link-banner", RpLinkBanner);
