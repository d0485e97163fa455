// The screen stays on while the robot moves and this page is in view: work pauses when nobody looks at the robot.

import { link, pageState } from "../state/page-state.js";

const MOVING = new Set(["AUTO", "TELEOP"]);

/** @param {Document} page */
export function keepAwake(page) {
  /** @type {WakeLockSentinel|null} */
  let held = null;
  let wanted = false;
  const look = async () => {
    const mode = link.get().status === "open" ? pageState.get()?.controller?.mode : undefined;
    const wants = page.visibilityState === "visible" && MOVING.has(mode ?? "");
    if (wants === wanted) return;
    wanted = wants;
    const given = held;
    held = null;
    await given?.release();
    // The browser may refuse, to save power for instance, or have none over plain HTTP: the screen then goes off as usual.
    const lock = wanted ? await navigator.wakeLock?.request("screen").catch(() => null) : null;
    if (wanted && !held) held = lock ?? null;
    else await lock?.release();
  };
  for (const each of [pageState, link]) each.subscribe(() => void look());
  page.addEventListener("visibilitychange", () => void look());
}
