// The tabs of the screens. A screen is fetched when it is first opened; later it is only shown and hidden.

import { waitingForPerson } from "../js/control/next-step.js";
import { pageState, points } from "../js/state/page-state.js";
import { SCREENS, screen } from "../js/state/screens.js";
import { drawOn } from "../js/state/signals.js";
import { counted, text } from "../js/state/texts.js";
import { element, setAttribute, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";

/** @type {Readonly<Record<import("../js/state/screens.js").ScreenName, () => Promise<unknown>>>} */
const FETCH = Object.freeze({
  work: async () => {},
  review: () => import("./rp-review.js"),
  drive: () => import("./rp-drive.js"),
  report: () => import("./rp-report.js"),
  engineer: () => import("./rp-engineer.js"),
});

/** How much waits for a person. */
function badge() {
  const count = element("span", { class: "badge number" });
  drawOn([points, pageState], () => {
    const waiting = waitingForPerson();
    count.hidden = waiting === 0;
    setText(count, String(waiting));
    count.setAttribute("aria-label", counted("bar.needs_you", waiting));
  });
  return count;
}

class RpScreens extends HTMLElement {
  connectedCallback() {
    this.setAttribute("role", "navigation");
    this.setAttribute("aria-label", text("screen.label"));
    const tabs = SCREENS.map((name) => {
      const words = element("span", { text: text(`screen.${name}`) });
      const tab = element("a", { data: { tab: name }, attributes: { href: `#${name}` } }, icon(name), words);
      if (name === "review") tab.append(badge());
      drawOn([screen], () => setAttribute(tab, "aria-current", screen.get() === name ? "page" : ""));
      return tab;
    });
    this.append(...tabs);
    drawOn([screen], () => void this.open(screen.get()));
  }

  /** @param {import("../js/state/screens.js").ScreenName} name */
  async open(name) {
    const main = document.querySelector("main");
    if (main) main.dataset.screen = name;
    const words = main?.querySelector(`rp-${name}:not(:defined) > p`);
    if (words) setText(words, text("screen.loading"));
    try {
      await FETCH[name]();
    } catch {
      if (words) setText(words, text("screen.failed"));
    }
  }
}
customElements.define("rp-screens", RpScreens);
