// A disabled control shows its reason when pressed or focused, since touch has no hover.

import { showToast } from "../state/page-state.js";
import { text } from "../state/texts.js";
import { element } from "./dom.js";

const DISABLED = ':is(button, input)[aria-disabled="true"]';
/** Margin to the control and to the edges of the screen (px). */
const GAP = 6;

/**
 * Suppress the actions of disabled controls and show their reasons.
 *
 * @param {Document} page
 */
export function explainDisabled(page) {
  const listen = (/** @type {string} */ name, /** @type {(event: Event, control: Element) => void} */ found) => {
    const look = (/** @type {Event} */ event) => {
      const control = event.target instanceof Element ? event.target.closest(DISABLED) : null;
      if (control) found(event, control);
    };
    page.addEventListener(name, look, { capture: true, passive: false });
  };
  listen("click", (event, control) => {
    event.preventDefault();
    event.stopImmediatePropagation();
    showToast("info", whyOf(control));
  });
  // A slider moves before the click, and by keys.
  for (const name of ["mousedown", "touchstart"])
    listen(name, (event, control) => isInput(control) && event.preventDefault());
  for (const name of ["input", "change"]) listen(name, (event) => event.stopImmediatePropagation());
  listen("keydown", (event, control) => {
    const { key } = /** @type {KeyboardEvent} */ (event);
    if (isInput(control) && key !== "Tab" && key !== "Escape") event.preventDefault();
  });
  tellOnFocus(page, listen);
}

/**
 * @param {Document} page
 * @param {(name: string, found: (event: Event, control: Element) => void) => void} listen
 */
function tellOnFocus(page, listen) {
  // Screen readers have the control's description already.
  const words = element("div", { class: "why", attributes: { "aria-hidden": "true" } });
  words.hidden = true;
  page.body.append(words);
  const hide = () => {
    words.hidden = true;
  };
  listen("focusin", (_, control) => {
    if (!control.matches(":focus-visible")) return;
    words.textContent = whyOf(control);
    words.hidden = false;
    const box = control.getBoundingClientRect();
    const left = Math.min(box.left, innerWidth - words.offsetWidth - GAP);
    const below = box.bottom + GAP;
    const top = below + words.offsetHeight < innerHeight ? below : box.top - GAP - words.offsetHeight;
    words.style.setProperty("left", `${Math.max(GAP, left)}px`);
    words.style.setProperty("top", `${top}px`);
  });
  page.addEventListener("focusout", hide);
  page.addEventListener("keydown", (event) => event.key === "Escape" && hide());
}

/** @param {Element} control */
function isInput(control) {
  return control instanceof HTMLInputElement;
}

/** @param {Element} control */
function whyOf(control) {
  return control.getAttribute("aria-description") ?? text("disabled");
}
