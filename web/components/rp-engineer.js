// The screen for engineers: panels that are moved by buttons or dragged by their titles, hidden and shown.

import { fetchJson } from "../js/link/api.js";
import { PROCESSES } from "../js/link/messages.js";
import { ageWords, dateWords, significant, spanWords } from "../js/state/format.js";
import { isLive, isOpening, link, now, pageState, points, preview, processAge } from "../js/state/page-state.js";
import { PANELS, arrangement, movePanel, placePanel, resetPanels, showPanel } from "../js/state/panels.js";
import { capital, partsOf, reasonText, severityOf } from "../js/state/reasons.js";
import { screen, whileOpen } from "../js/state/screens.js";
import { drawOn, signal } from "../js/state/signals.js";
import { counted, labelOf, text } from "../js/state/texts.js";
import { alarms } from "../js/views/alarms.js";
import { element, setAttribute, setText } from "../js/views/dom.js";
import { icon, setIcon } from "../js/views/icons.js";
import { RpCharts } from "./rp-charts.js";
import "./rp-calibration.js";
import "./rp-log.js";
import "./rp-telemetry.js";

/** @typedef {import("../js/link/messages.js").Diagnostics} Diagnostics */
/** @typedef {import("../js/link/messages.js").TopicTraffic} TopicTraffic */
/** @typedef {import("../js/state/panels.js").PanelName} PanelName */

/** Period of the diagnostics while the screen is open (ms). */
const AGAIN_MS = 2000;
/** A topic with a rate is late after so many of its periods, and at least after so long (s). */
const LATE_PERIODS = 5;
const LATE_S = 2;

const diagnostics = signal(/** @type {Diagnostics|null} */ (null));

class RpEngineer extends HTMLElement {
  charts = new RpCharts();
  /** @type {Map<PanelName, HTMLElement>} */
  panels = new Map();
  hiddenOnes = element("div", { class: "hidden-panels" });
  /** What is dragged. @type {PanelName|null} */
  dragged = null;

  connectedCallback() {
    const reset = element("button", { id: "reset-panels", class: "quiet", text: text("panels.reset"), onclick: () => this.reset() });
    const tools = element("div", { class: "panel-tools", attributes: { role: "group", "aria-label": text("panels.label") } }, this.hiddenOnes, reset);
    this.replaceChildren(tools);
    /** @type {Readonly<Record<PanelName, readonly Node[]>>} */
    const content = {
      alarms: [alarmList()],
      processes: [processTable()],
      telemetry: [document.createElement("rp-telemetry")],
      charts: [this.charts],
      log: [document.createElement("rp-log")],
      topics: [topicTable()],
      models: [modelList()],
      camera: [document.createElement("rp-calibration")],
    };
    for (const name of PANELS) {
      const panel = this.panel(name, content[name]);
      this.panels.set(name, panel);
      this.append(panel);
    }
    drawOn([arrangement], () => this.arrange());
    drawOn([screen], () => this.charts.open(screen.get() === "engineer"));
    whileOpen("engineer", AGAIN_MS, async () => diagnostics.set((await fetchJson("api/diagnostics")) ?? diagnostics.get()));
  }

  /**
   * @param {PanelName} name
   * @param {readonly Node[]} content
   */
  panel(name, content) {
    const title = text(`panel.${name}`);
    /** @param {string} what @param {string} shape @param {() => void} act */
    const tool = (what, shape, act) => {
      const words = text(`panels.${what}`, { panel: title });
      return element("button", { class: "quiet tool", data: { arrange: what }, attributes: { "aria-label": words, title: words }, onclick: act }, icon(shape));
    };
    const own = name === "charts" ? this.charts.tools : [];
    const arranging = element(
      "div",
      { class: "arranging" },
      tool("earlier", "previous", () => this.move(name, -1)),
      tool("later", "next", () => this.move(name, 1)),
      tool("hide", "gone", () => this.hide(name)),
    );
    const head = element("div", { class: "panel-head" }, element("h2", { text: title }), ...own, arranging);
    const panel = element("section", { class: "panel", data: { panel: name }, attributes: { "aria-label": title } }, head, ...content);
    this.takeDrags(name, head, panel);
    return panel;
  }

  /**
   * A panel is dragged by its head, to the place of the one where it is dropped.
   *
   * @param {PanelName} name
   * @param {HTMLElement} head
   * @param {HTMLElement} panel
   */
  takeDrags(name, head, panel) {
    head.draggable = true;
    head.addEventListener("dragstart", (event) => {
      this.dragged = name;
      // Firefox drags nothing without data.
      event.dataTransfer?.setData("text/plain", name);
    });
    head.addEventListener("dragend", () => {
      this.dragged = null;
    });
    const mark = (/** @type {boolean} */ here) => panel.classList.toggle("target", here);
    panel.addEventListener("dragover", (event) => {
      if (this.dragged === null || this.dragged === name) return;
      event.preventDefault();
      mark(true);
    });
    panel.addEventListener("dragleave", () => mark(false));
    panel.addEventListener("drop", (event) => {
      mark(false);
      if (this.dragged === null || this.dragged === name) return;
      event.preventDefault();
      placePanel(this.dragged, name);
      this.arrange();
    });
  }

