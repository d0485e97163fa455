// Who holds control of the robot's motion, as this page sees it.

import { pageState } from "./state.js";

/**
 * @typedef {object} Holder
 * @property {boolean} held Does anybody hold it?
 * @property {boolean} mine Does this page?
 * @property {string} user Who does; empty when nobody.
 */

/** @returns {Holder} */
export function holder() {
  const state = pageState.get();
  const control = state?.control ?? null;
  if (control === null || control.holder === "") return { held: false, mine: false, user: "" };
  return { held: true, mine: control.holder === state?.client, user: control.user };
}
