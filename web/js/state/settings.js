// What this browser remembers for the person in front of it.

import { signal } from "./signals.js";

/**
 * @param {string} name
 * @param {string} usual
 */
function remembered(name, usual) {
  const key = `setting.${name}`;
  const value = signal(localStorage.getItem(key) ?? usual);
  value.subscribe((chosen) => localStorage.setItem(key, chosen));
  return value;
}

/** A language that the page has texts in; empty for the browser's. */
export const language = remembered("language", "");
/** `light` or `dark`; empty for the device's. */
export const scheme = remembered("scheme", "");
/** Controls and text for gloved hands and sunlight. */
export const gloves = remembered("gloves", "off");
export const sound = remembered("sound", "on");
export const vibration = remembered("vibration", "on");
/** `due` after the first sign-in in this browser, until the hints have been seen. */
export const hints = remembered("hints", "");

/** The style sheets do the rest. @param {HTMLElement} root */
export function dress(root) {
  const draw = () => {
    root.dataset.scheme = scheme.get();
    root.classList.toggle("gloves", gloves.get() === "on");
  };
  for (const each of [scheme, gloves]) each.subscribe(draw);
  draw();
}
