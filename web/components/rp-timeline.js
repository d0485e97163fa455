// The session on a time axis: modes as a band, cuts, stops, pauses and refusals as marks. In a replay a mark is jumped to.

import { jump, replay } from "../js/control/replay.js";
import { clockWords } from "../js/state/format.js";
import { pageState } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { counted, labelOf, text } from "../js/state/texts.js";
import { fetchTimeline, isMark, modeSpans, ticks, timeline } from "../js/state/timeline.js";
import { element, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";

/** @typedef {import("../js/state/timeline.js").TimelineEvent} TimelineEvent */
/** @typedef {{ at: number, row: "cuts"|"others", events: TimelineEvent[] }} Mark */

/** The controller tells it every 5 s. */
const AGAIN_MS = 5000;
/** Width of a mark, and of a tick's time (px). */
const MARK_PX = 30;
const TICK_PX = 90;
/** Width of the timeline on a sheet of A4, at the size of the screen's letters (px). */
const PAPER_PX = 640;
/** Width of a letter of a mode's name (px). */
const LETTER_PX = 9.5;
/** Events of a mark whose words are shown. */
const MOST_WORDS = 4;
/** From the least to the most severe. */
const RANKS = Object.freeze(["cut", "refusal", "failed_cut", "PAUSED", "PROTECTIVE_STOP", "FAULT", "ESTOP_LATCHED"]);
/** @type {Readonly<Record<string, string>>} */
const ICONS = Object.freeze({ cut: "DONE", "failed_cut": "FAILED_NOT_CUT", refusal: "REJECTED" });

export class RpTimeline extends HTMLElement {
  timer = 0;
  modes = element("div", { class: "time-modes", attributes: { "aria-hidden": "true" } });
  marks = element("div", { class: "time-marks", attributes: { role: "toolbar", "aria-label": text("timeline.marks") } });
  axis = element("div", { class: "time-axis number", attributes: { "aria-hidden": "true" } });
  here = element("div", { class: "time-here", attributes: { "aria-hidden": "true" } });
  track = element("div", { class: "time-track" }, this.modes, this.marks, this.axis, this.here);
  words = element("p", { class: "time-words", attributes: { role: "status" } });
  /** What the marks were drawn of. */
  drawn = "";
  onPaper = false;

  connectedCallback() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("timeline.label"));
    this.append(this.track, this.words);
    this.marks.addEventListener("keydown", (event) => this.move(event));
    new ResizeObserver(() => this.draw()).observe(this.track);
    for (const each of ["beforeprint", "afterprint"])
      window.addEventListener(each, () => {
        this.onPaper = each === "beforeprint";
        this.draw();
      });
    drawOn([timeline], () => this.draw());
    drawOn([pageState, timeline], () => this.drawHere());
  }

  /** Keep it up to date while it is shown. @param {boolean} shown */
  open(shown) {
    window.clearInterval(this.timer);
    if (!shown) return;
    void fetchTimeline();
    this.timer = window.setInterval(() => void fetchTimeline(), AGAIN_MS);
  }

  draw() {
    const told = timeline.get();
    const width = this.onPaper ? PAPER_PX : this.track.clientWidth;
    const span = told ? told.ended_at - told.began_at : 0;
    this.classList.toggle("nothing", span <= 0);
    if (!told || span <= 0) {
      setText(this.words, text("timeline.nothing"));
      return;
    }
    if (width === 0) return;
    const now = pageState.get()?.controller?.mode ?? "";
    /** @param {number} at */
    const place = (at) => `${((100 * (at - told.began_at)) / span).toFixed(3)}%`;
    const bands = modeSpans(told, now).map((each) => {
      const wide = ((each.to - each.from) / span) * width > 12 + LETTER_PX * labelOf(each.mode).length;
      const band = element("span", { class: "time-mode", text: wide ? labelOf(each.mode) : "", data: { mode: each.mode } });
      band.style.setProperty("left", place(each.from));
      band.style.setProperty("width", place(told.began_at + each.to - each.from));
      return band;
    });
    this.modes.replaceChildren(...bands);
    // The time stands to the right of its tick.
    const last = told.ended_at - (span * TICK_PX) / width;
    const times = ticks(told.began_at, told.ended_at, Math.max(2, Math.floor(width / TICK_PX))).filter((at) => at < last);
    this.axis.replaceChildren(
      ...times.map((at) => {
        const tick = element("span", { text: clockWords(at) });
        tick.style.setProperty("left", place(at));
        return tick;
      }),
    );
    // Marks that are as before stay, and with them the focus.
    const key = JSON.stringify([width, told]);
    if (key === this.drawn) return;
    this.drawn = key;
    const marks = groups(told.events.filter(isMark), (span * MARK_PX) / width);
    const at = [...this.marks.children].indexOf(document.activeElement ?? this);
    this.marks.replaceChildren(...marks.map((mark) => this.markOf(mark, place)));
    const first = /** @type {HTMLElement|undefined} */ (this.marks.children[Math.max(0, at)]);
    if (first) first.tabIndex = 0;
    if (at >= 0) first?.focus();
    else setText(this.words, told.left_out > 0 ? counted("timeline.left_out", told.left_out) : this.hint(marks.length));
  }

  /** @param {number} count Of the marks. */
  hint(count) {
    if (count === 0) return text("timeline.no_marks");
    return text(replay() ? "timeline.press" : "timeline.point");
  }

  /**
   * @param {Mark} mark
   * @param {(at: number) => string} place
   */
  markOf({ at, row, events }, place) {
    const worst = events.map(kindOf).sort((a, b) => RANKS.indexOf(b) - RANKS.indexOf(a))[0] ?? "cut";
    const words = wordsOf(events);
    const button = element(
      "button",
      { class: "time-mark", data: { row, kind: worst }, attributes: { "aria-label": words, tabindex: "-1" } },
      icon(ICONS[worst] ?? worst),
      ...(events.length > 1 ? [element("span", { text: String(events.length) })] : []),
    );
    button.style.setProperty("left", place(at));
    const tell = () => setText(this.words, words);
    button.addEventListener("focus", tell);
    button.addEventListener("pointerenter", tell);
    button.addEventListener("click", () => {
      tell();
      const begins = replay()?.begins_at;
      if (begins !== undefined) jump(at - begins);
    });
    return button;
  }

  /** The marks are one stop of the Tab key: arrows go from one to the next. @param {KeyboardEvent} event */
  move(event) {
    const all = /** @type {HTMLElement[]} */ ([...this.marks.children]);
    const at = all.indexOf(/** @type {HTMLElement} */ (document.activeElement));
    const steps = /** @type {Record<string, number>} */ ({ ArrowLeft: at - 1, ArrowRight: at + 1, Home: 0, End: all.length - 1 });
    const next = all[steps[event.key] ?? -1];
    if (!next) return;
    event.preventDefault();
    event.stopPropagation();
    for (const each of all) each.tabIndex = each === next ? 0 : -1;
    next.focus();
  }

  drawHere() {
    const [told, now] = [timeline.get(), replay()];
    this.here.hidden = !told || !now;
    if (now) this.here.style.setProperty("left", `${((100 * now.position_s) / Math.max(now.duration_s, 1e-3)).toFixed(3)}%`);
  }
}

