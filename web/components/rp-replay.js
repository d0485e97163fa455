// Playback of a recording: position, play and pause, and who accepted which point.

import { ask } from "../js/link/api.js";
import { dateWords } from "../js/state/format.js";
import { pageState, points } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { labelOf, text } from "../js/state/texts.js";
import { element, setText } from "../js/views/dom.js";

class RpReplay extends HTMLElement {
  toggle = element("button", { id: "replay-toggle" });
  slider = element("input", {
    id: "replay-position",
    attributes: { type: "range", min: "0", step: "0.1", value: "0", "aria-label": text("replay.position") },
  });
  time = element("span", { class: "number", attributes: { role: "status" } });
  words = element("strong");
  list = element("ul", { id: "replay-accepted" });
  /** While dragged the slider is not updated. */
  dragged = false;

  connectedCallback() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("replay.label"));
    const who = element("details", {}, element("summary", { text: text("replay.who") }), this.list);
    this.append(this.words, this.toggle, this.slider, this.time, who);
    this.toggle.addEventListener("click", () => {
      const replay = pageState.get()?.replay;
      if (!replay) return;
      const over = replay.position_s >= replay.duration_s;
      this.seek({ playing: !replay.playing, ...(over ? { position_s: 0 } : {}) });
    });
    this.slider.addEventListener("input", () => {
      this.dragged = true;
    });
    this.slider.addEventListener("change", () => {
      this.dragged = false;
      this.seek({ position_s: Number(this.slider.value), playing: pageState.get()?.replay?.playing ?? false });
    });
    drawOn([pageState], () => this.draw());
    drawOn([pageState, points], () => this.drawList());
  }

  /** @param {{ playing: boolean, position_s?: number }} request */
  seek(request) {
    void ask(text("replay.seek"), "api/replay", request);
  }

  draw() {
    const replay = pageState.get()?.replay ?? null;
    this.hidden = replay === null;
    if (replay === null) return;
    setText(this.words, text("replay.name", { name: replay.name }));
    setText(this.toggle, text(replay.playing ? "replay.pause" : "replay.play"));
    this.slider.max = String(replay.duration_s);
    if (!this.dragged) this.slider.value = String(replay.position_s);
    setText(
      this.time,
      text("replay.time", {
        at: replay.position_s.toFixed(1),
        end: replay.duration_s.toFixed(1),
        date: dateWords(replay.begins_at + replay.position_s),
      }),
    );
  }

  drawList() {
    if (this.hidden) return;
    const rows = (points.get()?.points ?? []).filter((row) => row.entry.user !== "");
    const lines = rows.map((row) => `${row.entry.point_id}: ${row.entry.user} · ${labelOf(row.entry.state)}`);
    const words = lines.length > 0 ? lines : [text("replay.nobody")];
    if (words.join("\n") === [...this.list.children].map((item) => item.textContent).join("\n")) return;
    this.list.replaceChildren(...words.map((text) => element("li", { text })));
  }
}
customElements.define("rp-replay", RpReplay);
