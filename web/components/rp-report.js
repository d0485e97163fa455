// The session's report: every cut with its pictures, sums, the timeline, refusals, what is left for a person and what a person
// left as it is. It prints.

import { whyNot } from "../js/control/allowed.js";
import { judge } from "../js/control/decisions.js";
import { items } from "../js/control/review.js";
import { reasonIn } from "../js/link/api.js";
import { clockWords, dateWords, decimal, spanWords } from "../js/state/format.js";
import { points } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { screen, whileOpen } from "../js/state/screens.js";
import { drawOn } from "../js/state/signals.js";
import { sessionEnd } from "../js/state/timeline.js";
import { counted, joined, labelOf, text } from "../js/state/texts.js";
import { dropDown, element, setEnabled, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";
import { RpTimeline } from "./rp-timeline.js";

/** @typedef {import("../js/link/messages.js").CutReport} CutReport */
/** @typedef {import("../js/link/messages.js").SessionReport} SessionReport */
/** @typedef {"before"|"after"} Moment */

/** Refresh period while open (ms); the controller publishes it every 5 s. */
const AGAIN_MS = 5000;
/** Printing waits so long for pictures (ms). */
const PICTURES_MS = 15_000;
/** Outcomes to filter by; a cut that was called wrong is one too. */
const OUTCOMES = Object.freeze(["DONE", "FAILED_NOT_CUT", "UNKNOWN", "wrong"]);

class RpReport extends HTMLElement {
  words = element("p", { class: "hint", attributes: { role: "status" } });
  facts = element("dl", { class: "session" });
  sums = element("dl", { class: "sums number" });
  timeline = new RpTimeline();
  vine = dropDown({ id: "report-vine", attributes: { "aria-label": text("report.filter.vine") } }, [["", text("report.every_vine")]]);
  outcome = dropDown({ id: "report-outcome", attributes: { "aria-label": text("report.filter.outcome") } }, [
    ["", text("report.every_outcome")],
    ...OUTCOMES.map((each) => /** @type {const} */ ([each, each === "wrong" ? text("report.called_wrong") : labelOf(each)])),
  ]);
  found = element("p", { class: "hint", attributes: { role: "status" } });
  cuts = element("ol", { class: "cut-cards" });
  left = element("ul", { class: "left-over" });
  kept = element("ul", { class: "left-as-it-is" });
  keptSection = section("kept", this.kept);
  vines = table("vines", ["vine", "done", "not_cut", "unknown", "unreachable", "minutes"]);
  refusals = table("refusals", ["when", "who", "asked", "why"]);
  control = table("control", ["when", "who", "what"]);
  /** The card of each cut, with what it was made of. @type {Map<string, { card: HTMLElement, cut: CutReport, made: string }>} */
  cards = new Map();

  connectedCallback() {
    this.tabIndex = 0;
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("report.title"));
    const tools = [
      element("button", { id: "print", onclick: () => void this.print() }, text("report.print")),
      download("api/report.csv", "cuts.csv", "CSV"),
      download("api/report", "report.json", "JSON"),
    ];
    const head = element("div", { class: "report-head" }, element("h2", { text: text("report.title") }), ...tools);
    const filters = element("div", { class: "filters", attributes: { role: "group", "aria-label": text("report.filter.label") } }, this.vine, this.outcome);
    this.replaceChildren(
      head,
      this.words,
      this.facts,
      this.sums,
      section("timeline", this.timeline),
      section("cuts", filters, this.found, this.cuts),
      section("left", this.left),
      this.keptSection,
      this.vines.box,
      this.refusals.box,
      this.control.box,
    );
    for (const filter of [this.vine, this.outcome]) filter.addEventListener("change", () => this.filter());
    drawOn([screen], () => this.timeline.open(screen.get() === "report"));
    whileOpen("report", AGAIN_MS, () => this.fetch());
    drawOn([points], () => {
      this.drawLeft();
      this.drawKept();
    });
  }

  async fetch() {
    try {
      const response = await fetch("api/report", { credentials: "same-origin", signal: AbortSignal.timeout(4000) });
      const body = await response.json();
      if (response.ok) this.show(body, sessionEnd(response, body.written_at));
      else setText(this.words, text("report.old", { why: reasonText(reasonIn(body)) }));
    } catch {
      setText(this.words, text("report.unreachable"));
    }
  }

  /** Print with all pictures, or with those that have come in time. */
  async print() {
    const pictures = [...this.querySelectorAll("img")];
    for (const each of pictures) each.loading = "eager";
    const loaded = Promise.all(pictures.map((each) => each.decode().catch(() => {})));
    await Promise.race([loaded, new Promise((done) => setTimeout(done, PICTURES_MS))]);
    window.print();
  }

  /**
   * @param {SessionReport} report
   * @param {number} until End of the session, or now (s since 1970).
   */
  show(report, until) {
    const older = report.cut_count - report.cuts.length;
    const since = report.began_at > 0 ? text("report.since", { time: clockWords(report.began_at) }) : text("report.nothing");
    setText(this.words, [since, ...(older > 0 ? [counted("report.older", older)] : [])].join(" "));
    this.showSums(report, until);
    this.showCuts(report.cuts);
    this.vines.show(
      report.vines.map((vine) => [
        vine.vine,
        vine.done,
        vine.not_cut,
        vine.unknown,
        vine.unreachable,
        decimal(vine.seconds / 60, 1),
      ]),
    );
    this.refusals.show(
      [...report.refusals].reverse().map((each) => [clockWords(each.at), each.user, labelOf(each.asked), reasonText(each.reason)]),
    );
    this.control.show([...report.control].reverse().map((each) => [clockWords(each.at), each.user, text(`report.${each.asked}`)]));
  }

  /**
   * @param {SessionReport} report
   * @param {number} until
   */
  showSums({ began_at, cuts, vines, refusal_count }, until) {
    const accepted = [...new Set(cuts.map((cut) => cut.user).filter(Boolean))].sort();
    const ended = cuts.filter((cut) => cut.ended_at > 0).length;
    const seconds = cuts.reduce((sum, cut) => sum + cut.seconds, 0);
    const atWork = vines.reduce((sum, vine) => sum + vine.seconds, 0);
    const worked = vines.reduce((sum, vine) => sum + shareDone(vine), 0);
    const count = (/** @type {"done"|"not_cut"|"unknown"|"unreachable"} */ name) => vines.reduce((sum, vine) => sum + vine[name], 0);
    list(this.facts, [
      ["date", began_at > 0 ? dateWords(began_at) : "–"],
      ["duration", began_at > 0 ? spanWords(until - began_at) : "–"],
      ["at_work", spanWords(atWork)],
      ["user", accepted.join(", ") || "–"],
    ]);
    list(this.sums, [
      ["done", count("done")],
      ["not_cut", count("not_cut")],
      ["unknown", count("unknown")],
      ["unreachable", count("unreachable")],
      ["called_wrong", cuts.filter((cut) => cut.wrong_by !== "").length],
      ["mean", ended > 0 ? decimal(seconds / ended, 1) : "–"],
      ["vines_an_hour", atWork > 0 ? decimal(worked / (atWork / 3600), 1) : "–"],
      ["refused", refusal_count],
    ]);
  }

  /** @param {readonly CutReport[]} cuts Oldest first. */
  showCuts(cuts) {
    const known = new Set(cuts.map(keyOf));
    for (const [key, { card }] of this.cards) {
      if (known.has(key)) continue;
      card.remove();
      this.cards.delete(key);
    }
    const why = whyNot("JudgeCut");
    for (const cut of cuts) {
      const [key, made] = [keyOf(cut), JSON.stringify(cut)];
      const before = this.cards.get(key);
      if (before?.made !== made) {
        const focused = before?.card.querySelector(".judgement") === document.activeElement;
        const card = this.card(cut);
        if (before) before.card.replaceWith(card);
        else this.cuts.prepend(card);
        this.cards.set(key, { card, cut, made });
        if (focused) card.querySelector("button")?.focus();
      }
      const button = /** @type {HTMLButtonElement|null|undefined} */ (this.cards.get(key)?.card.querySelector(".judgement"));
      if (button) setEnabled(button, why, cut.wrong_by ? text("report.wrong_by", { user: cut.wrong_by }) : text("report.wrong_hint"));
    }
    const vines = [...new Set(cuts.map((cut) => cut.vine))].sort((a, b) => a - b);
    const options = /** @type {[string, string][]} */ ([["", text("report.every_vine")], ...vines.map((each) => [String(each), text("report.vine", { vine: each })])]);
    if (this.vine.options.length !== options.length) {
      const chosen = this.vine.value;
      this.vine.replaceChildren(...options.map(([value, words]) => element("option", { text: words, attributes: { value } })));
      this.vine.value = vines.includes(Number(chosen)) ? chosen : "";
    }
    this.filter();
  }

  filter() {
    const [vine, outcome] = [this.vine.value, this.outcome.value];
    let shown = 0;
    for (const { card, cut } of this.cards.values()) {
      const fits = (vine === "" || cut.vine === Number(vine)) && (outcome === "" || (outcome === "wrong" ? cut.wrong_by !== "" : cut.outcome === outcome));
      card.hidden = !fits;
      shown += Number(fits);
    }
    const all = this.cards.size;
    // On paper it says nothing.
    this.found.classList.toggle("found-all", shown === all && all > 0);
    const some = counted("report.found", all, { shown });
    setText(this.found, all === 0 ? text("report.none.cuts") : shown === 0 ? text("report.none_like_that") : some);
  }

  /** @param {CutReport} cut */
  card(cut) {
    const { cut_id, point_id: point, vine, spur } = cut;
    const place = text("report.place", { vine, spur });
    const outcome = cut.outcome || "CUTTING";
    const chip = element("span", { class: "chip", data: { outcome } }, icon(outcome), labelOf(outcome));
    const ended = cut.ended_at > 0;
    const facts = [
      ended ? text("report.took", { time: clockWords(cut.ended_at), seconds: decimal(cut.seconds, 1) }) : text("report.now"),
      ...(cut.user ? [text("report.accepted_by", { user: cut.user })] : []),
      ...(cut.wrong_by ? [text("report.called_wrong_by", { user: cut.wrong_by })] : []),
    ];
    const pictures = /** @type {Moment[]} */ (["before", "after"]).map((moment) => picture(cut, moment, place));
    const card = element(
      "li",
      { class: "cut-card", data: { point, ...(cut.wrong_by ? { wrong: "" } : {}) } },
      element("div", { class: "card-head" }, element("h4", { text: place }), chip, ...(cut.outcome === "DONE" ? [this.judgement(cut, place)] : [])),
      element("div", { class: "pictures" }, ...pictures),
      element("p", { class: "why-so", text: reasonText(cut.reason) }),
      element("p", { class: "hint number", text: facts.join(" · "), attributes: { title: [point, cut_id].filter(Boolean).join(" · ") } }),
    );
    return card;
  }

  /**
   * Button that calls a cut wrong, and right again.
   *
   * @param {CutReport} cut
   * @param {string} place
   */
  judgement(cut, place) {
    const wrong = cut.wrong_by !== "";
    let asked = false;
    const press = async () => {
      // A second press would take back what the report does not show yet.
      if (asked) return;
      asked = true;
      button.setAttribute("aria-pressed", String(!wrong));
      if (await judge(cut.point_id, !wrong)) await this.fetch();
      else button.setAttribute("aria-pressed", String(wrong));
      asked = false;
    };
    const button = element("button", {
      class: "judgement",
      text: text("report.wrong"),
      attributes: { "aria-pressed": String(wrong), "aria-label": text("report.wrong_cut", { place }) },
      onclick: () => void press(),
    });
    return button;
  }

  /** What is left to do: canes that hang, cuts with an unknown outcome, points out of reach or without a decision, places. */
  drawLeft() {
    const page = points.get();
    const hanging = (page?.points ?? [])
      .filter(({ entry }) => entry.reason?.code === "cut_and_hangs")
      .map(({ point }) => line("DONE", point.vine, point.spur, null));
    const rows = (page?.points ?? [])
      .filter(({ entry }) => entry.state === "UNKNOWN" || entry.state === "UNREACHABLE" || entry.state === "PROPOSED")
      .map(({ point, entry }) => line(entry.state, point.vine, point.spur, entry.state === "PROPOSED" ? null : entry.reason));
    const sites = (page?.undecided_sites ?? [])
      .filter((site) => site.needs !== "nothing")
      // What has no vine is of the whole picture.
      .map((site) => (site.vine === 0 ? reasonText(site.reason) : line("undecided", site.vine, site.spur, site.reason)));
    const lines = [...hanging, ...rows, ...sites];
    fill(this.left, lines.length > 0 ? lines : [text("report.none.left")]);
  }

  /** What a person has decided to leave: of a place it is not known who. */
  drawKept() {
    const left = items().filter(({ status }) => status === "left");
    this.keptSection.hidden = left.length === 0;
    fill(
      this.kept,
      left.map(({ vine, spur, row, sites }) => {
        const why = row ? [row.entry.user, reasonText(row.entry.reason)] : sites.map((site) => reasonText(site.reason));
        return [text("report.place", { vine, spur }), ...why.filter(Boolean)].join(" – ");
      }),
    );
  }
}

