// Banner with the alarms: the worst one with what to do and the button that does it; the others behind a press.

import { COMMANDS, take, whyNotStep } from "../js/control/commands.js";
import { clockWords } from "../js/state/format.js";
import { link, now, pageState, points, preview } from "../js/state/page-state.js";
import { partsOf, reasonText, sentence, severityOf } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { counted, text } from "../js/state/texts.js";
import { alarms } from "../js/views/alarms.js";
import { element, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";

/** @typedef {import("../js/control/commands.js").Step} Step */

/** A cleared alarm stays for this time (ms), so that it can be read and the list does not flicker. */
const LINGER_MS = 2000;
/** What a step of the advice asks to press. @type {Readonly<Record<string, Step>>} */
const PRESSES = Object.freeze({
  acknowledge_resume: "Acknowledge",
  acknowledge_arm: "Acknowledge",
  press_resume: "Resume",
  resume_work: "continue",
  resume_survey: "continue",
  resume_home: "Resume",
  press_start: "Start",
  press_survey: "Survey",
  press_home: "Home",
  arm_and_home: "Arm",
  accept_start: "review",
  preview_start: "preview",
  approve_start: "preview",
  press_use_calibration: "calibration",
});

/** These have banners of their own. */
const ELSEWHERE = new Set(["mode_stopped", "no_link"]);

/** Warnings that the work waits for, or should wait for. */
const HALTS = new Set(["mode_paused", "work_waits", "camera_looks_left", "camera_looks_right", "camera_looks_up", "camera_looks_down"]);

/** As long as the program runs: what has happened since comes first. */
const STANDING = new Set(["wire_plain"]);

class RpAlarms extends HTMLElement {
  /** @type {Map<string, ReturnType<typeof newRow>>} */
  rows = new Map();
  list = element("ul", { class: "alarm-list", attributes: { "aria-label": text("alarms.title"), tabindex: "0" } });

  connectedCallback() {
    this.id = "alarms";
    const more = element("button", { id: "more-alarms", class: "quiet", attributes: { "aria-expanded": "false" } });
    const live = element("div", { class: "live", attributes: { role: "log", "aria-live": "assertive" } }, this.list);
    this.append(live, more);
    more.addEventListener("click", () => {
      more.setAttribute("aria-expanded", String(more.getAttribute("aria-expanded") !== "true"));
      this.draw(more);
    });
    drawOn([now, pageState, points, preview, link], () => this.draw(more));
  }

  /** @param {HTMLElement} more */
  draw(more) {
    const found = alarms().filter(({ reason }) => !ELSEWHERE.has(reason.code));
    const at = performance.now();
    for (const { reason, steps } of found) {
      const row = this.rows.get(reason.code) ?? newRow(reason);
      this.rows.set(reason.code, row);
      row.show(reason, steps, at);
    }
    for (const [code, { row, seen }] of this.rows) {
      // Its advice is hidden.
      row.classList.toggle("gone", seen() < at);
      if (at - seen() < LINGER_MS) continue;
      row.remove();
      this.rows.delete(code);
    }
    const sorted = [...this.rows.values()].sort((a, b) => rank(a.row) - rank(b.row));
    sorted.forEach(({ row }, at) => {
      if (this.list.children[at] !== row) this.list.insertBefore(row, this.list.children[at] ?? null);
    });
    const first = sorted[0]?.row;
    this.hidden = !first;
    this.dataset.worst = first?.dataset.severity ?? "";
    // Other warnings take no room from the view.
    const quiet = sorted.every(({ row }) => row.dataset.severity !== "error" && !HALTS.has(row.dataset.code ?? ""));
    const open = more.getAttribute("aria-expanded") === "true";
    this.classList.toggle("quiet", quiet && !open);
    for (const { row } of sorted) row.hidden = !open && (quiet || row !== first);
    more.hidden = sorted.length < 2 && !quiet;
    const words = quiet ? counted("alarms.warnings", sorted.length) : counted("alarms.more", sorted.length - 1);
    setText(more, open ? text("alarms.fewer") : words);
  }
}

/** @param {HTMLElement} row */
function rank(row) {
  const code = row.dataset.code ?? "";
  if (STANDING.has(code)) return 2;
  return row.dataset.severity === "error" ? 0 : HALTS.has(code) ? 1 : 3;
}

/** @param {import("../js/state/reasons.js").Reason} reason */
function newRow(reason) {
  const severity = severityOf(reason);
  const words = element("strong");
  const act = element("span", { class: "act" });
  const since = element("time", { text: clockWords(Date.now() / 1000), attributes: { title: text("alarms.since") } });
  const press = element("button", { class: "alarm-press", onclick: () => void (step && take(step)) });
  const fold = element("button", {
    class: "alarm-fold quiet",
    attributes: { "aria-expanded": "false", "aria-label": text("bar.more") },
    onclick: () => fold.setAttribute("aria-expanded", String(fold.getAttribute("aria-expanded") !== "true")),
  });
  const row = element(
    "li",
    { data: { severity, code: reason.code } },
    icon(severity),
    element("span", { class: "alarm-words" }, words, act),
    press,
    since,
    fold,
  );
  let seenAt = 0;
  let step = /** @type {Step|undefined} */ (undefined);
  return {
    row,
    seen: () => seenAt,
    /**
     * @param {import("../js/state/reasons.js").Reason} why
     * @param {readonly import("../js/state/reasons.js").Reason[]} steps
     * @param {number} at
     */
    show(why, steps, at) {
      seenAt = at;
      const parts = partsOf(why);
      setText(words, parts.text);
      setText(act, [parts.act, ...steps.map(reasonText)].filter(Boolean).map(sentence).join(" "));
      act.dataset.steps = steps.map((each) => each.code).join(" ");
      step = steps.map((each) => PRESSES[each.code]).find((each) => each && !whyNotStep(each));
      press.hidden = !step;
      if (step) setText(press, labelOf(step));
    },
  };
}

/** @param {Step} step */
function labelOf(step) {
  if (step === "continue") return text("command.Resume");
  if (step === "calibration") return text("command.UseCamera");
  return COMMANDS.some((each) => each === step) ? text(`command.${step}`) : text(`bar.to_${step}`);
}
customElements.define("rp-alarms", RpAlarms);
