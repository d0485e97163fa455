// Short hints at the real controls, one after another, after the first sign-in in this browser. They take no focus, and
// lie over the view among the banners, where they cover no control. The control that one speaks of has an outline.

import { link, now, pageState } from "../state/page-state.js";
import { screen } from "../state/screens.js";
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
  document.querySelector(".notices")?.append(card);
  shown.subscribe((number) => {
    if (number >= HINTS.length) hints.set("seen");
  });
  drawOn([shown, pageState, link, now, screen], () => {
    const hint = HINTS[shown.get()];
    const target = hint && document.querySelector(hint.at);
    for (const each of document.querySelectorAll(".hinted")) if (each !== target) each.classList.remove("hinted");
    // While the robot moves, or nothing is known of it, there is something else to look at.
    const elsewhere = screen.get() !== "work" || link.get().status !== "open" || !atRest();
    card.hidden = !hint || !target?.checkVisibility() || elsewhere;
    target?.classList.toggle("hinted", !card.hidden);
    if (!hint || !target || card.hidden) return;
    setText(words, text(`hint.${hint.name}`));
    setText(place, text("hint.place", { number: shown.get() + 1, count: HINTS.length }));
    setText(next, text(shown.get() + 1 < HINTS.length ? "hint.next_one" : "hint.done"));
  });
}

function atRest() {
  return ["IDLE", "READY"].includes(pageState.get()?.controller?.mode ?? "");
}
