// Small charts of the last minutes on a canvas: a line with its limit, or whether something was there.

import { SPAN_MS } from "./history.js";

/** @typedef {{ at: number, value: number }} Sample */
/**
 * @typedef {object} Plot
 * @property {readonly Sample[]} samples Oldest first; NaN where unknown.
 * @property {number} newest Time at the right edge (ms).
 * @property {number} full Least value of the upper edge.
 * @property {readonly number[]} limits Drawn as broken lines.
 * @property {number|null} pointed Time that is pointed at (ms).
 */

/** Samples further apart than this (ms) are not joined. */
const GAP_MS = 1500;
const MINUTE_MS = 60_000;

/**
 * The canvas in the screen's own pixels, cleared, with the page's colours.
 *
 * @param {HTMLCanvasElement} canvas
 */
function prepared(canvas) {
  const scale = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * scale)) canvas.width = Math.round(width * scale);
  if (canvas.height !== Math.round(height * scale)) canvas.height = Math.round(height * scale);
  const pen = canvas.getContext("2d");
  if (!pen || width === 0) return null;
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  const style = getComputedStyle(canvas);
  /** @param {string} name */
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  return { pen, width, height, colour };
}

/** @typedef {NonNullable<ReturnType<typeof prepared>>} Sheet */

/**
 * @param {Sheet} sheet
 * @param {number} newest
 */
function minutes({ pen, width, height, colour }, newest) {
  pen.strokeStyle = colour("line");
  pen.lineWidth = 1;
  pen.beginPath();
  for (let back = MINUTE_MS; back < SPAN_MS; back += MINUTE_MS) {
    const x = Math.round(across(newest - back, newest, width)) + 0.5;
    pen.moveTo(x, 0);
    pen.lineTo(x, height);
  }
  pen.moveTo(0, height - 0.5);
  pen.lineTo(width, height - 0.5);
  pen.stroke();
}

/**
 * @param {number} at
 * @param {number} newest
 * @param {number} width
 */
function across(at, newest, width) {
  return width * (1 - (newest - at) / SPAN_MS);
}

/**
 * @param {Sheet} sheet
 * @param {number|null} pointed
 * @param {number} newest
 */
function pointer({ pen, width, height, colour }, pointed, newest) {
  if (pointed === null) return;
  const x = Math.round(across(pointed, newest, width)) + 0.5;
  pen.strokeStyle = colour("ink");
  pen.setLineDash([]);
  pen.beginPath();
  pen.moveTo(x, 0);
  pen.lineTo(x, height);
  pen.stroke();
}

/**
 * Upper edge of a chart: as much as is needed, and at least what is usual.
 *
 * @param {Plot} plot
 */
function ceiling({ samples, full, limits }) {
  let most = Math.max(full, ...limits.map((limit) => 1.1 * limit));
  for (const { value } of samples) if (value > most) most = 1.05 * value;
  return most;
}

/**
 * @param {HTMLCanvasElement} canvas
 * @param {Plot} plot
 */
export function drawLine(canvas, plot) {
  const sheet = prepared(canvas);
  if (!sheet) return;
  const { pen, width, height, colour } = sheet;
  const top = ceiling(plot);
  /** @param {number} value */
  const up = (value) => height - 2 - (height - 4) * Math.max(0, value / top);
  minutes(sheet, plot.newest);
  pen.strokeStyle = colour("warn");
  pen.setLineDash([4, 3]);
  for (const limit of plot.limits) {
    pen.beginPath();
    pen.moveTo(0, up(limit));
    pen.lineTo(width, up(limit));
    pen.stroke();
  }
  pen.setLineDash([]);
  pen.strokeStyle = colour("accent");
  pen.lineWidth = 1.5;
  pen.beginPath();
  let before = /** @type {Sample|null} */ (null);
  for (const sample of plot.samples) {
    if (!Number.isNaN(sample.value)) {
      const x = across(sample.at, plot.newest, width);
      if (before && sample.at - before.at <= GAP_MS) pen.lineTo(x, up(sample.value));
      else pen.moveTo(x, up(sample.value));
    }
    before = Number.isNaN(sample.value) ? null : sample;
  }
  pen.stroke();
  pen.lineWidth = 1;
  pointer(sheet, plot.pointed, plot.newest);
}

/**
 * A band for each of several: full where it was there, an outline where it was not, empty where nothing is known.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {readonly (readonly Sample[])[]} rows
 * @param {number} newest
 * @param {number|null} pointed
 */
export function drawBands(canvas, rows, newest, pointed) {
  const sheet = prepared(canvas);
  if (!sheet) return;
  const { pen, width, height, colour } = sheet;
  const step = height / rows.length;
  rows.forEach((samples, row) => {
    const y = row * step + 2;
    for (const [index, sample] of samples.entries()) {
      const next = samples[index + 1]?.at ?? newest;
      const x = across(sample.at, newest, width);
      const wide = across(Math.min(next, sample.at + GAP_MS), newest, width) - x + 0.5;
      pen.fillStyle = colour(sample.value > 0 ? "accent" : "bad");
      if (sample.value > 0) pen.fillRect(x, y, wide, step - 4);
      else pen.fillRect(x, y + step / 2 - 3, wide, 2);
    }
  });
  minutes(sheet, newest);
  pointer(sheet, pointed, newest);
}

/**
 * The sample nearest to a time; null where none is near.
 *
 * @param {readonly Sample[]} samples
 * @param {number} at
 */
export function sampleAt(samples, at) {
  let best = /** @type {Sample|null} */ (null);
  for (const sample of samples) if (!best || Math.abs(sample.at - at) < Math.abs(best.at - at)) best = sample;
  return best && Math.abs(best.at - at) <= GAP_MS && !Number.isNaN(best.value) ? best : null;
}
