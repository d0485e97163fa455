// Entry point: defines the components, opens the link, starts clock and keys.

import "../components/rp-alarms.js";
import "../components/rp-bar.js";
import "../components/rp-camera.js";
import "../components/rp-health.js";
import "../components/rp-lease.js";
import "../components/rp-link-banner.js";
import "../components/rp-mode.js";
import "../components/rp-person.js";
import "../components/rp-scene.js";
import "../components/rp-screens.js";
import "../components/rp-stop-banner.js";
import "../components/rp-stop.js";
import "../components/rp-toasts.js";
import "../components/rp-view-tools.js";
import "../components/rp-vines.js";
import "../components/rp-work.js";
import { listenForDriveKeys, watchGamepad } from "./control/driving.js";
import { followWork } from "./control/follow-work.js";
import { renewLease } from "./control/lease.js";
import { initPlacing } from "./control/placing.js";
import { initReplay } from "./control/replay.js";
import { listenForSpace, multiRobot } from "./control/stop.js";
import { initTeleoperation } from "./control/teleoperation.js";
import { initViewTools } from "./control/view-tools.js";
import { socket } from "./link/socket.js";
import { now } from "./state/page-state.js";
import { initScreens } from "./state/screens.js";
import { initCues } from "./views/cues.js";
import { explainDisabled } from "./views/disabled-reasons.js";
import { fillTexts } from "./views/dom.js";
import { recordHistory } from "./views/history.js";
import { initSheets } from "./views/sheets.js";
import { keepAwake } from "./views/wake-lock.js";

fillTexts(document);
explainDisabled(document);
listenForSpace(window);
initScreens();
initReplay();
initTeleoperation();
listenForDriveKeys(window);
watchGamepad();
initPlacing();
recordHistory();
renewLease();
initViewTools();
followWork();
initSheets(window);
initCues(window);
keepAwake(document);
window.setInterval(() => now.set(performance.now()), 250);
socket.open();
if (multiRobot) {
  // Shown before it is fetched, so that nothing shifts.
  document.querySelector("rp-robots")?.removeAttribute("hidden");
  void import("../components/rp-robots.js");
}
