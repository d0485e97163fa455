// Ring buffers with the last five minutes of readings and process presence, four samples a second.

import { PROCESSES } from "../link/messages.js";
import { isLive, now, pageState } from "../state/page-state.js";
import { signal } from "../state/signals.js";
import { READINGS } from "./readings.js";

export const SPAN_MS = 300_000;
const LENGTH = 1200;

class History {
  /** @param {readonly string[]} names */
  constructor(names) {
    this.names = names;
    this.count = 0;
    this.times = new Float64Array(LENGTH);
    /** A ring buffer for each name. */
    this.rings = names.map(() => new Float32Array(LENGTH));
  }

  /**
   * @param {number} at Page's clock (ms).
   * @param {readonly (number|null)[]} values In the order of the names; null when unknown.
   */
  add(at, values) {
    const index = this.count % LENGTH;
    this.times[index] = at;
    this.rings.forEach((ring, row) => {
      ring[index] = values[row] ?? NaN;
    });
    this.count += 1;
  }

  /**
   * Samples of a name within the span, oldest first.
   *
   * @param {string} name
   * @returns {{ at: number, value: number }[]} `value` is NaN where it is unknown.
   */
  of(name) {
    const ring = this.rings[this.names.indexOf(name)];
    const out = [];
    const newest = this.newest();
    for (let number = Math.max(0, this.count - LENGTH); ring && number < this.count; number++) {
      const at = this.times[number % LENGTH] ?? 0;
      if (newest - at <= SPAN_MS) out.push({ at, value: ring[number % LENGTH] ?? NaN });
    }
    return out;
  }

  /** Time of the newest sample (ms). */
  newest() {
    return this.count === 0 ? 0 : (this.times[(this.count - 1) % LENGTH] ?? 0);
  }

  /** A frozen copy. */
  copy() {
    const other = new History(this.names);
    other.count = this.count;
    other.times.set(this.times);
    other.rings.forEach((ring, row) => ring.set(this.rings[row] ?? []));
    return other;
  }
}

export const history = new History([...READINGS.map((reading) => reading.id), ...PROCESSES, "ticks"]);
/** Grows with each sample. */
export const sampled = signal(0);

/** Add a sample at every update of the page's clock. */
export function recordHistory() {
  now.subscribe((at) => {
    const state = pageState.get();
    const live = isLive("bridge") && isLive("controller");
    const values = READINGS.map((reading) => {
      if (state === null || (!live && reading.id !== "page-round-trip")) return null;
      return reading.read(state);
    });
    history.add(at, [
      ...values,
      ...PROCESSES.map((process) => Number(isLive(process))),
      state?.controller?.ticks ?? null,
    ]);
    sampled.set(sampled.get() + 1);
  });
}
