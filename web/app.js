// Starts the page: components, link, clock, keys.

import "./components/rp-alarms.js";
import "./components/rp-camera.js";
import "./components/rp-control.js";
import "./components/rp-controls.js";
import "./components/rp-drawer.js";
import "./components/rp-invite.js";
import "./components/rp-link-banner.js";
import "./components/rp-log.js";
import "./components/rp-mode.js";
import "./components/rp-placing.js";
import "./components/rp-queue.js";
import "./components/rp-replay.js";
import "./components/rp-rule.js";
import "./components/rp-scene.js";
import "./components/rp-status-bar.js";
import "./components/rp-stop.js";
import "./components/rp-stop-banner.js";
import "./components/rp-telemetry.js";
import "./components/rp-teleoperation.js";
import "./components/rp-toasts.js";
import "./components/rp-view-tools.js";
import { guardPlacing } from "./by-hand.js";
import { isBound } from "./decisions.js";
import { listenForDriveKeys, watchGamepad } from "./driving.js";
import { followWork } from "./following.js";
import { explainGreyed } from "./greyed.js";
import { keepControl } from "./here.js";
import { keepHistory } from "./history.js";
import { guardLooking } from "./looking.js";
import { now, points } from "./state.js";
import { listenForSpace, several } from "./stop.js";
import { guardHold, socket } from "./teleoperation.js";

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
    await Promise.all([import("./components/rp-order.js"), import("./components/rp-preview.js")]);
    wait();
  } catch {
    coming = false;
  }
});
if (several) {
  // The room is there from the first picture on.
  document.querySelector("rp-robots")?.removeAttribute("hidden");
  void import("./components/rp-robots.js");
}
