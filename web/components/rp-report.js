// The session report: cuts by outcome and vine, durations, refusals, and who held control.

import { whyNot } from "../js/control/allowed.js";
import { judge } from "../js/control/decisions.js";
import { reasonIn } from "../js/link/api.js";
import { clockWords } from "../js/state/format.js";
import { reasonText } from "../js/state/reasons.js";
import { screen } from "../js/state/screens.js";
import { drawOn } from "../js/state/signals.js";
import { counted, labelOf, text } from "../js/state/texts.js";
import { element, setEnabled, setText } from "../js/views/dom.js";

/** @typedef {import("../js/link/messages.js").CutReport} CutReport */
/** @typedef {import("../js/link/messages.js").SessionReport} SessionReport */

/** Refresh period while open (ms); the controller publishes it every 5 s. */
const AGAIN_MS = 5000;

class RpReport extends HTMLElement {
  constructor() {
    super();
    this.timer = 0;
    this.words = element("p", { class: "hint", attributes: { role: "status" } });
    this.sums = element("dl", { class: "sums number" });
    this.vines = table("vines", ["vine", "done", "not_cut", "unknown", "unreachable", "minutes"]);
    this.cuts = table("cuts", ["ended", "point", "vine", "outcome", "seconds", "user", "judgement"]);
    this.refusals = table("refusals", ["when", "who", "asked", "why"]);
    this.control = table("control", ["when", "who", "what"]);
  }

  connectedCallback() {
    this.tabIndex = 0;
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("report.title"));
    const tables = [this.vines, this.cuts, this.refusals, this.control];
    const tools = [download("api/report", "report.json", "JSON"), download("api/report.csv", "cuts.csv", "CSV")];
    const head = element("div", { class: "report-head" }, element("h2", { text: text("report.title") }), ...tools);
    this.replaceChildren(head, this.words, this.sums, ...tables.map((each) => each.box));
    drawOn([screen], () => this.follow());
  }

  /** Fetch while the screen is open. */
  follow() {
    window.clearInterval(this.timer);
    if (screen.get() !== "report") return;
    void this.fetch();
    this.timer = window.setInterval(() => void this.fetch(), AGAIN_MS);
  }

  async fetch() {
    try {
      const response = await fetch("api/report", { credentials: "same-origin", signal: AbortSignal.timeout(4000) });
      const body = await response.json();
      if (response.ok) this.show(body);
      else setText(this.words, text("report.old", { why: reasonText(reasonIn(body)) }));
    } catch {
      setText(this.words, text("report.unreachable"));
    }
  }

  /**
   * Button that calls a cut wrong, and right again.
   *
   * @param {CutReport} cut
   */
  judgement(cut) {
    const wrong = cut.wrong_by !== "";
    const press = async () => {
      if (await judge(cut.point_id, !wrong)) await this.fetch();
    };
    const button = element("button", {
      class: "quiet judgement",
      text: text("report.wrong"),
      attributes: { "aria-pressed": String(wrong), "aria-label": text("report.wrong_cut", { point: cut.point_id }) },
      onclick: () => void press(),
    });
    setEnabled(button, whyNot("JudgeCut"), wrong ? text("report.wrong_by", { user: cut.wrong_by }) : text("report.wrong_hint"));
    return button;
  }

  /** @param {SessionReport} report */
  show(report) {
    const ended = report.cuts.filter((cut) => cut.ended_at > 0);
    const seconds = ended.reduce((sum, cut) => sum + cut.seconds, 0);
    const since =
      report.began_at > 0 ? text("report.since", { time: clockWords(report.began_at) }) : text("report.nothing");
    const left = report.cut_count - report.cuts.length;
    const older = left > 0 ? [counted("report.older", left)] : [];
    setText(this.words, [since, ...older].join(" "));
    const count = (/** @type {"done"|"not_cut"|"unknown"|"unreachable"} */ name) =>
      report.vines.reduce((sum, vine) => sum + vine[name], 0);
    sums(this.sums, [
      ["done", count("done")],
      ["not_cut", count("not_cut")],
      ["unknown", count("unknown")],
      ["unreachable", count("unreachable")],
      ["mean", ended.length > 0 ? (seconds / ended.length).toFixed(1) : "–"],
      ["vine_count", report.vines.length],
      ["refused", report.refusal_count],
    ]);
    this.vines.show(
      report.vines.map((vine) => [
        vine.vine,
        vine.done,
        vine.not_cut,
        vine.unknown,
        vine.unreachable,
        (vine.seconds / 60).toFixed(1),
      ]),
    );
    this.cuts.show(
      [...report.cuts]
        .reverse()
        .map((cut) => [
          cut.ended_at > 0 ? clockWords(cut.ended_at) : text("report.now"),
          cut.point_id,
          cut.vine,
          [labelOf(cut.outcome || "CUTTING"), reasonText(cut.reason)].filter(Boolean).join(": "),
          cut.ended_at > 0 ? cut.seconds.toFixed(1) : "–",
          cut.user,
          cut.outcome === "DONE" ? this.judgement(cut) : "",
        ]),
    );
    this.refusals.show(
      [...report.refusals].reverse().map((each) => [clockWords(each.at), each.user, labelOf(each.asked), reasonText(each.reason)]),
    );
    this.control.show(
      [...report.control].reverse().map((each) => [clockWords(each.at), each.user, text(`report.${each.asked}`)]),
    );
  }
}

/**
 * @param {string} name Of its title, `report.table.NAME`.
 * @param {readonly string[]} columns Of their heads, `report.column.COLUMN`.
 */
function table(name, columns) {
  const body = element("tbody");
  const head = element("tr", {}, ...columns.map((each) => element("th", { text: text(`report.column.${each}`), attributes: { scope: "col" } })));
  const empty = element("p", { class: "hint" });
  const grid = element("table", {}, element("thead", {}, head), body);
  let shown = "";
  const box = element("section", {}, element("h3", { text: text(`report.table.${name}`) }), grid, empty);
  return {
    box,
    /** @param {readonly (readonly (string|number|Element)[])[]} rows */
    show(rows) {
      grid.hidden = rows.length === 0;
      setText(empty, rows.length === 0 ? text(`report.none.${name}`) : "");
      // Rows that are as before stay, and with them the focus.
      const key = JSON.stringify(rows.map((row) => row.map((cell) => (cell instanceof Element ? cell.outerHTML : cell))));
      if (key === shown) return;
      shown = key;
      body.replaceChildren(
        ...rows.map((row) => element("tr", {}, ...row.map((cell) => cell instanceof Element ? element("td", {}, cell) : element("td", { text: String(cell) })))),
      );
    },
  };
}

/**
 * @param {HTMLElement} list
 * @param {readonly (readonly [string, string|number])[]} pairs
 */
function sums(list, pairs) {
  list.replaceChildren(
    ...pairs.map(([name, value]) =>
      element("div", {}, element("dt", { text: text(`report.column.${name}`) }), element("dd", { text: String(value) })),
    ),
  );
}

/**
 * @param {string} path
 * @param {string} name
 * @param {string} words
 */
function download(path, name, words) {
  return element("a", {
    class: "button",
    text: words,
    attributes: { href: path, download: name, title: text("report.save", { name }) },
  });
}
customElements.define("rp-report", RpReport);