/**
 * @param {HTMLElement} box
 * @param {readonly string[]} lines
 */
function fill(box, lines) {
  if (lines.map(joined).join("\n") === [...box.children].map((item) => item.textContent).join("\n")) return;
  box.replaceChildren(...lines.map((each) => element("li", { text: each })));
}

/**
 * @param {string} state
 * @param {number} vine
 * @param {number} spur
 * @param {import("../js/state/reasons.js").Reason|null|undefined} why
 */
function line(state, vine, spur, why) {
  const what = text(`report.left.${state}`);
  return [text("advice", { text: text("report.place", { vine, spur }), act: what }), ...(why ? [reasonText(why)] : [])].join(" – ");
}

/**
 * Part of a vine's cuts that is done with: what waits there is not.
 *
 * @param {import("../js/link/messages.js").VineReport} vine
 */
function shareDone({ vine, done, not_cut, unknown }) {
  const ended = done + not_cut + unknown;
  const waiting = (points.get()?.points ?? []).filter(
    ({ point, entry }) => point.vine === vine && (entry.state === "ACCEPTED" || entry.state === "PROPOSED"),
  ).length;
  return ended / Math.max(ended + waiting, 1);
}

/** A point that was given up before the order to cut has no cut id. @param {CutReport} cut */
function keyOf({ cut_id, point_id, ended_at }) {
  return cut_id || `${point_id} ${ended_at}`;
}

