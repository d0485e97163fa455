// Keeps control while this page lives: the 3-D view can keep its thread busy for a second or two, and that is no absence.

import { holder } from "./holder.js";
import { link } from "./state.js";

const EVERY_MS = 250;

/** Has it said, by a thread of its own, that the page that holds control is there. */
export function keepControl() {
  const worker = new Worker("here-worker.js");
  window.setInterval(() => {
    worker.postMessage(link.get().status === "open" && holder().mine);
  }, EVERY_MS);
}
