// Banner while the page has no link and shows the last known state.

import { ageWords, counted } from "../js/state/format.js";
import { isOpening, link, now, stateAge } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
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
        setText(title, "You are not signed in");
        setText(
          words,
          "Each sign-in link works once: ask a supervisor who is signed in for a new one, or start the program again.",
        );
      } else {
        setText(title, "No link to the server");
        const old = age === null ? "" : `What you see is ${ageWords(age)} old. `;
        setText(words, `${old}Trying again by itself (${counted(attempts, "try", "tries")} so far).`);
      }
      setText(hint, "The software stop may not reach the robot from here: use the emergency stop on the robot.");
    });
  }
}
customElements.define("rp-link-banner", RpLinkBanner);
