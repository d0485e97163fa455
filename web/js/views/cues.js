// Sound and vibration when the robot pauses, stops or has finished: the operator looks at the vines, not at the screen.

import { link, pageState } from "../state/page-state.js";
import { sound, vibration } from "../state/settings.js";

/** @typedef {import("../link/messages.js").Mode} Mode */
/** @typedef {"pause"|"stop"|"finished"} Cue */

/** Tones (Hz) one after another, and milliseconds of vibration and rest in turn. */
const CUES = Object.freeze({
  pause: { tones: [660, 440], pattern: [200, 100, 200] },
  stop: { tones: [880, 587, 880, 587], pattern: [400, 100, 400, 100, 400] },
  finished: { tones: [523, 659, 784], pattern: [80, 60, 80, 60, 250] },
});
const TONE_S = 0.22;
const LOUDNESS = 0.25;
/** After the last cue the loudspeaker is let go (ms). */
const REST_MS = 3000;
/** Modes that a stop or fault leads to. */
const STOPPED = new Set(["PROTECTIVE_STOP", "FAULT", "ESTOP_LATCHED"]);

/** Browsers allow sound and vibration after the first press alone. @type {AudioContext|null} */
let audio = null;
let resting = 0;

/** @param {Window} target Window whose presses count. */
export function initCues(target) {
  for (const name of ["pointerdown", "keydown"]) target.addEventListener(name, wake, { capture: true, once: true });
  let before = /** @type {Mode|null} */ (null);
  let linked = false;
  const look = () => {
    const open = link.get().status === "open";
    const state = pageState.get();
    const mode = state?.controller?.mode ?? null;
    // Without the link nobody here sees what happens at the vines.
    const cue = linked && !open && before === "AUTO" ? "stop" : open ? cueOf(before, mode) : null;
    [before, linked] = [mode, open];
    if (cue && !state?.replay) play(cue);
  };
  for (const each of [pageState, link]) each.subscribe(look);
}

/**
 * @param {Mode|null} before
 * @param {Mode|null} after
 * @returns {Cue|null}
 */
function cueOf(before, after) {
  if (before === null || after === null || before === after) return null;
  if (STOPPED.has(after)) return "stop";
  // After an acknowledgement it waits for the person who is there.
  if (after === "PAUSED") return STOPPED.has(before) ? null : "pause";
  return before === "AUTO" && after === "READY" ? "finished" : null;
}

function wake() {
  audio ??= new AudioContext();
  rest();
}

/** @param {Cue} cue */
export function play(cue) {
  // Before a press, browsers refuse both, and complain.
  const context = audio;
  if (!context) return;
  const { tones, pattern } = CUES[cue];
  if (vibration.get() === "on") navigator.vibrate?.(pattern);
  if (sound.get() !== "on") return;
  void context.resume().then(() => {
    for (const [number, frequency] of tones.entries()) tone(context, frequency, context.currentTime + number * TONE_S);
    rest();
  });
}

function rest() {
  clearTimeout(resting);
  resting = setTimeout(() => void audio?.suspend(), REST_MS);
}

/**
 * @param {AudioContext} context
 * @param {number} frequency Hz.
 * @param {number} at When it begins (s, the context's clock).
 */
function tone(context, frequency, at) {
  const [source, volume] = [context.createOscillator(), context.createGain()];
  source.type = "triangle";
  source.frequency.value = frequency;
  // Without ramps it clicks.
  volume.gain.setValueAtTime(0, at);
  volume.gain.linearRampToValueAtTime(LOUDNESS, at + 0.02);
  volume.gain.linearRampToValueAtTime(0, at + TONE_S);
  source.connect(volume).connect(context.destination);
  source.start(at);
  source.stop(at + TONE_S);
}
