// The thread beside the page's. It says that the page is there as long as the page has turned lately: a page that hangs for
// longer has lost control. Whether anybody sees the robot, and holds, is not told here but by what the page draws.

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
    // Without a link nobody can be told; the page itself says so and tries again.
  }
  asking = false;
}, EVERY_MS);
