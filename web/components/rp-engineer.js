// The screen for engineers: processes, telemetry, charts and log.

import { screen } from "../js/state/screens.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element } from "../js/views/dom.js";
import { RpCharts } from "./rp-charts.js";
import "./rp-log.js";
import "./rp-processes.js";
import "./rp-telemetry.js";

class RpEngineer extends HTMLElement {
  connectedCallback() {
    const charts = new RpCharts();
    const head = element("div", { class: "panel-head" }, element("h2", { text: text("charts.title") }), ...charts.tools);
    const panel = (/** @type {string} */ name) => element("div", { class: "panel" }, document.createElement(name));
    this.replaceChildren(
      panel("rp-processes"),
      panel("rp-telemetry"),
      element("section", { class: "panel charts-panel" }, head, charts),
      panel("rp-log"),
    );
    drawOn([screen], () => charts.open(screen.get() === "engineer"));
  }
}
customElements.define("rp-engineer", RpEngineer);
