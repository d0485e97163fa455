// The robots of this server and their states. Each robot has its own page, loaded completely, so that no press can
// reach the wrong robot. The history of the charts is stored in the tab for the way back.

import { hold } from "../js/control/teleoperation.js";
import { fetchJson } from "../js/link/api.js";
import { showToast } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { text } from "../js/state/texts.js";
import { element, setText } from "../js/views/dom.js";
import { SPAN_MS, history } from "../js/views/history.js";
import { setIcon } from "../js/views/icons.js";

const KEY = `history.${location.pathname}`;

/**
 * Times of the samples (ms since 1970) and a row of values for each name; null is unknown.
 *
 * @typedef {{ at: number[], rows: (number|null)[][] }} StoredHistory
 */

function persistHistory() {
  restoreHistory();
  window.addEventListener("pagehide", () => sessionStorage.setItem(KEY, JSON.stringify(snapshot())));
}

/** @returns {StoredHistory} */
function snapshot() {
  const rows = history.names.map((name) => history.of(name));
  const short = (/** @type {number} */ value) => (Number.isNaN(value) ? null : Number(value.toPrecision(5)));
  return {
    at: (rows[0] ?? []).map((sample) => Math.round(sample.at + performance.timeOrigin)),
    rows: rows.map((samples) => samples.map((sample) => short(sample.value))),
  };
}

function restoreHistory() {
  const text = sessionStorage.getItem(KEY);
  if (text === null) return;
  /** @type {StoredHistory} */
  const { at, rows } = JSON.parse(text);
  // Another version of this page may have stored other readings.
  if (rows.length !== history.names.length) return;
  const since = history.copy();
  history.count = 0;
  at.forEach((wall, index) => {
    const sampled = wall - performance.timeOrigin;
    if (performance.now() - sampled < SPAN_MS)
      history.add(
        sampled,
        rows.map((row) => row[index] ?? null),
      );
  });
  const fresh = since.names.map((name) => since.of(name));
  fresh[0]?.forEach((sample, index) =>
    history.add(
      sample.at,
      fresh.map((samples) => samples[index]?.value ?? null),
    ),
  );
}

/**
 * A robot in the answer of `GET /api/robots`.
 *
 * @typedef {object} Glance
 * @property {string} name
 * @property {string} path
 * @property {import("../js/link/messages.js").Mode|null} mode
 * @property {""|"warning"|"error"} severity
 * @property {import("../js/state/reasons.js").Reason|null} alarm
 * @property {string} holder
 * @property {boolean} yours
 * @property {number} pages
 */

const PERIOD_MS = 1000;
/** Alarms that name the mode. */
const MODE_ALARMS = new Set(["robot_stopped", "robot_protective_stop", "robot_fault"]);

class RpRobots extends HTMLElement {
  list = element("ul");
  /** @type {Map<string, (robot: Glance) => void>} */
  rows = new Map();
  /** Alarms of other robots that were shown. @type {Map<string, string>} */
  told = new Map();

  connectedCallback() {
    this.setAttribute("role", "navigation");
    this.setAttribute("aria-label", text("robots.label"));
    this.append(this.list);
    persistHistory();
    void this.ask();
  }

  async ask() {
    /** @type {Glance[]|null} */
    const robots = await fetchJson("/api/robots");
    this.classList.toggle("stale", robots === null);
    for (const robot of robots ?? []) {
      const draw = this.rows.get(robot.name) ?? this.newRow(robot);
      draw(robot);
      this.tell(robot);
    }
    window.setTimeout(() => void this.ask(), PERIOD_MS);
  }

  /** @param {Glance} robot */
  newRow({ name, path }) {
    const shape = element("span", { class: "shape" });
    const mode = element("span", { class: "robot-mode" });
    const alarm = element("span", { class: "robot-alarm" });
    const holder = element("span", { class: "robot-holder" });
    const link = element(
      "a",
      { attributes: { href: path }, data: { robot: name } },
      shape,
      element("strong", { text: name }),
      mode,
      alarm,
      holder,
    );
    const here = path === location.pathname;
    if (here) {
      link.setAttribute("aria-current", "page");
      document.title = `${name} · Rolling Panda`;
    }
    // End a hold before the page is left.
    link.addEventListener("click", () => hold.releaseAll());
    this.list.append(element("li", {}, link));
    const draw = (/** @type {Glance} */ robot) => {
      link.dataset.severity = robot.severity;
      setIcon(shape, robot.severity || robot.mode || "UNKNOWN");
      const word = text(`mode.${robot.mode ?? "none"}`);
      // No mode where the alarm names it.
      setText(mode, MODE_ALARMS.has(robot.alarm?.code ?? "") ? "" : word);
      setText(alarm, reasonText(robot.alarm));
      setText(holder, robot.yours ? text("control.yours") : robot.holder ? text("control.theirs", { user: robot.holder }) : "");
      const working = robot.mode === "AUTO" || robot.mode === "TELEOP";
      const told = [here ? text("robots.here") : text("robots.show", { name }), alarm.textContent ?? ""];
      if (here && working) told.push(text("robots.leaving"));
      link.title = told.filter(Boolean).join(". ");
    };
    this.rows.set(name, draw);
    return draw;
  }

  /**
   * Notify once of an alarm of another robot.
   *
   * @param {Glance} robot
   */
  tell({ name, path, severity, alarm }) {
    const words = reasonText(alarm);
    if (path === location.pathname || this.told.get(name) === words) return;
    this.told.set(name, words);
    if (severity) showToast(severity, text("advice", { text: name, act: words }));
  }
}
customElements.define("rp-robots", RpRobots);
