// Renews the control lease from a worker, since loading the 3-D view blocks the page's thread for a second or two. A
// page that hangs longer than HANGS_MS loses control. Hold to move does not depend on this: it needs states that are
// drawn.

const EVERY_MS = 300;
const HANGS_MS = 2000;
let holding = false;
let heard = -Infinity;
let asking = false;

self.addEventListener("message", (event) => {
  holding = event.data === true;
  heard = performance.now();
});

self.setInterval(async () => {
  if (!holding || asking || performance.now() - heard > HANGS_MS) return;
  asking = true;
  try {
    await fetch("../../api/control/here", { method: "POST" });
  } catch {
    // The page itself reports the lost link.
  }
  asking = false;
}, EVERY_MS);
