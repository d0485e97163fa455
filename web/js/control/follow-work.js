// At work the page selects the point that the robot is at, unless the operator has just selected or looked for another
// one.

import { now, pageState, points, selected } from "../state/page-state.js";
import { placing } from "./placing.js";
import { followPoint, lastInteraction, noteInteraction } from "./selection.js";
import { measuring } from "./view-tools.js";

/** No following for this time after an interaction (ms). */
const HOLD_OFF_MS = 8000;
/** Where pointer, keys or wheel count as an interaction, so that no row moves from under a press. */
const PARTS = "rp-review, rp-order, rp-camera, rp-work";

export function followWork() {
  for (const kind of ["pointerdown", "pointermove", "keydown", "wheel"]) {
    document.addEventListener(
      kind,
      (event) => {
        if (event.target instanceof Element && event.target.closest(PARTS)) noteInteraction();
      },
      { capture: true, passive: true },
    );
  }
  const follow = () => {
    const controller = pageState.get()?.controller;
    const active = controller?.mode === "AUTO" ? controller.active_point_id : "";
    if (!active || active === selected.get() || performance.now() - lastInteraction() < HOLD_OFF_MS) return;
    // Placing and measuring need the view to stay.
    if (placing.get() || measuring.get()) return;
    if (points.get()?.points.some((row) => row.point.point_id === active)) followPoint(active);
  };
  for (const signal of [pageState, points, now]) signal.subscribe(follow);
}
