// The screen for the work: the cut under way or the chosen one, what waits for a person, and the cuts vine by vine.

import { countOf } from "../js/control/allowed.js";
import { isUncertain, placeOfCut } from "../js/control/decisions.js";
import { waitingPlaces } from "../js/control/next-step.js";
import { cutTime } from "../js/control/order.js";
import { cuts, cutToShow, vines } from "../js/control/progress.js";
import { select, selectAndReveal } from "../js/control/selection.js";
import { cutOn, fetchPicture } from "../js/link/pictures.js";
import { link, now, pageState, points, revealCount, selected, staleWords } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { screen } from "../js/state/screens.js";
import { drawOn } from "../js/state/signals.js";
import { counted, labelOf, text } from "../js/state/texts.js";
import { element, keepRows, setAttribute, setText } from "../js/views/dom.js";
import { statusOf } from "../js/state/point-status.js";
import { setStatus } from "../js/views/point-status.js";
import { RpCutPicture } from "./rp-cut-picture.js";

/** @typedef {import("../js/link/messages.js").PagePoint} PagePoint */

/** Height of a vine's heading, which stays in sight (px). */
const HEADING = 40;
/** A picture that is not there yet is asked for again after this time (ms). */
const AGAIN_MS = 2000;

class RpWork extends HTMLElement {
  list = element("ol", { class: "cuts", attributes: { "aria-label": text("work.cuts") } });
  /** Scrolls below the cut, where there is room for both. */
  rest = element("div", { class: "work-rest" });

  connectedCallback() {
    const stale = element("p", { class: "stale-note", attributes: { role: "status" } });
    const empty = element("p", { class: "empty", text: text("work.none") });
    this.rest.append(this.list, empty);
    this.append(stale, theCut(), needs(), this.rest);
    drawOn([pageState, link, now], () => {
      const words = staleWords("controller", "perception");
      setText(stale, words);
    });
    const groups = keepRows(this.list, vineGroup);
    drawOn([points, selected, pageState], () => {
      empty.hidden = cuts().length > 0;
      groups(vines().map((vine) => [String(vine.vine), vine]));
    });
    drawOn([selected, revealCount, screen], () => this.reveal());
  }

  /** Scroll only the list to the chosen cut. */
  reveal() {
    const row = this.list.querySelector('[aria-current="true"]');
    if (!row || this.rest.scrollHeight <= this.rest.clientHeight) return;
    const [box, frame] = [row.getBoundingClientRect(), this.rest.getBoundingClientRect()];
    const top = frame.top + HEADING;
    if (box.top < top) this.rest.scrollTop += box.top - top;
    else if (box.bottom > frame.bottom) this.rest.scrollTop += box.bottom - frame.bottom;
  }
}

/** The cut that matters now: its place, state, picture and reason. Its size is the same for every cut. */
function theCut() {
  const count = element("p", { class: "work-count number" });
  const name = element("h2");
  const state = element("p", { class: "work-state", attributes: { role: "status" } });
  const picture = new RpCutPicture();
  picture.classList.add("work-picture");
  picture.inert = true;
  const why = element("p", { class: "hint" });
  const open = element("a", { class: "button", text: text("work.open"), attributes: { href: "#review" } });
  const box = element("section", { class: "work-cut" }, count, name, open, state, picture, why);
  let [of, shown, timer] = ["", "", 0];
  /** Asked for again where it is not there yet, or shows an older cut. @param {PagePoint} row @param {string} version */
  const load = async (row, version) => {
    const found = await fetchPicture(`api/points/${encodeURIComponent(row.point.point_id)}`);
    if (shown !== version) return;
    const { cut, pictured } = cutOn(found, row);
    picture.show(found, cut, text("work.picture"));
    if (pictured !== "shown") timer = window.setTimeout(() => void load(row, version), AGAIN_MS);
  };
  open.addEventListener("click", () => select(of));
  drawOn([points, pageState, selected], () => {
    const controller = pageState.get()?.controller ?? null;
    const row = cutToShow(controller?.active_point_id ?? "", selected.get());
    box.hidden = !row;
    if (!row) return;
    const { point, entry } = row;
    const all = cuts();
    of = point.point_id;
    box.dataset.status = statusOf(entry.state);
    setText(count, text("work.count", { number: all.indexOf(row) + 1, count: all.length }));
    setText(name, text("work.place", { vine: point.vine, spur: point.spur }));
    setText(state, stateWords(row, controller?.phase ?? ""));
    const words = reasonText(entry.reason) || reasonText(point.reason);
    setText(why, words);
    why.title = words;
    const version = `${of} ${point.revision} ${point.digest}`;
    if (shown === version) return;
    shown = version;
    window.clearTimeout(timer);
    picture.show(null, null, "");
    void load(row, version);
  });
  return box;
}