  /**
   * @param {PanelName} name
   * @param {1|-1} way
   */
  move(name, way) {
    movePanel(name, way);
    this.arrange();
    const panel = this.panels.get(name);
    if (!panel) return;
    // A panel that was moved in the document has lost the focus.
    const [pressed, other] = way > 0 ? ["later", "earlier"] : ["earlier", "later"];
    const next = button(panel, pressed);
    (next.hidden ? button(panel, other) : next).focus();
    panel.scrollIntoView({ block: "nearest" });
  }

  reset() {
    resetPanels();
    this.arrange();
  }

  /** @param {PanelName} name */
  hide(name) {
    showPanel(name, false);
    this.arrange();
    const shower = this.hiddenOnes.querySelector(`[data-show="${name}"]`);
    if (shower instanceof HTMLElement) shower.focus();
  }

  /** @param {PanelName} name */
  show(name) {
    showPanel(name, true);
    this.arrange();
    const panel = this.panels.get(name);
    if (panel) button(panel, "hide").focus();
  }

  arrange() {
    const { order, hidden } = arrangement.get();
    const shown = order.filter((name) => !hidden.includes(name));
    for (const [index, name] of order.entries()) {
      const panel = this.panels.get(name);
      if (!panel) continue;
      panel.hidden = hidden.includes(name);
      // The order of the document is that of the Tab key. Only what is in another place moves.
      if (this.children[index + 1] !== panel) this.children[index]?.after(panel);
      const at = shown.indexOf(name);
      button(panel, "earlier").hidden = at === 0;
      button(panel, "later").hidden = at === shown.length - 1;
    }
    // Those that are as before keep the focus.
    const before = [...this.hiddenOnes.children].map((each) => each.getAttribute("data-show"));
    const missing = order.filter((name) => hidden.includes(name));
    if (missing.join() === before.join()) return;
    const buttons = missing.map((name) => {
      const words = text("panels.show", { panel: text(`panel.${name}`) });
      return element("button", { data: { show: name }, onclick: () => this.show(name) }, icon("add"), words);
    });
    this.hiddenOnes.replaceChildren(...buttons);
  }
}

/**
 * @param {HTMLElement} panel
 * @param {string} what
 */
function button(panel, what) {
  return /** @type {HTMLElement} */ (panel.querySelector(`[data-arrange="${what}"]`));
}

/** The alarms now, each with what to do. */
function alarmList() {
  const list = element("ul", { class: "alarm-rows" });
  const none = element("p", { class: "hint", text: text("alarms.nothing") });
  let drawn = "";
  drawOn([screen, now, pageState, points, link], () => {
    if (screen.get() !== "engineer") return;
    const found = alarms();
    none.hidden = found.length > 0;
    const key = JSON.stringify(found);
    if (key === drawn) return;
    drawn = key;
    list.replaceChildren(
      ...found.map(({ reason: why, steps }) => {
        const [severity, parts] = [severityOf(why), partsOf(why)];
        const act = [parts.act, ...steps.map(reasonText)].filter(Boolean).join("; ");
        return element("li", { data: { severity, code: why.code } }, icon(severity), element("span", {}, element("strong", { text: parts.text }), act ? ` ${act}` : ""));
      }),
    );
  });
  return element("div", { class: "body", attributes: { tabindex: "0" } }, list, none);
}

/** Each process with its version, how long it runs, and the age of its last message. */
function processTable() {
  const body = element("tbody");
  const rows = PROCESSES.map((process) => {
    const shape = element("span", { class: "shape" });
    const cells = ["version", "runs", "age"].map(() => element("td"));
    const row = element("tr", { class: "presence", data: { process, present: "false" } }, element("th", { attributes: { scope: "row" } }, shape, capital(labelOf(process))), ...cells);
    body.append(row);
    return { process, row, shape, cells };
  });
  const versions = element("p", { class: "hint warned", attributes: { role: "status" } });
  drawOn([screen, diagnostics, now, pageState, link], () => {
    if (screen.get() !== "engineer") return;
    const told = diagnostics.get();
    for (const { process, row, shape, cells } of rows) {
      const program = told?.programs.find((each) => each.process === process);
      const age = processAge(process);
      const live = isLive(process);
      // A silent server says nothing about the others.
      const unknown = process === "server" ? isOpening() : !isLive("server");
      row.dataset.present = unknown ? "unknown" : String(live);
      setIcon(shape, unknown ? "UNKNOWN" : live ? "present" : "gone");
      const words = [
        program?.version ?? text("processes.untold"),
        program && told ? spanWords(told.wall_time - program.began_at) : "–",
        age === null ? text("processes.never") : ageWords(age),
      ];
      cells.forEach((cell, index) => setText(cell, words[index] ?? ""));
      setAttribute(/** @type {HTMLElement} */ (cells[1]), "title", program ? dateWords(program.began_at) : "");
    }
    const different = new Set((told?.programs ?? []).map((each) => each.version)).size > 1;
    setText(versions, different ? text("processes.versions_differ") : "");
  });
  const head = ["process", "version", "runs", "age"].map((each) => element("th", { text: text(`processes.${each}`), attributes: { scope: "col" } }));
  return element("div", { class: "body", attributes: { tabindex: "0" } }, element("table", {}, element("thead", {}, element("tr", {}, ...head)), body), versions);
}

