// Short hints at the real controls, one after another, after the first sign-in in this browser. They take no focus, lie
// over no other control that they speak of, and never over the stop.

import { link, now, pageState } from "../state/page-state.js";
import { hints } from "../state/settings.js";
import { drawOn, signal } from "../state/signals.js";
import { text } from "../state/texts.js";
import { element, setText } from "./dom.js";

const HINTS = Object.freeze([
  { name: "next", at: "rp-bar .next" },
  { name: "screens", at: "rp-screens" },
  { name: "stop", at: "#stop" },
  { name: "person", at: "#person" },
]);
/** Between a hint, its control and the edges of the screen (px). */
const GAP = 10;
/** Number of the hint that is shown; past the last one, none is. */
const shown = signal(HINTS.length);

/** Show them from the first. */
export function showHints() {
  if (!document.querySelector(".hint-card")) build();
  shown.set(0);
}

function build() {
  const words = element("p", { attributes: { role: "status" } });
  const place = element("span", { class: "hint number" });
  const next = element("button", { class: "primary", onclick: () => shown.set(shown.get() + 1) });
  const skip = element("button", { class: "quiet", text: text("hint.skip"), onclick: () => shown.set(HINTS.length) });
  const card = element(
    "aside",
    { class: "hint-card", attributes: { "aria-label": text("hint.title") } },
    words,
    element("div", { class: "hint-steps" }, place, skip, next),
  );
  card.addEventListener("keydown", (event) => event.key === "Escape" && shown.set(HINTS.length));
  // Beside the header in the order of the Tab key.
  document.querySelector("header")?.after(card);
  window.addEventListener("resize", () => draw());
  shown.subscribe((number) => {
    if (number >= HINTS.length) hints.set("seen");
  });
  const draw = () => {
    const hint = HINTS[shown.get()];
    const target = hint && document.querySelector(hint.at);
    for (const each of document.querySelectorAll(".hinted")) if (each !== target) each.classList.remove("hinted");
    // While the robot moves, or nothing is known of it, there is something else to look at.
    card.hidden = !hint || !target?.checkVisibility() || link.get().status !== "open" || !atRest();
    target?.classList.toggle("hinted", !card.hidden);
    if (!hint || !target || card.hidden) return;
    setText(words, text(`hint.${hint.name}`));
    setText(place, text("hint.place", { number: shown.get() + 1, count: HINTS.length }));
    setText(next, text(shown.get() + 1 < HINTS.length ? "hint.next_one" : "hint.done"));
    put(card, target.getBoundingClientRect());
  };
  drawOn([shown, pageState, link, now], draw);
}

function atRest() {
  return ["IDLE", "READY"].includes(pageState.get()?.controller?.mode ?? "");
}

/**
 * Beside its control, on the screen, and clear of the stop.
 *
 * @param {HTMLElement} card
 * @param {DOMRect} target
 */
function put(card, target) {
  const { offsetWidth: width, offsetHeight: height } = card;
  const middle = { x: (target.left + target.right - width) / 2, y: (target.top + target.bottom - height) / 2 };
  const places = [
    { x: middle.x, y: target.bottom + GAP },
    { x: middle.x, y: target.top - GAP - height },
    { x: target.left - GAP - width, y: middle.y },
    { x: target.right + GAP, y: middle.y },
    { x: GAP, y: innerHeight - height - GAP },
  ].map(({ x, y }) => ({ x: within(x, innerWidth - width), y: within(y, innerHeight - height) }));
  const stop = document.querySelector("#stop")?.getBoundingClientRect();
  const free = places.find((at) => [target, stop].every((box) => !box || isClear(at, width, height, box)));
  const { x, y } = free ?? { x: GAP, y: innerHeight - height - GAP };
  card.style.setProperty("left", `${x}px`);
  card.style.setProperty("top", `${y}px`);
}

/**
 * @param {number} at
 * @param {number} room
 */
function within(at, room) {
  return Math.max(GAP, Math.min(at, room - GAP));
}

/**
 * @param {{x: number, y: number}} at
 * @param {number} width
 * @param {number} height
 * @param {DOMRect} box
 */
function isClear({ x, y }, width, height, box) {
  return x >= box.right || x + width <= box.left || y >= box.bottom || y + height <= box.top;
}
