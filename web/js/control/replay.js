// Playback of a recording in place of a robot: the page says so, has no control of a robot, and moves in the recording.

import { ask } from "../link/api.js";
import { pageState } from "../state/page-state.js";
import { text } from "../state/texts.js";
import { isTyping } from "./stop.js";

/** @typedef {import("../link/messages.js").ReplayState} ReplayState */

/** Seconds of the recording a second. */
export const SPEEDS = Object.freeze([0.5, 1, 2, 4, 8]);
/** Step of the arrow keys (s). */
const STEP_S = 5;

/** The recording that is replayed; null with a robot. */
export function replay() {
  return pageState.get()?.replay ?? null;
}

/** @param {{ playing?: boolean, position_s?: number, speed?: number }} change */
export function seek(change) {
  const now = replay();
  if (now) void ask(text("replay.seek"), "api/replay", { playing: now.playing, ...change });
}

/** @param {number} position From the beginning (s). */
export function jump(position) {
  seek({ position_s: Math.min(Math.max(position, 0), replay()?.duration_s ?? 0) });
}

/** Pause or go on; from the end, begin again. */
export function togglePlay() {
  const now = replay();
  if (now) seek({ playing: !now.playing, ...(now.position_s >= now.duration_s ? { position_s: 0 } : {}) });
}

/** @param {number} step Faster for 1, slower for -1. */
export function changeSpeed(step) {
  const speed = SPEEDS[SPEEDS.indexOf(replay()?.speed ?? 1) + step];
  if (speed) seek({ speed });
}

/** Show the page as a recording from the first state that tells of one. */
export function initReplay() {
  const wait = pageState.subscribe((state) => {
    if (!state?.replay) return;
    wait();
    document.documentElement.dataset.replay = "";
    document.title = text("replay.document", { name: state.replay.name });
    void import("../../components/rp-replay.js");
    window.addEventListener("keydown", press);
    // It waits at its beginning until somebody looks.
    if (!state.replay.playing && state.replay.position_s === 0) seek({ playing: true });
    // A focused button would be clicked on keyup.
    window.addEventListener("keyup", (event) => event.key === " " && isButton(event) && event.preventDefault());
  });
}

/** @type {Readonly<Record<string, () => void>>} */
const KEYS = Object.freeze({
  " ": togglePlay,
  ArrowLeft: () => jump((replay()?.position_s ?? 0) - STEP_S),
  ArrowRight: () => jump((replay()?.position_s ?? 0) + STEP_S),
  Home: () => jump(0),
  "+": () => changeSpeed(1),
  "-": () => changeSpeed(-1),
});

/** @param {KeyboardEvent} event */
function isButton(event) {
  return event.target instanceof Element && event.target.closest("button") !== null;
}

/** @param {KeyboardEvent} event */
function press(event) {
  // Other controls have keys of their own, a button only Enter. The slider's arrows would move by a tenth of a second.
  const used = event.target instanceof Element && event.target.closest("a, input:not(#replay-position), select, summary");
  if (used || event.defaultPrevented || event.ctrlKey || event.altKey || event.metaKey || isTyping(event.target)) return;
  const act = KEYS[event.key];
  if (!act) return;
  event.preventDefault();
  act();
}