/**
 * The picture of a cut before or after it, or the words that there is none.
 *
 * @param {CutReport} cut
 * @param {Moment} moment
 * @param {string} place
 */
function picture({ cut_id, outcome }, moment, place) {
  const name = text(`report.${moment}`);
  const missing = (/** @type {string} */ words) => element("span", { class: "no-picture", text: words });
  const box = element("figure", { class: "shot" }, element("figcaption", { text: name }));
  if (!cut_id) box.prepend(missing(text("report.no_cut")));
  else if (!outcome && moment === "after") box.prepend(missing(text("report.not_yet")));
  else {
    const path = `api/cuts/${encodeURIComponent(cut_id)}/${moment}.jpg`;
    const image = element("img", { attributes: { src: path, alt: text("report.picture", { place, moment: name }), loading: "lazy" } });
    // What is marked is the middle of the picture.
    const mark = element("span", { class: "cut-mark", attributes: { "aria-hidden": "true" } });
    image.addEventListener("error", () => {
      mark.remove();
      image.replaceWith(missing(text("report.no_picture")));
    });
    box.prepend(image, mark);
  }
  return box;
}

/**
 * @param {string} name Of its title, `report.table.NAME`.
 * @param {...Node} content
 */
function section(name, ...content) {
  return element("section", { data: { section: name } }, element("h3", { text: text(`report.table.${name}`) }), ...content);
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
  return {
    box: section(name, grid, empty),
    /** @param {readonly (readonly (string|number)[])[]} rows */
    show(rows) {
      grid.hidden = rows.length === 0;
      setText(empty, rows.length === 0 ? text(`report.none.${name}`) : "");
      const key = JSON.stringify(rows);
      if (key === shown) return;
      shown = key;
      body.replaceChildren(...rows.map((row) => element("tr", {}, ...row.map((cell) => element("td", { text: String(cell) })))));
    },
  };
}

/**
 * @param {HTMLElement} list
 * @param {readonly (readonly [string, string|number])[]} pairs
 */
function list(list, pairs) {
  const rows = pairs.map(([name, value]) =>
    element("div", { data: { sum: name } }, element("dt", { text: text(`report.column.${name}`) }), element("dd", { text: String(value) })),
  );
  list.replaceChildren(...rows);
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
