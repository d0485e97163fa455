// A greyed button says why when it is pressed: a finger cannot hover for the reason.

import { showToast } from "./state.js";

/**
 * Keep presses of greyed buttons from doing anything, and show their reason instead.
 *
 * @param {EventTarget} target What the buttons are in.
 */
export function explainGreyed(target) {
  target.addEventListener(
    "click",
    (event) => {
      const button = /** @type {Element} */ (event.target).closest('button[aria-disabled="true"]');
      if (!button) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      showToast("info", button.getAttribute("aria-description") ?? "This is not possible now");
    },
    { capture: true },
  );
}
