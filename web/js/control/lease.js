// The control lease: who holds it, and its renewal while this page lives.

import { link, pageState } from "../state/page-state.js";

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

const EVERY_MS = 250;

/** Renew the lease from a worker while this page holds it. */
export function renewLease() {
  const worker = new Worker("js/control/lease-worker.js");
  window.setInterval(() => {
    worker.postMessage(link.get().status === "open" && holder().mine);
  }, EVERY_MS);
}
