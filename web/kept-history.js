// The charts' readings of this robot, kept in this tab while another robot's page is open, for the way back.

import { SPAN_MS, history } from "./history.js";

const KEY = `history of ${location.pathname}`;

/** When samples were taken (ms since 1970), and what was read: one row a name, null where it was unknown. @typedef {{ at: number[], rows: (number|null)[][] }} Kept */

export function keepHistoryOver() {
  takeBack();
  window.addEventListener("pagehide", () => sessionStorage.setItem(KEY, JSON.stringify(kept())));
}

/** @returns {Kept} */
function kept() {
  const rows = history.names.map((name) => history.of(name));
  const short = (/** @type {number} */ value) => (Number.isNaN(value) ? null : Number(value.toPrecision(5)));
  return {
    at: (rows[0] ?? []).map((sample) => Math.round(sample.at + performance.timeOrigin)),
    rows: rows.map((samples) => samples.map((sample) => short(sample.value))),
  };
}

function takeBack() {
  const text = sessionStorage.getItem(KEY);
  if (text === null) return;
  /** @type {Kept} */
  const { at, rows } = JSON.parse(text);
  // Another version of this page may have kept other readings.
  if (rows.length !== history.names.length) return;
  const since = history.copy();
  history.count = 0;
  at.forEach((wall, index) => {
    const sampled = wall - performance.timeOrigin;
    if (performance.now() - sampled < SPAN_MS) history.take(sampled, rows.map((row) => row[index] ?? null));
  });
  const fresh = since.names.map((name) => since.of(name));
  fresh[0]?.forEach((sample, index) => history.take(sample.at, fresh.map((samples) => samples[index]?.value ?? null)));
}
