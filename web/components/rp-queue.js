// The queue of pruning points by vine and spur. Keys: arrows, A accept, R reject, Z undo, N new.

import { countOf, whyNot } from "../js/control/allowed.js";
import {
  accept,
  acceptAll,
  confidentPoints,
  decisions,
  undo,
  whyNoUndo,
  whyNotAccept,
  whyNotReject,
} from "../js/control/decisions.js";
import { placing, setPlacing, whyNoPlacing } from "../js/control/placing.js";
import { select } from "../js/control/selection.js";
import { SURE } from "../js/link/messages.js";
import { link, now, pageState, points, revealCount, selected, staleWords } from "../js/state/page-state.js";
import { keyOf, reason } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { counted, labelOf, text } from "../js/state/texts.js";
import { element, panelHead, setAttribute, setEnabled, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";
import { undecidedList } from "../js/views/undecided-sites.js";
import { RpPointDetails } from "./rp-point-details.js";
import { RpPoint, RpRejectForm } from "./rp-point.js";

/** @typedef {import("../js/link/messages.js").PagePoint} PagePoint */

/** Intents that a row's buttons depend on. */
const MAY = /** @type {const} */ (["AcceptPoint", "RejectPoint", "ResolvePoint"]);
/** Height of a group's sticky heading (px). */
const HEADING = 20;

/** A row that did not move for this many frames is where it stays. */
const STILL_FRAMES = 3;
/** Rows of Page up and Page down. */
const PAGE = 6;
/**
 * Keys that move the selection: (index, last index) → index.
 *
 * @type {Readonly<Record<string, (at: number, last: number) => number>>}
 */
const STEPS = Object.freeze({
  ArrowDown: (at, last) => Math.min(at + 1, last),
  ArrowUp: (at) => Math.max(at - 1, 0),
  PageDown: (at, last) => Math.min(at + PAGE, last),
  PageUp: (at) => Math.max(at - PAGE, 0),
  Home: () => 0,
  End: (_, last) => last,
});

class RpQueue extends HTMLElement {
  connectedCallback() {
    const source = element("span", {
      class: "tag",
      attributes: { title: text("queue.source") },
    });
    const { head, note } = panelHead(text("queue.title"), source, undoButton());
    const summary = element("p", { class: "summary number" });
    const list = element("div", { class: "groups", attributes: { role: "group", "aria-label": text("queue.title") } });
    const empty = element("div", { class: "empty", attributes: { role: "status" } });
    const open = [
      undecidedList("another look", (count) => counted("queue.look", count)),
      undecidedList("operator", (count) => counted("queue.decide", count)),
    ];
    list.addEventListener("keydown", (event) => this.key(event));
    list.addEventListener("reject", (event) => this.openRejectForm(/** @type {RpPoint} */ (event.target)));
    this.append(
      head,
      document.createElement("rp-rule"),
      document.createElement("rp-order"),
      element("div", { class: "queue-tools" }, summary, acceptEvery(), addByHand()),
      list,
      empty,
      element("div", { class: "open-places" }, ...open.map((each) => each.box)),
    );

    /** @type {Map<string, HTMLElement>} */
    const groups = new Map();
    let drawn = "";
    /** @type {import("../js/link/messages.js").PagePoints|null} */
    let drawnPage = null;
    drawOn([points, pageState, link, now], () => {
      const page = points.get();
      const words = staleWords("controller", "perception");
      setText(note, words);
      this.classList.toggle("stale", words !== "");
      setText(source, labelOf(page?.segmenter ?? ""));
      setText(empty, emptyWords());
      // States arrive ten times a second; rows depend on the points and on what is allowed.
      this.markActive(pageState.get()?.controller?.active_point_id ?? "");
      const may = MAY.map((command) => keyOf(whyNot(command))).join("\n");
      if (page === drawnPage && may === drawn) return;
      drawnPage = page;
      drawn = may;
      this.order = inOrder(page?.points ?? []);
      setText(summary, summaryWords(this.order));
      empty.hidden = this.order.length > 0;
      for (const each of open) each.show(page?.undecided_sites ?? []);
      this.placeRows(list, groups, may);
      this.rows.get(this.active)?.mark(true);
      this.choose();
    });
    drawOn([selected], () => this.choose());
    drawOn([revealCount], () => this.reveal());
    this.list = list;
  }

  /** @type {Map<string, RpPoint>} */
  rows = new Map();
  /** The points as listed. @type {readonly PagePoint[]} */
  order = [];
  /** The row marked as selected. */
  chosen = "";
  /** @type {HTMLElement|undefined} */
  list;
  /** The point at which the robot is. */
  active = "";
  reason = new RpRejectForm();

  /** @param {string} pointId */
  markActive(pointId) {
    if (pointId === this.active) return;
    this.rows.get(this.active)?.mark(false);
    this.rows.get(pointId)?.mark(true);
    this.active = pointId;
  }

  /** Mark the selected row; the Tab key reaches it, or else the first (roving tabindex). */
  choose() {
    const pointId = selected.get();
    const reachable = this.rows.has(pointId) ? pointId : (this.order[0]?.point.point_id ?? "");
    for (const name of [this.chosen, this.reachable, pointId, reachable]) {
      const item = this.rows.get(name);
      if (!item) continue;
      setAttribute(item, "aria-current", String(name === pointId));
      setAttribute(item, "tabindex", name === reachable ? "0" : "-1");
    }
    this.chosen = pointId;
    this.reachable = reachable;
    this.showDetails(this.order.find((row) => row.point.point_id === pointId));
  }

  reachable = "";

  /** @param {RpPoint} item */
  openRejectForm(item) {
    if (item.row) this.reason.open(item.row, item);
  }

  details = new RpPointDetails();

  /** @param {PagePoint|undefined} row The selected one. */
  showDetails(row) {
    const item = row && this.rows.get(row.point.point_id);
    if (!item) {
      this.details.remove();
      return;
    }
    this.details.show(row);
    if (this.details.parentElement === item) return;
    item.append(this.details);
    this.reveal();
  }

  /** Scroll only the list to the selected row. */
  reveal() {
    const item = this.rows.get(selected.get());
    const list = this.list;
    if (!item || !list) return;
    let [still, left] = [0, 60];
    const scroll = () => {
      const before = list.scrollTop;
      const [box, frame] = [item.getBoundingClientRect(), list.getBoundingClientRect()];
      const top = frame.top + HEADING;
      if (box.top < top || box.height > frame.bottom - top) list.scrollTop += box.top - top;
      else if (box.bottom > frame.bottom) list.scrollTop += box.bottom - frame.bottom;
      // Rows that come into view get their heights in a frame to come, and push this one away.
      still = list.scrollTop === before ? still + 1 : 0;
      if (still < STILL_FRAMES && left-- > 0) window.requestAnimationFrame(scroll);
    };
    scroll();
  }

  /**
   * Place the rows, moving as few as possible, to keep focus and scroll position.
   *
   * @param {HTMLElement} list
   * @param {Map<string, HTMLElement>} groups
   * @param {string} may Key of what is allowed now.
   */
  placeRows(list, groups, may) {
    const rows = this.order;
    const wantedRows = new Set(rows.map((row) => row.point.point_id));
    const wantedGroups = new Set(rows.map(groupOf));
    removeOthers(this.rows, wantedRows);
    removeOthers(groups, wantedGroups);
    let lastGroup = /** @type {HTMLElement|null} */ (null);
    let lastRow = /** @type {Element|null} */ (null);
    for (const row of rows) {
      const name = groupOf(row);
      let group = groups.get(name);
      if (!group) {
        // The list is labelled; a heading inside would not be a list item.
        const heading = element("h3", { text: name, attributes: { role: "presentation" } });
        group = element("div", { class: "group", attributes: { role: "list", "aria-label": name } }, heading);
        groups.set(name, group);
      }
      if (group !== lastGroup) {
        putAfter(list, group, lastGroup);
        lastGroup = group;
        lastRow = group.firstElementChild;
      }
      let item = this.rows.get(row.point.point_id);
      if (!item) {
        item = new RpPoint();
        this.rows.set(row.point.point_id, item);
      }
      putAfter(group, item, lastRow);
      lastRow = item;
      item.show(row, may);
    }
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const at = this.order.findIndex((row) => row.point.point_id === selected.get());
    const row = this.order[at];
    const to = STEPS[event.key]?.(Math.max(at, -1), this.order.length - 1);
    const key = event.key.toLowerCase();
    if (to !== undefined) {
      event.preventDefault();
      const next = this.order[to];
      if (!next) return;
      select(next.point.point_id);
      this.rows.get(next.point.point_id)?.focus();
    } else if (key === "a" && row && !whyNotAccept(row)) {
      void accept(row);
    } else if (key === "r" && row && !whyNotReject(row)) {
      event.preventDefault();
      this.rows.get(row.point.point_id)?.reject();
    } else if (key === "z" && !whyNoUndo()) {
      void undo();
    } else if (key === "n" && !whyNoPlacing()) {
      setPlacing(!placing.get());
    }
  }
}

function undoButton() {
  const button = element("button", { id: "undo", class: "quiet", text: text("queue.undo") });
  button.addEventListener("click", () => void undo());
  drawOn([decisions, pageState, link, now], () => {
    setEnabled(button, whyNoUndo(), text("queue.undo_hint", { words: decisions.get().at(-1)?.words ?? "" }));
  });
  return button;
}

function acceptEvery() {
  const button = element("button", { id: "accept-all" });
  button.addEventListener("click", () => void acceptAll());
  drawOn([points, pageState, link, now], () => {
    const sure = confidentPoints().length;
    const unsure = countOf("PROPOSED") - sure;
    const percent = Math.round(100 * SURE);
    setText(button, text("queue.accept_all", { sure, percent }));
    const none = reason("none_so_confident", { confidence: SURE });
    const hint =
      unsure === 0 ? text("queue.accept_all_hint", { percent }) : text("queue.accept_sure_hint", { percent, unsure });
    setEnabled(button, whyNot("AcceptAll") ?? (sure === 0 ? none : null), hint);
  });
  return button;
}

function addByHand() {
  const button = element(
    "button",
    { id: "add-by-hand", attributes: { "aria-label": text("queue.add") } },
    icon("add"),
  );
  button.addEventListener("click", () => setPlacing(!placing.get()));
  drawOn([placing, pageState, link, now], () => {
    setEnabled(button, whyNoPlacing(), text("queue.add_hint"));
    button.setAttribute("aria-pressed", String(placing.get()));
  });
  return button;
}

/** @param {readonly PagePoint[]} rows */
function inOrder(rows) {
  return [...rows].sort((a, b) => a.point.vine - b.point.vine || a.point.spur - b.point.spur);
}

/** @param {PagePoint} row */
function groupOf(row) {
  return text("queue.group", { vine: row.point.vine, spur: row.point.spur });
}

/** @param {readonly PagePoint[]} rows */
function summaryWords(rows) {
  if (rows.length === 0) return "";
  const notCut = countOf("FAILED_NOT_CUT");
  const beyond = countOf("UNREACHABLE");
  const words = [
    text("queue.found", { count: rows.length }),
    text("queue.accepted", { count: countOf("ACCEPTED") }),
    beyond > 0 ? text("queue.beyond", { count: beyond }) : "",
    text("queue.done", { count: countOf("DONE") }),
    notCut > 0 ? text("queue.not_cut", { count: notCut }) : "",
  ];
  return words.filter(Boolean).join(" · ");
}

function emptyWords() {
  const page = points.get();
  if (link.get().status !== "open") return text("queue.unknown");
  if (page === null || page.frames === 0) return text("queue.looking");
  return counted("queue.none", page.frames);
}

/**
 * @param {Map<string, Element>} nodes
 * @param {ReadonlySet<string>} wanted
 */
function removeOthers(nodes, wanted) {
  for (const [name, node] of nodes) {
    if (wanted.has(name)) continue;
    node.remove();
    nodes.delete(name);
  }
}

/**
 * @param {Element} parent
 * @param {Element} node
 * @param {Element|null} previous
 */
function putAfter(parent, node, previous) {
  const next = previous ? previous.nextElementSibling : parent.firstElementChild;
  if (node.parentElement === parent && next === node) return;
  parent.insertBefore(node, next);
}
customElements.define("rp-queue", RpQueue);
