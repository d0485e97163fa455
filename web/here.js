// Keeps control while this page lives: the 3-D view can keep its thread busy for a second or two, and that is no absence.

import { link, pageState } from "./state.js";

const EVERY_MS = 250;

/** Has it said, by a thread of its own, that the page that holds control is there. */
export function keepControl() {
  const worker = new Worker("here-worker.js");
  window.setInterval(() => {
    const state = pageState.get();
    const holder = link.get().status === "open" ? state?.control?.holder : "";
    worker.postMessage(Boolean(holder) && holder === state?.client);
  }, EVERY_MS);
}