/** @param {TimelineEvent} event */
function kindOf({ kind, mode }) {
  return kind === "mode" ? mode : kind;
}

/**
 * Events that are too near for marks of their own, together.
 *
 * @param {readonly TimelineEvent[]} events Oldest first.
 * @param {number} apart Least distance of two marks (s).
 */
function groups(events, apart) {
  /** @type {Mark[]} */
  const marks = [];
  /** @type {Partial<Record<string, Mark>>} */
  const last = {};
  for (const event of events) {
    const row = event.kind === "cut" || event.kind === "failed_cut" ? "cuts" : "others";
    const before = last[row];
    if (before && event.at - before.at < apart) {
      before.events.push(event);
      continue;
    }
    const mark = { at: event.at, row: /** @type {"cuts"|"others"} */ (row), events: [event] };
    last[row] = mark;
    marks.push(mark);
  }
  return marks;
}

/** @param {readonly TimelineEvent[]} events */
function wordsOf(events) {
  const lines = events.slice(0, MOST_WORDS).map((event) => `${clockWords(event.at)} ${reasonText(event.reason)}`);
  const more = events.length - lines.length;
  return [...lines, ...(more > 0 ? [counted("timeline.more", more)] : [])].join(" · ");
}
customElements.define("rp-timeline", RpTimeline);
