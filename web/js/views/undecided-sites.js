// Undecided sites below the queue: spurs without a pruning point, the reason, and Look again.

import { whyNot } from "../control/allowed.js";
import { ask } from "../link/api.js";
import { link, now, pageState } from "../state/page-state.js";
import { reasonText } from "../state/reasons.js";
import { drawOn } from "../state/signals.js";
import { text } from "../state/texts.js";
import { element, setEnabled, setText } from "./dom.js";

/** @typedef {import("../link/messages.js").UndecidedSite} UndecidedSite */

/**
 * The undecided sites that need one thing.
 *
 * @param {import("../link/messages.js").Need} needs
 * @param {(count: number) => string} title
 */
export function undecidedList(needs, title) {
  const summary = element("summary");
  const list = element("ul");
  const box = element("details", { class: "undecided-sites", attributes: { "data-needs": needs } }, summary, list);
  drawOn([pageState, link, now], () => {
    const buttons = /** @type {NodeListOf<HTMLButtonElement>} */ (list.querySelectorAll("button.look-again"));
    if (buttons.length === 0) return;
    const why = whyNot("Survey");
    for (const button of buttons) setEnabled(button, why, text("sites.look_hint"));
  });
  let shown = "";
  return {
    box,
    /** @param {readonly UndecidedSite[]} all */
    show(all) {
      const sites = all.filter((each) => each.needs === needs);
      const lines = sites.map(siteWords);
      box.hidden = lines.length === 0;
      const key = sites.map((each, k) => `${lines[k]} ${each.position !== null}`).join("\n");
      if (key === shown) return;
      shown = key;
      setText(summary, title(lines.length));
      list.replaceChildren(...sites.map(siteItem));
    },
  };
}

/** @param {UndecidedSite} site */
function siteWords(site) {
  const why = reasonText(site.reason);
  return site.vine === 0 ? why : text("sites.place", { vine: site.vine, spur: site.spur, why });
}

/**
 * @param {UndecidedSite} site
 * @returns {HTMLElement}
 */
function siteItem(site) {
  const item = element("li", {}, element("span", { text: siteWords(site) }));
  if (site.needs !== "another look" || site.position === null) return item;
  const button = element("button", { class: "quiet look-again", text: text("sites.look") });
  const { vine, spur } = site;
  button.addEventListener("click", () => void ask(text("sites.look"), "api/look-again", { vine, spur }));
  setEnabled(button, whyNot("Survey"), text("sites.look_hint"));
  item.append(button);
  return item;
}
