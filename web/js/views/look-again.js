// A place without a point, in the list of those: why there is none, and a button that sends the robot to look again.

import { whyNot } from "../control/allowed.js";
import { ask } from "../link/api.js";
import { element, setEnabled } from "./dom.js";
import { link, now, pageState } from "../state/page-state.js";
import { drawOn } from "../state/signals.js";

/** @typedef {import("../link/messages.js").Abstention} Abstention */

/** @param {Abstention} place */
export function placeWords(place) {
  return place.vine === 0 ? place.reason : `Vine ${place.vine} · spur ${place.spur}: ${place.reason}`;
}

/**
 * @param {Abstention} place
 * @returns {HTMLElement}
 */
export function placeItem(place) {
  const item = element("li", {}, element("span", { text: placeWords(place) }));
  if (place.needs !== "another look" || place.position === null) return item;
  const button = element("button", { class: "quiet look-again", text: "Look again", attributes: { type: "button" } });
  const { vine, spur } = place;
  button.addEventListener("click", () => void ask("Look again", "api/look-again", { vine, spur }));
  setEnabled(button, whyNot("Survey"), HINT);
  item.append(button);
  return item;
}

const HINT = "Drive there and look at it from both its sides; nothing is cut";

/**
 * Keep the buttons of a list as they may be pressed.
 *
 * @param {HTMLElement} list
 */
export function guardLookAgain(list) {
  drawOn([pageState, link, now], () => {
    const buttons = /** @type {NodeListOf<HTMLButtonElement>} */ (list.querySelectorAll("button.look-again"));
    if (buttons.length === 0) return;
    const why = whyNot("Survey");
    for (const button of buttons) setEnabled(button, why, HINT);
  });
}
