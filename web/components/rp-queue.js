// The queue of pruning points, by vine and spur; up, down, A and R work from the keyboard.

import { countOf, whyNot } from "../allowed.js";
import { ask } from "../api.js";
import { placing, setPlacing, whyNoPlacing } from "../by-hand.js";
import { element, panelHead, setEnabled, setText } from "../element.js";
import { icon } from "../icons.js";
import { link, now, pageState, points, selected, staleWords } from "../state.js";
import { drawOn } from "../store.js";
import { select } from "../teleoperation.js";
import { counted } from "../words.js";
import { RpPointDetails } from "./rp-point-details.js";
import { RpPoint, accept, reject, whyNotAccept, whyNotReject } from "./rp-point.js";

/** @typedef {import("../messages.js").PagePoint} PagePoint */

const THRESHOLDS = Object.freeze([0, 0.5, 0.7, 0.9]);

class RpQueue extends HTMLElement {
  connectedCallback() {
    const source = element("span", { class: "tag", attributes: { title: "What tells cane, node and post apart in the image" } });
    const { head, note } = panelHead("Pruning points", source);
    const summary = element("p", { class: "summary number" });
    const list = element("div", { class: "groups", attributes: { "aria-label": "Pruning points" } });
    const empty = element("div", { class: "empty", attributes: { role: "status" } });
    const open = [
      abstainedList("another look", (count) => `${counted(count, "place")} ${count === 1 ? "needs" : "need"} another look`),
      abstainedList("operator", (count) => `${counted(count, "place")} for you to decide`),
    ];
    list.addEventListener("keydown", (event) => this.key(event));
    this.append(head, document.createElement("rp-rule"), element("div", { class: "queue-tools" }, summary, ...acceptAll(), addByHand()), list, empty, element("div", { class: "open-places" }, ...open.map((each) => each.box)));

    /** @type {Map<string, HTMLElement>} */
    const groups = new Map();
    drawOn([points, pageState, link, now, selected], () => {
      const page = points.get();
      const rows = inOrder(page?.points ?? []);
      const reachable = this.rows.has(selected.get()) ? selected.get() : rows[0]?.point.point_id;
      const words = staleWords("controller", "perception");
      setText(note, words);
      this.classList.toggle("stale", words !== "");
      setText(summary, summaryWords(rows));
      setText(source, page?.segmenter ?? "");
      setText(empty, emptyWords());
      empty.hidden = rows.length > 0;
      for (const each of open) each.show(page?.abstained ?? []);
      this.place(list, groups, rows, reachable ?? "");
      this.explain(rows.find((row) => row.point.point_id === selected.get()));
    });
  }

  /** @type {Map<string, RpPoint>} */
  rows = new Map();

  details = new RpPointDetails();

  /** @param {PagePoint|undefined} row The chosen one. */
  explain(row) {
    const item = row && this.rows.get(row.point.point_id);
    if (!item) {
      this.details.remove();
      return;
    }
    this.details.show(row);
    if (this.details.parentElement === item) return;
    item.append(this.details);
    item.scrollIntoView({ block: "nearest" });
  }

  /**
   * Put the rows where they belong, moving only what has to move, so that focus and scroll stay.
   *
   * @param {HTMLElement} list
   * @param {Map<string, HTMLElement>} groups
   * @param {readonly PagePoint[]} rows
   * @param {string} reachable
   */
  place(list, groups, rows, reachable) {
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
        group = element("div", { class: "group", attributes: { role: "list", "aria-label": name } }, element("h3", { text: name }));
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
      item.show(row, row.point.point_id === reachable);
    }
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const order = inOrder(points.get()?.points ?? []);
    const at = order.findIndex((row) => row.point.point_id === selected.get());
    const row = order[at];
    if (event.key === "ArrowDown" || event.key === "ArrowUp") {
      event.preventDefault();
      const next = order[at < 0 ? 0 : Math.min(order.length - 1, Math.max(0, at + (event.key === "ArrowDown" ? 1 : -1)))];
      if (!next) return;
      select(next.point.point_id);
      this.rows.get(next.point.point_id)?.focus();
    } else if (event.key.toLowerCase() === "a" && row && !whyNotAccept(row)) {
      void accept(row);
    } else if (event.key.toLowerCase() === "r" && row && !whyNotReject(row)) {
      void reject(row);
    }
  }
}

function acceptAll() {
  const least = element("select", { id: "least-confidence", attributes: { "aria-label": "Least confidence to accept" } });
  for (const value of THRESHOLDS) {
    const words = value === 0 ? "any" : `≥ ${value * 100} %`;
    least.append(element("option", { text: words, attributes: { value: String(value) } }));
  }
  const button = element("button", { id: "accept-all", text: "Accept all", attributes: { type: "button" } });
  button.addEventListener("click", () => {
    void ask("Accepting all", "/api/points/accept-all", { confidence: Number(least.value) });
  });
  drawOn([points, pageState, link, now], () => {
    const why = whyNot("AcceptAll") || (countOf("PROPOSED") === 0 ? "There is no proposed point" : "");
    setEnabled(button, why, "Accept every proposed point with this confidence");
  });
  return [button, least];
}

function addByHand() {
  const button = element("button", { id: "add-by-hand", attributes: { type: "button", "aria-label": "Add a point by hand" } }, icon("add"));
  button.addEventListener("click", () => setPlacing(!placing.get()));
  drawOn([placing, pageState, link, now], () => {
    setEnabled(button, whyNoPlacing(), "Add a point by hand: click a cane in the 3-D view or in the camera image");
    button.setAttribute("aria-pressed", String(placing.get()));
  });
  return button;
}

/**
 * The places without a point that need one thing.
 *
 * @param {import("../messages.js").Need} needs
 * @param {(count: number) => string} title
 */
function abstainedList(needs, title) {
  const summary = element("summary");
  const list = element("ul");
  const box = element("details", { class: "abstained", attributes: { "data-needs": needs } }, summary, list);
  let shown = "";
  return {
    box,
    /** @param {readonly import("../messages.js").Abstention[]} all */
    show(all) {
      const lines = all.filter((each) => each.needs === needs).map(placeWords);
      box.hidden = lines.length === 0;
      const key = lines.join("\n");
      if (key === shown) return;
      shown = key;
      setText(summary, title(lines.length));
      list.replaceChildren(...lines.map((text) => element("li", { text })));
    },
  };
}

/** @param {import("../messages.js").Abstention} place */
function placeWords(place) {
  return place.vine === 0 ? place.reason : `Vine ${place.vine} · spur ${place.spur}: ${place.reason}`;
}

/** @param {readonly PagePoint[]} rows */
function inOrder(rows) {
  return [...rows].sort((a, b) => a.point.vine - b.point.vine || a.point.spur - b.point.spur);
}

/** @param {PagePoint} row */
function groupOf(row) {
  return `Vine ${row.point.vine} · spur ${row.point.spur}`;
}

/** @param {readonly PagePoint[]} rows */
function summaryWords(rows) {
  if (rows.length === 0) return "";
  return `${rows.length} found · ${countOf("ACCEPTED")} accepted · ${countOf("DONE")} done`;
}

function emptyWords() {
  const page = points.get();
  if (link.get().status !== "open") return "No points known.";
  if (page === null || page.frames === 0) return "Looking for pruning points…";
  return `No pruning point in ${counted(page.frames, "image")} so far. Still looking…`;
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
