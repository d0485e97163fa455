// What is fetched when it is first wanted: settings, help, and the hints after the first sign-in.

import { isTyping } from "../control/stop.js";
import { say } from "../state/page-state.js";
import { hints } from "../state/settings.js";
import { text } from "../state/texts.js";

export async function openSettings() {
  await fetched(import("./settings-sheet.js"), (module) => module.openSettings());
}

export async function openHelp() {
  await fetched(import("./help-sheet.js"), (module) => module.openHelp());
}

/** The key ? opens help; hints follow the first sign-in. @param {Window} target */
export function initSheets(target) {
  target.addEventListener("keydown", (event) => {
    if (event.key === "?" && !isTyping(event.target)) void openHelp();
  });
  if (hints.get() === "due") void fetched(import("./hints.js"), (module) => module.showHints());
}

/**
 * Use a module once it is there, or say that it cannot be had.
 *
 * @template T
 * @param {Promise<T>} module
 * @param {(module: T) => void} show
 */
export async function fetched(module, show) {
  try {
    show(await module);
  } catch {
    say("error", text("screen.failed"));
  }
}