/**
 * @param {PagePoint} row
 * @param {import("../js/link/messages.js").Phase} phase
 */
function stateWords({ point, entry, plan }, phase) {
  const active = pageState.get()?.controller?.active_point_id === point.point_id;
  const doing = active && phase ? ` · ${text(`phase.${phase}`)}` : "";
  const time = entry.state === "ACCEPTED" && plan ? cutTime(plan) : "";
  return `${labelOf(entry.state)}${doing}${!doing && time ? ` · ${time}` : ""}`;
}

/** What waits for a person, and the way there. */
function needs() {
  const link = element("a", { class: "button needs", attributes: { href: "#review" } });
  drawOn([points, pageState], () => {
    const unsure = (points.get()?.points ?? []).filter(isUncertain).length;
    const sure = countOf("PROPOSED") - unsure;
    const places = waitingPlaces();
    const all = [
      countOf("UNKNOWN") > 0 ? counted("work.unknown", countOf("UNKNOWN")) : "",
      countOf("FAILED_NOT_CUT") > 0 ? counted("work.not_cut", countOf("FAILED_NOT_CUT")) : "",
      sure > 0 ? counted("work.sure", sure) : "",
      unsure > 0 ? counted("work.unsure", unsure) : "",
      places > 0 ? counted("work.places", places) : "",
      countOf("UNREACHABLE") > 0 ? counted("work.beyond", countOf("UNREACHABLE")) : "",
    ].filter(Boolean);
    // A line ends between two of them alone.
    const calm = text(points.get() ? "work.nothing" : "screen.loading");
    const words = all.map((each) => each.replaceAll(" ", "\u00a0")).join("\u00a0· ") || calm;
    link.classList.toggle("calm", all.length === 0);
    setText(link, words);
    link.title = words;
  });
  return link;
}

/** The cuts of a vine below its name and count. @param {string} name Its number. */
function vineGroup(name) {
  const heading = element("h3");
  const list = element("ol", { attributes: { "aria-label": text("work.vine", { vine: name }) } });
  const rows = keepRows(list, cutRow);
  return {
    item: element("li", {}, heading, list),
    /** @param {import("../js/control/progress.js").VineProgress} vine */
    show(vine) {
      setText(heading, text("work.group", { vine: vine.vine, done: vine.done, count: vine.count }));
      rows(cuts().filter(({ point }) => point.vine === vine.vine).map((row) => [row.point.point_id, row]));
    },
  };
}

/** @param {string} name */
function cutRow(name) {
  const shape = element("span", { class: "shape" });
  const [place, state] = [element("span", { class: "cut-place" }), element("span", { class: "cut-state" })];
  const button = element("button", { class: "quiet", onclick: () => selectAndReveal(name) }, shape, place, state);
  const item = element("li", { data: { cut: name } }, button);
  return {
    item,
    /** @param {PagePoint} row */
    show(row) {
      const { point, entry } = row;
      const status = statusOf(entry.state);
      item.dataset.state = entry.state;
      button.dataset.status = status;
      setStatus(shape, status);
      setText(place, placeOfCut(text("work.spur", { spur: point.spur }), row));
      setText(state, labelOf(entry.state));
      setAttribute(button, "aria-current", selected.get() === name ? "true" : "");
    },
  };
}
customElements.define("rp-work", RpWork);
