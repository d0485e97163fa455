// Starts the page: components, link, clock, keys.

import "../components/rp-alarms.js";
import "../components/rp-camera.js";
import "../components/rp-commands.js";
import "../components/rp-drawer.js";
import "../components/rp-invite.js";
import "../components/rp-lease.js";
import "../components/rp-link-banner.js";
import "../components/rp-log.js";
import "../components/rp-mode.js";
import "../components/rp-queue.js";
import "../components/rp-replay.js";
import "../components/rp-rule.js";
import "../components/rp-scene.js";
import "../components/rp-status-bar.js";
import "../components/rp-stop-banner.js";
import "../components/rp-stop.js";
import "../components/rp-telemetry.js";
import "../components/rp-teleoperation.js";
import "../components/rp-toasts.js";
import "../components/rp-view-tools.js";
import { isBound } from "./control/decisions.js";
import { listenForDriveKeys, watchGamepad } from "./control/driving.js";
import { followWork } from "./control/follow-work.js";
import { keepControl } from "./control/lease.js";
import { guardPlacing } from "./control/placing.js";
import { listenForSpace, several } from "./control/stop.js";
import { guardHold } from "./control/teleoperation.js";
import { guardLooking } from "./control/view-tools.js";
import { socket } from "./link/socket.js";
import { now, points } from "./state/page-state.js";
import { explainGreyed } from "./views/disabled-reasons.js";
import { keepHistory } from "./views/history.js";

explainGreyed(document);
listenForSpace(window);
guardHold();
listenForDriveKeys(window);
watchGamepad();
guardPlacing();
keepHistory();
keepControl();
guardLooking();
followWork();
window.setInterval(() => now.set(performance.now()), 250);
socket.open();
// What is about accepted points comes with the first of them, or later where the link was lost just then.
let coming = false;
const wait = points.subscribe(async (page) => {
  if (coming || !page?.points.some((row) => isBound(row))) return;
  coming = true;
  try {
    await Promise.all([import("../components/rp-order.js"), import("../components/rp-preview.js")]);
    wait();
  } catch {
    coming = false;
  }
});
if (several) {
  // The room is there from the first picture on.
  document.querySelector("rp-robots")?.removeAttribute("hidden");
  void import("../components/rp-robots.js");
}
