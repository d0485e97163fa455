// The page goes along with the work: the point that the robot is at is chosen, unless somebody has just chosen himself.

import { now, pageState, points, selected } from "../state/page-state.js";
import { placing } from "./placing.js";
import { followPoint, lastInteraction, noteInteraction } from "./selection.js";
import { measuring } from "./view-tools.js";

/** Whoever has just chosen, or looked through a list, is left there so long (ms). */
const HOLD_OFF_MS = 8000;
/** Parts in which the pointer, a key or the wheel shows that an operator is busy: no row moves from under a press. */
const PARTS = "rp-queue, rp-order, rp-camera";

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
    // Who places a point or measures clicks on in the view as it is.
    if (placing.get() || measuring.get()) return;
    if (points.get()?.points.some((row) => row.point.point_id === active)) followPoint(active);
  };
  for (const signal of [pageState, points, now]) signal.subscribe(follow);
}
