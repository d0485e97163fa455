// Every reading over the last five minutes, and which process was there: point at a moment to read all of them then.

import { drawBands, drawLine, sampleAt } from "../charts.js";
import { element, setText } from "../element.js";
import { SPAN_MS, history, sampled } from "../history.js";
import { PROCESSES } from "../messages.js";
import { READINGS } from "../readings.js";
import { drawOn, signal } from "../store.js";
import { ageWords } from "../words.js";

/** An arrow key moves the moment that is pointed at by so much (ms). */
const STEP_MS = 5000;

export class RpCharts extends HTMLElement {
  constructor() {
    super();
    /** How long ago the moment is that is pointed at (ms); null when none is. */
    this.back = signal(/** @type {number|null} */ (null));
    /** What is looked at: the history as it grows, or as it was. */
    this.shown = signal(history);
    this.isOpen = false;
    this.when = element("span", { class: "hint number", attributes: { role: "status" } });
    this.pause = element("button", { id: "pause-charts", class: "quiet", text: "Pause", attributes: { type: "button" } });
    /** @type {Node[]} */
    this.tools = [this.when, this.pause];
    this.figures = READINGS.map((reading) => figure(reading.id, reading.label, reading.about));
    this.presence = figure("presence", "Processes", PROCESSES.join(", "));
  }

  connectedCallback() {
    if (this.childElementCount > 0) return;
    this.tabIndex = 0;
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", "Charts; left and right arrow point at a moment");
    const names = element("ol", { class: "bands" }, ...PROCESSES.map((name) => element("li", { text: name })));
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
    setText(this.pause, paused ? "Go on" : "Pause");
    if (!this.isOpen) return;
    const shown = this.shown.get();
    const newest = shown.newest();
    const back = this.back.get();
    const pointed = back === null ? null : newest - back;
    const age = (performance.now() - (pointed ?? newest)) / 1000;
    setText(this.when, pointed !== null || paused ? `${ageWords(Math.max(0, age))} ago` : "now");
    READINGS.forEach((reading, index) => {
      const each = this.figures[index];
      if (!each) return;
      const samples = shown.of(reading.id);
      const limits = [reading.warnAbove, reading.warnBelow].filter((limit) => limit !== undefined);
      drawLine(each.canvas, { samples, newest, full: reading.full, limits, pointed });
      const found = sampleAt(samples, pointed ?? newest);
      const words = found ? `${reading.write(found.value)} ${reading.unit}`.trim() : "–";
      setText(each.value, words);
      const over = found !== null && (found.value > (reading.warnAbove ?? Infinity) || found.value < (reading.warnBelow ?? -Infinity));
      each.box.classList.toggle("warned", over);
      each.canvas.setAttribute("aria-label", `${reading.label}: ${words}${over ? ", beyond its limit" : ""}`);
    });
    const rows = PROCESSES.map((process) => shown.of(process));
    drawBands(this.presence.canvas, rows, newest, pointed);
    const there = rows.filter((row) => (sampleAt(row, pointed ?? newest)?.value ?? 0) > 0).length;
    setText(this.presence.value, `${there} of ${PROCESSES.length}`);
    this.presence.canvas.setAttribute("aria-label", `Processes that were there: ${there} of ${PROCESSES.length}`);
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
