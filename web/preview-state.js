// What the page knows of the preview, and why work may not begin without one.

import { signal } from "./store.js";

/** @typedef {import("./messages.js").PreviewState} PreviewState */

/** The newest word of the controller about it; null before the first. */
export const preview = signal(/** @type {PreviewState|null} */ (null));

/** Why work waits for a preview; empty while it does not. */
export function whyNoStart() {
  const state = preview.get();
  if (!state?.required || state.phase === "approved") return "";
  if (state.phase === "ready") return "Approve the preview first";
  if (state.phase === "expired") return `The preview has expired: ${state.reason}`;
  return "A preview is required before each cut: press Preview";
}
