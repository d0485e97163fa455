// Playback of a recording: play and pause, speed, and its timeline as the scrubber.

import { SPEEDS, jump, replay, seek, togglePlay } from "../js/control/replay.js";
import { dateWords } from "../js/state/format.js";
import { pageState } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { isMark, timeline } from "../js/state/timeline.js";
import { dropDown, element, setAttribute, setText } from "../js/views/dom.js";
import { icon, setIcon } from "../js/views/icons.js";
import { RpTimeline } from "./rp-timeline.js";

/** An event this long before the position (s) was jumped to just now. */
const JUST_S = 1;

class RpReplay extends HTMLElement {
  timeline = new RpTimeline();
  shape = element("span", { class: "shape" });
  label = element("span");
  toggle = element("button", { id: "replay-toggle", onclick: togglePlay }, this.shape, this.label);
  slider = element("input", {
    id: "replay-position",
    attributes: { type: "range", min: "0", step: "0.1", value: "0", "aria-label": text("replay.position") },
  });
  speed = dropDown(
    { id: "replay-speed", attributes: { "aria-label": text("replay.speed"), title: text("replay.speed_keys") } },
    SPEEDS.map((each) => [String(each), text("replay.times", { speed: each })]),
  );
  time = element("span", { class: "number replay-time", attributes: { role: "timer" } });
  words = element("strong");
  /** While dragged the slider is not updated. */
  dragged = false;

  connectedCallback() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("replay.label"));
    this.append(
      element("div", { class: "replay-name" }, element("span", { class: "chip", text: text("replay.label") }), this.words),
      element("div", { class: "replay-tools" }, step(-1), this.toggle, step(1), this.speed, this.time),
      element("div", { class: "replay-scrubber" }, this.timeline, this.slider),
    );
    this.slider.addEventListener("input", () => {
      this.dragged = true;
    });
    this.slider.addEventListener("change", () => {
      this.dragged = false;
      jump(Number(this.slider.value));
    });
    this.speed.addEventListener("change", () => seek({ speed: Number(this.speed.value) }));
    this.hidden = false;
    this.timeline.open(true);
    drawOn([pageState], () => this.draw());
  }

  draw() {
    const now = replay();
    if (now === null) return;
    setText(this.words, text(now.complete ? "replay.name" : "replay.cut_short", { name: now.name }));
    setIcon(this.shape, now.playing ? "PAUSED" : "AUTO");
    setText(this.label, text(now.playing ? "replay.pause" : "replay.play"));
    setAttribute(this.slider, "max", String(now.duration_s));
    if (!this.dragged) this.slider.value = String(now.position_s);
    if (document.activeElement !== this.speed) this.speed.value = String(now.speed);
    const [at, end] = [lapse(now.position_s), lapse(now.duration_s)];
    const date = dateWords(now.begins_at + now.position_s);
    setText(this.time, text("replay.time", { at, end, date }));
    setAttribute(this.slider, "aria-valuetext", text("replay.time", { at, end, date }));
  }
}

/**
 * Button to the next or the previous event.
 *
 * @param {1|-1} way
 */
function step(way) {
  const name = text(way > 0 ? "replay.next" : "replay.previous");
  const attributes = { "aria-label": name, title: name };
  return element("button", { class: "quiet", data: { step: String(way) }, attributes, onclick: () => toEvent(way) }, icon(way > 0 ? "next" : "previous"));
}

/** @param {1|-1} way */
function toEvent(way) {
  const now = replay();
  if (!now) return;
  const times = (timeline.get()?.events ?? []).filter(isMark).map((event) => event.at - now.begins_at);
  const found =
    way > 0
      ? times.find((at) => at > now.position_s + 1e-3)
      : times.reverse().find((at) => at < now.position_s - (now.playing ? JUST_S : 1e-3));
  if (found !== undefined) jump(found);
}

/** Minutes and seconds. @param {number} seconds */
function lapse(seconds) {
  return `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;
}
customElements.define("rp-replay", RpReplay);