/** Every topic of the wire with its rate and age, as the server receives it. */
function topicTable() {
  const body = element("tbody");
  /** @type {Map<string, { row: HTMLElement, cells: HTMLElement[] }>} */
  const rows = new Map();
  const none = element("p", { class: "hint", text: text("topics.none") });
  drawOn([diagnostics], () => {
    const told = diagnostics.get();
    none.hidden = told !== null;
    for (const topic of told?.topics ?? []) {
      const known = rows.get(topic.name) ?? newRow(topic);
      if (!rows.has(topic.name)) {
        rows.set(topic.name, known);
        body.append(known.row);
      }
      const words = [hertz(topic.rate_hz), nominal(topic), topic.age_s === null ? "–" : ageWords(topic.age_s), String(topic.count), String(topic.rejected)];
      if (!topic.received) words.fill("–").splice(0, 2, text("topics.elsewhere"), nominal(topic));
      known.cells.forEach((cell, index) => setText(cell, words[index] ?? ""));
      known.row.dataset.late = String(isLate(topic));
      known.row.dataset.received = String(topic.received);
    }
  });
  const head = ["topic", "sender", "rate", "nominal", "age", "count", "rejected"].map((each) =>
    element("th", { text: text(`topics.${each}`), attributes: { scope: "col", title: text(`topics.${each}.hint`) } }),
  );
  return element("div", { class: "body", attributes: { tabindex: "0" } }, element("table", {}, element("thead", {}, element("tr", {}, ...head)), body), none);
}

/** @param {TopicTraffic} topic */
function newRow({ name, sender }) {
  const from = sender === "any" ? text("process.all") : labelOf(sender);
  const cells = ["rate", "nominal", "age", "count", "rejected"].map((each) => element("td", { class: "number", data: { name: text(`topics.${each}`) } }));
  const sent = element("td", { text: from, data: { name: text("topics.sender") } });
  const row = element("tr", { data: { topic: name } }, element("th", { text: name, attributes: { scope: "row", translate: "no" } }), sent, ...cells);
  return { row, cells };
}

/** @param {number|null} rate */
function hertz(rate) {
  return rate === null ? "–" : text("topics.hertz", { rate: significant(rate, rate >= 100 ? 3 : 2) });
}

/** @param {TopicTraffic} topic */
function nominal({ nominal_hz }) {
  return nominal_hz === 0 ? text("topics.on_event") : text("topics.hertz", { rate: nominal_hz });
}

/** @param {TopicTraffic} topic Messages on event alone are never late. */
function isLate({ nominal_hz, age_s }) {
  return nominal_hz > 0 && age_s !== null && age_s > Math.max(LATE_S, LATE_PERIODS / nominal_hz);
}

/** What decides, and the hashes of what was decided on. */
function modelList() {
  const list = element("dl", { class: "models" });
  const title = element("summary");
  const body = element("tbody");
  const head = ["point", "revision", "state", "digest"].map((each) => element("th", { text: text(`models.${each}`), attributes: { scope: "col" } }));
  const digests = element("details", {}, title, element("table", {}, element("thead", {}, element("tr", {}, ...head)), body));
  let [drawn, drawnPoints] = ["", ""];
  drawOn([screen, pageState, points, preview], () => {
    if (screen.get() !== "engineer") return;
    const [state, page] = [pageState.get(), points.get()];
    const pairs = /** @type {const} */ ([
      ["network", page && labelOf(page.segmenter)],
      ["method", state?.controller?.method],
      ["robot", state?.bridge?.kind && text(`models.robot.${state.bridge.kind}`)],
      ["plan", page?.plan?.plan_hash],
      ["preview", preview.get()?.preview_hash],
    ]);
    const key = JSON.stringify(pairs);
    if (key !== drawn) {
      drawn = key;
      const rows = pairs.map(([name, value]) => element("div", { data: { model: name } }, element("dt", { text: text(`models.${name}`) }), element("dd", { text: value || "–" })));
      list.replaceChildren(...rows);
    }
    const rows = page?.points ?? [];
    setText(title, counted("models.points", rows.length));
    const words = rows.map(({ point, entry }) => [point.point_id, String(point.revision), labelOf(entry.state), point.digest || entry.digest || "–"]);
    const pointsKey = JSON.stringify(words);
    if (pointsKey === drawnPoints) return;
    drawnPoints = pointsKey;
    body.replaceChildren(...words.map((cells) => element("tr", {}, ...cells.map((cell) => element("td", { text: cell })))));
  });
  return element("div", { class: "body", attributes: { tabindex: "0" } }, list, digests);
}
customElements.define("rp-engineer", RpEngineer);
