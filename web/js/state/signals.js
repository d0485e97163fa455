// Signals: observable values, and drawing at most once a frame.

/**
 * @template T
 * @typedef {object} Signal
 * @property {() => T} get The value now.
 * @property {(value: T) => void} set Replaces the value and notifies all listeners synchronously.
 * @property {(listener: (value: T) => void) => () => void} subscribe Returns a function that ends the subscription.
 */

/**
 * @template T
 * @param {T} initial
 * @returns {Signal<T>}
 */
export function signal(initial) {
  let value = initial;
  /** @type {Set<(value: T) => void>} */
  const listeners = new Set();
  return {
    get: () => value,
    set(next) {
      if (Object.is(next, value)) return;
      value = next;
      for (const listener of [...listeners]) listener(value);
    },
    subscribe(listener) {
      listeners.add(listener);
      return () => listeners.delete(listener);
    },
  };
}

/** @type {Set<() => void>} */
const waiting = new Set();

function flush() {
  const draws = [...waiting];
  waiting.clear();
  for (const draw of draws) draw();
}

/**
 * Draw now, and again in the next animation frame after any of the signals has changed.
 *
 * @param {readonly Pick<Signal<any>, "subscribe">[]} signals
 * @param {() => void} draw
 */
export function drawOn(signals, draw) {
  const request = () => {
    if (waiting.size === 0) requestAnimationFrame(flush);
    waiting.add(draw);
  };
  for (const each of signals) each.subscribe(request);
  draw();
}
