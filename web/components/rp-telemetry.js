// How well the robot does: tracking, distance to its limits, and whether the computer keeps up.

import { drawerButton } from "../drawer.js";
import { element, panelHead, setText } from "../element.js";
import { isLive, link, now, pageState, staleWords } from "../state.js";
import { drawOn } from "../store.js";
import { READINGS } from "../readings.js";
import { counted } from "../words.js";
import { RpGauge } from "./rp-gauge.js";

/** What has a place here; the rest has charts alone. */
const SHOWN = READINGS.filter((reading) => reading.place !== "chart");

class RpTelemetry extends HTMLElement {
  connectedCallback() {
    const { head, note } = panelHead("Telemetry", drawerButton("charts", "Charts"));
    const title = element("summary");
    const engineers = element("details", { class: "engineers" }, title);
    this.append(head);
    const gauges = SHOWN.map((reading) => {
      const gauge = new RpGauge();
      gauge.begin(reading);
      (reading.place === "engineer" ? engineers : this).append(gauge);
      return gauge;
    });
    this.append(engineers);
    /** @type {(number|null)[]} */
    let values = SHOWN.map(() => null);
    drawOn([pageState], () => {
      const state = pageState.get();
      if (state === null) return;
      values = SHOWN.map((reading) => reading.read(state));
      values.forEach((value, index) => gauges[index]?.show(value));
      // A simulated base has none.
      const battery = gauges[SHOWN.findIndex((reading) => reading.id === "battery")];
      if (battery) battery.hidden = state.bridge?.kind === "sim";
      const warnings = gauges.filter((gauge) => gauge.parentElement === engineers && gauge.dataset.warning).length;
      setText(title, `For engineers${warnings > 0 ? ` · ${counted(warnings, "warning")}` : ""}`);
    });
    drawOn([now, link], () => {
      const words = staleWords("bridge", "controller");
      setText(note, words);
      this.classList.toggle("stale", words !== "");
      const live = isLive("bridge") && isLive("controller");
      gauges.forEach((gauge, index) => gauge.remember(live ? (values[index] ?? null) : null));
    });
    gauges.forEach((gauge) => gauge.show(null));
    setText(title, "For engineers");
  }
}

customElements.define("rp-telemetry", RpTelemetry);
