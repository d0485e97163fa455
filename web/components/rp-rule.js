// The pruning rule: what is tried here holds at once, and the points of all that was seen follow it.

import { whyNothing } from "../allowed.js";
import { post } from "../api.js";
import { element, setEnabled, setText } from "../element.js";
import { isLive, link, now, pageState, points, say } from "../state.js";
import { drawOn } from "../store.js";
import { changesSince, changeWords } from "../what-if.js";

/** @typedef {import("../messages.js").PruningRule} PruningRule */
/** @typedef {"nodes_kept"|"fruiting_nodes"|"keeper_diameter"|"offset"} Quantity */

/** While somebody drags on, no more than one request waits for another (ms). */
const SETTLE_MS = 150;
/** Changes that come so long after the answer (ms) are no longer the rule's doing. */
const WATCH_MS = 2500;

/** @type {readonly { name: Quantity, label: string, unit: string, scale: number, range: [number, number, number] }[]} */
const QUANTITIES = Object.freeze([
  { name: "nodes_kept", label: "Nodes kept on a spur", unit: "", scale: 1, range: [1, 5, 1] },
  { name: "fruiting_nodes", label: "Nodes on the fruiting cane", unit: "", scale: 1, range: [3, 20, 1] },
  { name: "keeper_diameter", label: "Least thickness preferred", unit: " mm", scale: 1000, range: [3, 15, 0.5] },
  { name: "offset", label: "Cut past the last node", unit: " mm", scale: 1000, range: [5, 50, 1] },
]);

/** @type {readonly (readonly [PruningRule["system"], string])[]} */
const SYSTEMS = Object.freeze([
  ["spur", "Spur"],
  ["guyot", "Guyot"],
]);

class RpRule extends HTMLElement {
  constructor() {
    super();
    this.summary = element("span");
    this.outcome = element("p", { class: "rule-outcome", attributes: { role: "status" } });
    this.back = element("button", { id: "rule-back", class: "quiet", text: "Put back", attributes: { type: "button" } });
    /** @type {Map<Quantity, { row: HTMLElement, input: HTMLInputElement, value: HTMLElement }>} */
    this.sliders = new Map();
    /** @type {HTMLInputElement[]} */
    this.systems = [];
    /** What somebody has set here and perception has not yet; null when nothing. @type {PruningRule|null} */
    this.wanted = null;
    /** The rule before the first change. @type {PruningRule|null} */
    this.former = null;
    this.timer = 0;
    this.asking = false;
  }

  connectedCallback() {
    const summary = element("summary", {}, this.summary);
    const body = element("div", { class: "rule-body" }, this.systemChoice(), ...QUANTITIES.map((each) => this.slider(each)));
    body.append(element("div", { class: "rule-foot" }, this.outcome, this.back));
    this.append(element("details", { class: "rule" }, summary, body));
    this.back.addEventListener("click", () => this.former && this.want(this.former));
    drawOn([points, pageState, link, now], () => this.draw());
  }

  systemChoice() {
    const box = element("div", { class: "systems", attributes: { role: "radiogroup", "aria-label": "Training system" } });
    for (const [system, word] of SYSTEMS) {
      const input = element("input", { id: `system-${system}`, attributes: { type: "radio", name: "system", value: system } });
      input.addEventListener("change", () => this.change({ system }));
      this.systems.push(input);
      box.append(element("label", { attributes: { for: input.id } }, input, element("span", { text: word })));
    }
    return box;
  }

  /** @param {(typeof QUANTITIES)[number]} quantity */
  slider({ name, label, unit, scale, range: [min, max, step] }) {
    const value = element("output", { class: "number" });
    const input = element("input", {
      id: `rule-${name}`,
      attributes: { type: "range", min: String(min), max: String(max), step: String(step) },
    });
    input.addEventListener("input", () => {
      setText(value, `${input.value}${unit}`);
      this.change({ [name]: Number(input.value) / scale });
    });
    const row = element(
      "div",
      { class: "rule-row", data: { quantity: name } },
      element("label", { text: label, attributes: { for: input.id } }),
      value,
      input,
    );
    this.sliders.set(name, { row, input, value });
    return row;
  }

  /** @param {Partial<PruningRule>} part */
  change(part) {
    const rule = this.wanted ?? points.get()?.rule;
    if (rule) this.want({ ...rule, ...part });
  }

  /** @param {PruningRule} rule */
  want(rule) {
    this.former ??= points.get()?.rule ?? null;
    this.wanted = rule;
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => void this.ask(), SETTLE_MS);
    this.draw();
  }

  async ask() {
    if (this.asking || this.wanted === null) return;
    this.asking = true;
    const asked = this.wanted;
    const before = points.get()?.points ?? [];
    setText(this.outcome, "Trying it…");
    const answer = await post("api/rule", asked);
    this.asking = false;
    if (this.wanted !== asked) {
      void this.ask();
      return;
    }
    if (!answer.ok) {
      this.wanted = null;
      setText(this.outcome, `Not done: ${answer.reason}`);
      if (answer.status !== 409 && answer.status !== 503) say("error", `Rule refused: ${answer.reason}`);
      this.draw();
      return;
    }
    this.watch(before, asked);
  }

  /**
   * Tell what becomes of the points, as it comes in. What was set stays on the sliders until perception says the same.
   *
   * @param {readonly import("../messages.js").PagePoint[]} before
   * @param {PruningRule} asked
   */
  watch(before, asked) {
    const settle = () => {
      if (this.wanted === asked) this.wanted = null;
    };
    const tell = () => {
      const page = points.get();
      if (page?.rule && ruleWords(page.rule) === ruleWords(asked)) settle();
      setText(this.outcome, changeWords(changesSince(before, page?.points ?? [])));
    };
    const stop = points.subscribe(tell);
    window.setTimeout(() => {
      stop();
      settle();
      this.draw();
    }, WATCH_MS);
    tell();
  }

  draw() {
    const rule = this.wanted ?? points.get()?.rule ?? null;
    this.hidden = rule === null;
    if (rule === null) return;
    const why = whyNothing() || (isLive("perception") ? "" : "Perception is not there");
    setText(this.summary, ruleWords(rule));
    for (const input of this.systems) {
      if (input.checked !== (input.value === rule.system)) input.checked = input.value === rule.system;
      setEnabled(input, why);
    }
    for (const { name, unit, scale } of QUANTITIES) {
      const slider = this.sliders.get(name);
      if (!slider) continue;
      const shown = String(Number((rule[name] * scale).toFixed(3)));
      if (slider.input.value !== shown) slider.input.value = shown;
      setEnabled(slider.input, why);
      setText(slider.value, `${shown}${unit}`);
      slider.row.hidden = name === "fruiting_nodes" && rule.system !== "guyot";
    }
    const changed = this.former !== null && QUANTITIES.some(({ name }) => this.former?.[name] !== rule[name]);
    this.back.hidden = !changed && (this.former === null || this.former.system === rule.system);
    setEnabled(this.back, why, "The rule as it was before it was changed here; acceptances that are void stay void");
  }
}

/** @param {PruningRule} rule */
function ruleWords(rule) {
  const nodes = rule.system === "guyot" ? `${rule.nodes_kept} + ${rule.fruiting_nodes}` : `${rule.nodes_kept}`;
  const word = rule.system === "guyot" ? "Guyot" : "Spur";
  const thick = Number((1000 * rule.keeper_diameter).toFixed(1));
  return `${word} · ${nodes} nodes · ≥ ${thick} mm · ${Math.round(1000 * rule.offset)} mm past`;
}
customElements.define("rp-rule", RpRule);
