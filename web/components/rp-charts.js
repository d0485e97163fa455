// Charts of all readings and processes over the last five minutes, with axes of values and times. Pointing at a moment shows the values then.

import { PROCESSES } from "../js/link/messages.js";
import { ageWords, significant } from "../js/state/format.js";
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
 * @property {number} fullScale Least upper end of the value axis.
 * @property {string} unit
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
  pen.font = `13px ${style.fontFamily}`;
  /** @param {string} name */
  const colour = (name) => {
    // The value of the property may be a function of the colour scheme, which a canvas does not know.
    canvas.style.setProperty("color", `var(--${name})`);
    return style.color;
  };
  return { pen, width, height, colour };
}

/** @typedef {NonNullable<ReturnType<typeof prepareCanvas>>} Sheet */

/** Room for the values, the times and half a label around the curves (px). */
const LEFT = 64;
const BOTTOM = 20;
const TOP = 8;
const RIGHT = 14;
/** Least distance of two times on the axis (px). */
const TIME_PX = 84;

/**
 * @param {number} at
 * @param {number} newest
 * @param {number} width Of the canvas.
 */
function xAt(at, newest, width) {
  return LEFT + (width - LEFT - RIGHT) * (1 - (newest - at) / SPAN_MS);
}

/**
 * The time axis: a line every minute, and as many labels as there is room for.
 *
 * @param {Sheet} sheet
 * @param {number} newest
 */
function drawTimes({ pen, width, height, colour }, newest) {
  const room = (width - LEFT - RIGHT) / (SPAN_MS / MINUTE_MS);
  const every = Math.ceil(TIME_PX / Math.max(room, 1));
  pen.strokeStyle = colour("line");
  pen.fillStyle = colour("muted");
  pen.lineWidth = 1;
  pen.textBaseline = "bottom";
  for (let back = 0; back <= SPAN_MS / MINUTE_MS; back++) {
    const x = Math.round(xAt(newest - back * MINUTE_MS, newest, width)) + 0.5;
    pen.beginPath();
    pen.moveTo(x, TOP);
    pen.lineTo(x, height - BOTTOM + 3);
    pen.stroke();
    if (back % every !== 0) continue;
    // There is no room for half of it beyond the axis.
    pen.textAlign = back === 0 ? "right" : "center";
    pen.fillText(back === 0 ? text("charts.now") : text("charts.minutes", { minutes: back }), back === 0 ? width : x, height);
  }
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
  pen.moveTo(x, TOP);
  pen.lineTo(x, height - BOTTOM);
  pen.stroke();
}

/** Ends of a value axis, in parts of a power of ten. */
const ROUND = Object.freeze([1, 1.5, 2, 3, 4, 5, 6, 8, 10]);

/**
 * Upper end of a chart's value axis: a round number above all values and limits.
 *
 * @param {Plot} plot
 */
function upperBound({ samples, fullScale, limits }) {
  let most = Math.max(fullScale, ...limits.map((limit) => 1.1 * limit));
  for (const { value } of samples) if (value > most) most = value;
  const power = 10 ** Math.floor(Math.log10(most));
  return power * (ROUND.find((each) => each * power >= most * (1 - 1e-9)) ?? 10);
}

/**
 * The value axis: the ends and the middle.
 *
 * @param {Sheet} sheet
 * @param {number} top
 * @param {string} unit
 * @param {(value: number) => number} up Height of a value (px).
 */
function drawValues({ pen, width, colour }, top, unit, up) {
  pen.strokeStyle = colour("line");
  pen.fillStyle = colour("muted");
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (const value of [0, top / 2, top]) {
    const y = Math.round(up(value)) + 0.5;
    pen.beginPath();
    pen.moveTo(LEFT, y);
    pen.lineTo(width - RIGHT, y);
    pen.stroke();
    pen.fillText(`${significant(value, 3)} ${value === 0 ? "" : unit}`.trim(), LEFT - 6, y);
  }
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
  const up = (value) => height - BOTTOM - (height - BOTTOM - TOP) * Math.max(0, value / top);
  drawTimes(sheet, plot.newest);
  drawValues(sheet, top, plot.unit, up);
  pen.strokeStyle = colour("warn");
  pen.setLineDash([4, 3]);
  for (const limit of plot.limits) {
    pen.beginPath();
    pen.moveTo(LEFT, up(limit));
    pen.lineTo(width - RIGHT, up(limit));
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
 * @param {readonly (readonly [string, readonly Sample[]])[]} rows With their names.
 * @param {number} newest
 * @param {number|null} pointed
 */
function drawBands(canvas, rows, newest, pointed) {
  const sheet = prepareCanvas(canvas);
  if (!sheet) return;
  const { pen, width, height, colour } = sheet;
  const step = (height - BOTTOM - TOP) / rows.length;
  drawTimes(sheet, newest);
  rows.forEach(([name, samples], row) => {
    const y = TOP + row * step + 2;
    pen.fillStyle = colour("muted");
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    pen.fillText(name, LEFT - 6, y + step / 2 - 2, LEFT - 6);
    for (const [index, sample] of samples.entries()) {
      const next = samples[index + 1]?.at ?? newest;
      const x = xAt(sample.at, newest, width);
      const wide = xAt(Math.min(next, sample.at + GAP_MS), newest, width) - x + 0.5;
      pen.fillStyle = colour(sample.value > 0 ? "accent" : "bad");
      if (sample.value > 0) pen.fillRect(x, y, wide, step - 4);
      else pen.fillRect(x, y + step / 2 - 3, wide, 2);
    }
  });
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
    const part = (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT);
    this.back.set(SPAN_MS * Math.min(1, Math.max(0, 1 - part)));
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
      drawLine(each.canvas, { samples, newest, fullScale: reading.fullScale, unit: reading.unit, limits, pointed });
      const found = sampleAt(samples, pointed ?? newest);
      const words = found ? `${reading.format(found.value)} ${reading.unit}`.trim() : "–";
      setText(each.value, words);
      const over = beyondLimit(reading, found?.value ?? null) !== "";
      each.box.classList.toggle("warned", over);
      each.canvas.setAttribute("aria-label", text(over ? "charts.beyond" : "charts.within", { label: text(`reading.${reading.id}`), words }));
    });
    const rows = PROCESSES.map((process) => /** @type {const} */ ([labelOf(process), shown.of(process)]));
    drawBands(this.presence.canvas, rows, newest, pointed);
    const there = rows.filter(([, row]) => (sampleAt(row, pointed ?? newest)?.value ?? 0) > 0).length;
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
