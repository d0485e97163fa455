// Charts of all readings and processes over the last five minutes. Pointing at a moment shows the values then.

import { PROCESSES } from "../js/link/messages.js";
import { ageWords } from "../js/state/format.js";
import { drawOn, signal } from "../js/state/signals.js";
import { labelOf, text } from "../js/state/texts.js";
import { element, setText } from "../js/views/dom.js";
import { SPAN_MS, history, sampled } from "../js/views/history.js";
import { READINGS, beyondLimit } from "../js/views/readings.js";

/** @typedef {{ at: number, value: number }} Sample */
/**
 * @typedef {object} Plot
 * @property {readonly Sample[]} samples Oldest first; NaN where unknown.
 * @property {number} newest Time at the right edge (ms).
 * @property {number} fullScale Minimum of the upper edge.
 * @property {readonly number[]} limits Drawn as dashed lines.
 * @property {number|null} pointed Time under the cursor (ms).
 */

/** Samples further apart than this (ms) are not connected. */
const GAP_MS = 1500;
const MINUTE_MS = 60_000;

/**
 * Clear the canvas and set its resolution to device pixels.
 *
 * @param {HTMLCanvasElement} canvas
 */
function prepareCanvas(canvas) {
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

/** @typedef {NonNullable<ReturnType<typeof prepareCanvas>>} Sheet */

/**
 * @param {Sheet} sheet
 * @param {number} newest
 */
function drawMinutes({ pen, width, height, colour }, newest) {
  pen.strokeStyle = colour("line");
  pen.lineWidth = 1;
  pen.beginPath();
  for (let back = MINUTE_MS; back < SPAN_MS; back += MINUTE_MS) {
    const x = Math.round(xAt(newest - back, newest, width)) + 0.5;
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
function xAt(at, newest, width) {
  return width * (1 - (newest - at) / SPAN_MS);
}

/**
 * @param {Sheet} sheet
 * @param {number|null} pointed
 * @param {number} newest
 */
function drawCursor({ pen, width, height, colour }, pointed, newest) {
  if (pointed === null) return;
  const x = Math.round(xAt(pointed, newest, width)) + 0.5;
  pen.strokeStyle = colour("ink");
  pen.setLineDash([]);
  pen.beginPath();
  pen.moveTo(x, 0);
  pen.lineTo(x, height);
  pen.stroke();
}

/**
 * Upper edge of a chart.
 *
 * @param {Plot} plot
 */
function upperBound({ samples, fullScale, limits }) {
  let most = Math.max(fullScale, ...limits.map((limit) => 1.1 * limit));
  for (const { value } of samples) if (value > most) most = 1.05 * value;
  return most;
}

/**
 * @param {HTMLCanvasElement} canvas
 * @param {Plot} plot
 */
function drawLine(canvas, plot) {
  const sheet = prepareCanvas(canvas);
  if (!sheet) return;
  const { pen, width, height, colour } = sheet;
  const top = upperBound(plot);
  /** @param {number} value */
  const up = (value) => height - 2 - (height - 4) * Math.max(0, value / top);
  drawMinutes(sheet, plot.newest);
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
      const x = xAt(sample.at, plot.newest, width);
      if (before && sample.at - before.at <= GAP_MS) pen.lineTo(x, up(sample.value));
      else pen.moveTo(x, up(sample.value));
    }
    before = Number.isNaN(sample.value) ? null : sample;
  }
  pen.stroke();
  pen.lineWidth = 1;
  drawCursor(sheet, plot.pointed, plot.newest);
}

/**
 * One band for each row: filled while present, a thin line while gone, empty if unknown.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {readonly (readonly Sample[])[]} rows
 * @param {number} newest
 * @param {number|null} pointed
 */
function drawBands(canvas, rows, newest, pointed) {
  const sheet = prepareCanvas(canvas);
  if (!sheet) return;
  const { pen, width, height, colour } = sheet;
  const step = height / rows.length;
  rows.forEach((samples, row) => {
    const y = row * step + 2;
    for (const [index, sample] of samples.entries()) {
      const next = samples[index + 1]?.at ?? newest;
      const x = xAt(sample.at, newest, width);
      const wide = xAt(Math.min(next, sample.at + GAP_MS), newest, width) - x + 0.5;
      pen.fillStyle = colour(sample.value > 0 ? "accent" : "bad");
      if (sample.value > 0) pen.fillRect(x, y, wide, step - 4);
      else pen.fillRect(x, y + step / 2 - 3, wide, 2);
    }
  });
  drawMinutes(sheet, newest);
  drawCursor(sheet, pointed, newest);
}

/**
 * The sample nearest to a time; null if none is within GAP_MS.
 *
 * @param {readonly Sample[]} samples
 * @param {number} at
 */
function sampleAt(samples, at) {
  let best = /** @type {Sample|null} */ (null);
  for (const sample of samples) if (!best || Math.abs(sample.at - at) < Math.abs(best.at - at)) best = sample;
  return best && Math.abs(best.at - at) <= GAP_MS && !Number.isNaN(best.value) ? best : null;
}

/** Step of the arrow keys (ms). */
const STEP_MS = 5000;

export class RpCharts extends HTMLElement {
  constructor() {
    super();
    /** Age of the moment under the cursor (ms); null without one. */
    this.back = signal(/** @type {number|null} */ (null));
    /** The live history, or a frozen copy. */
    this.shown = signal(history);
    this.isOpen = false;
    this.when = element("span", { class: "hint number", attributes: { role: "status" } });
    this.pause = element("button", { id: "pause-charts", class: "quiet", text: text("charts.pause") });
    /** @type {Node[]} */
    this.tools = [this.when, this.pause];
    this.figures = READINGS.map((reading) => figure(reading.id, text(`reading.${reading.id}`), text(`reading.${reading.id}.hint`)));
    this.presence = figure("presence", text("presence.label"), PROCESSES.map(labelOf).join(", "));
  }

  connectedCallback() {
    if (this.childElementCount > 0) return;
    this.tabIndex = 0;
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("charts.label"));
    const names = element("ol", { class: "bands" }, ...PROCESSES.map((name) => element("li", { text: labelOf(name) })));
    this.presence.canvas.before(names);
    this.presence.box.classList.add("presence-chart");
    this.append(...this.figures.map((each) => each.box), this.presence.box);
    this.pause.addEventListener("click", () => {
      this.shown.set(this.shown.get() === history ? history.copy() : history);
    });
    this.addEventListener("pointermove", (event) => this.point(event));
    this.addEventListener("pointerleave", () => this.back.set(null));
    this.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: STEP_MS, ArrowRight: -STEP_MS }[event.key];
      if (step === undefined) return;
      event.preventDefault();
      this.back.set(Math.min(SPAN_MS, Math.max(0, (this.back.get() ?? 0) + step)));
    });
    drawOn([sampled, this.back, this.shown], () => this.draw());
    new ResizeObserver(() => this.draw()).observe(this);
  }

  /** @param {boolean} open */
  open(open) {
    this.isOpen = open;
    this.draw();
  }

  /** @param {PointerEvent} event */
  point(event) {
    const canvas = /** @type {Element} */ (event.target).closest("canvas");
    if (!canvas) return;
    const box = canvas.getBoundingClientRect();
    this.back.set(SPAN_MS * Math.min(1, Math.max(0, 1 - (event.clientX - box.left) / box.width)));
  }

  draw() {
    const paused = this.shown.get() !== history;
    this.pause.setAttribute("aria-pressed", String(paused));
    setText(this.pause, text(paused ? "charts.go_on" : "charts.pause"));
    if (!this.isOpen) return;
    const shown = this.shown.get();
    const newest = shown.newest();
    const back = this.back.get();
    const pointed = back === null ? null : newest - back;
    const age = (performance.now() - (pointed ?? newest)) / 1000;
    setText(this.when, pointed !== null || paused ? text("charts.ago", { age: ageWords(Math.max(0, age)) }) : text("charts.now"));
    READINGS.forEach((reading, index) => {
      const each = this.figures[index];
      if (!each) return;
      const samples = shown.of(reading.id);
      const limits = [reading.warnAbove, reading.warnBelow].filter((limit) => limit !== undefined);
      drawLine(each.canvas, { samples, newest, fullScale: reading.fullScale, limits, pointed });
      const found = sampleAt(samples, pointed ?? newest);
      const words = found ? `${reading.format(found.value)} ${reading.unit}`.trim() : "–";
      setText(each.value, words);
      const over = beyondLimit(reading, found?.value ?? null) !== "";
      each.box.classList.toggle("warned", over);
      each.canvas.setAttribute("aria-label", text(over ? "charts.beyond" : "charts.within", { label: text(`reading.${reading.id}`), words }));
    });
    const rows = PROCESSES.map((process) => shown.of(process));
    drawBands(this.presence.canvas, rows, newest, pointed);
    const there = rows.filter((row) => (sampleAt(row, pointed ?? newest)?.value ?? 0) > 0).length;
    setText(this.presence.value, text("charts.there", { there, all: PROCESSES.length }));
    this.presence.canvas.setAttribute("aria-label", text("charts.presence", { there, all: PROCESSES.length }));
  }
}

/**
 * @param {string} id
 * @param {string} label
 * @param {string} about
 */
function figure(id, label, about) {
  const canvas = element("canvas", { attributes: { role: "img", "aria-label": label } });
  const value = element("span", { class: "chart-value number" });
  const caption = element("figcaption", {}, element("span", { text: label }), value);
  const box = element("figure", { class: "chart", data: { chart: id }, attributes: { title: about } }, caption, canvas);
  return { box, canvas, value };
}
customElements.define("rp-charts", RpCharts);
