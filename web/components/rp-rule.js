// The pruning rule. A slider asks for a what-if; Apply puts the rule in force, and Undo reverts it.

import { whyNothingOf } from "../js/control/allowed.js";
import { undoable } from "../js/control/decisions.js";
import { ask, post } from "../js/link/api.js";
import { link, now, pageState, points } from "../js/state/page-state.js";
import { reason, reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setEnabled, setText } from "../js/views/dom.js";

/** @typedef {import("../js/link/messages.js").PruningRule} PruningRule */

/**
 * Ask what a rule would change.
 *
 * @param {PruningRule} rule
 */
function tryRule(rule) {
  return post("api/rule/what-if", rule);
}

/** @param {PruningRule} rule */
function applyRule(rule) {
  // Refused unless it is still in force: another person's rule cannot be undone from here.
  const back = () => ask(text("rule.taking_back"), "api/rule/undo", rule);
  return undoable(ask(text("rule.asked"), "api/rule", rule), () => text("rule.named", { rule: ruleWords(rule) }), back);
}

/** @param {PruningRule} rule */
function ruleWords(rule) {
  const nodes = rule.system === "guyot" ? `${rule.nodes_kept} + ${rule.fruiting_nodes}` : `${rule.nodes_kept}`;
  return text("rule.words", {
    system: text(`rule.system.${rule.system}`),
    nodes,
    thickness: Number((1000 * rule.preferred_diameter).toFixed(1)),
    past: Math.round(1000 * rule.offset),
  });
}

/** @typedef {"nodes_kept"|"fruiting_nodes"|"preferred_diameter"|"offset"} Quantity */

/** Debounce of the sliders, and of changed points (ms). */
const SETTLE_MS = 150;
const AGAIN_MS = 1000;
/** An applied rule is shown for this time (ms) until perception confirms it. */
const APPLIED_TIMEOUT_MS = 2500;

/**
 * @type {readonly { name: Quantity, unit: string, scale: number, range: [number, number, number] }[]}
 */
const QUANTITIES = Object.freeze([
  { name: "nodes_kept", unit: "", scale: 1, range: [1, 5, 1] },
  { name: "fruiting_nodes", unit: "", scale: 1, range: [3, 20, 1] },
  { name: "preferred_diameter", unit: " mm", scale: 1000, range: [3, 15, 0.5] },
  { name: "offset", unit: " mm", scale: 1000, range: [5, 50, 1] },
]);

/** @type {readonly PruningRule["system"][]} */
const SYSTEMS = Object.freeze(["spur", "guyot"]);

class RpRule extends HTMLElement {
  constructor() {
    super();
    this.summary = element("span");
    this.outcome = element("p", { class: "rule-outcome", attributes: { role: "status" } });
    this.apply = element("button", { id: "rule-apply", class: "primary", text: text("rule.apply") });
    this.discard = element("button", { id: "rule-discard", class: "quiet", text: text("rule.discard") });
    /** @type {Map<Quantity, { row: HTMLElement, input: HTMLInputElement, value: HTMLElement }>} */
    this.sliders = new Map();
    /** @type {HTMLInputElement[]} */
    this.systems = [];
    /** Rule of the sliders; null if it is the rule in force. @type {PruningRule|null} */
    this.draft = null;
    /** The rule applied last, until perception confirms it. @type {PruningRule|null} */
    this.applied = null;
    /** Is the effect of the draft known? */
    this.known = false;
    this.asking = false;
    this.timer = 0;
    /** @type {import("../js/link/messages.js").PagePoints|null} */
    this.page = null;
  }

  connectedCallback() {
    const summary = element("summary", {}, this.summary);
    const body = element(
      "div",
      { class: "rule-body" },
      this.systemChoice(),
      ...QUANTITIES.map((each) => this.slider(each)),
    );
    body.append(element("div", { class: "rule-foot" }, this.outcome, this.discard, this.apply));
    this.append(element("details", { class: "rule" }, summary, body));
    this.apply.addEventListener("click", () => void this.hold());
    this.discard.addEventListener("click", () => this.want(points.get()?.rule ?? null));
    drawOn([points, pageState, link, now], () => this.draw());
  }

  systemChoice() {
    const box = element("div", {
      class: "systems",
      attributes: { role: "radiogroup", "aria-label": text("rule.systems") },
    });
    for (const system of SYSTEMS) {
      const input = element("input", {
        id: `system-${system}`,
        attributes: { type: "radio", name: "system", value: system },
      });
      input.addEventListener("change", () => this.change({ system }));
      this.systems.push(input);
      box.append(element("label", { attributes: { for: input.id } }, input, element("span", { text: text(`rule.system.${system}`) })));
    }
    return box;
  }

  /** @param {(typeof QUANTITIES)[number]} quantity */
  slider({ name, unit, scale, range: [min, max, step] }) {
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
      element("label", { text: text(`rule.${name}`), attributes: { for: input.id } }),
      value,
      input,
    );
    this.sliders.set(name, { row, input, value });
    return row;
  }

  /** @param {Partial<PruningRule>} part */
  change(part) {
    const rule = this.draft ?? this.applied ?? points.get()?.rule;
    if (rule) this.want({ ...rule, ...part });
  }

  /** @param {PruningRule|null} rule Rule of the sliders. */
  want(rule) {
    const held = this.applied ?? points.get()?.rule ?? null;
    this.draft = rule && held && !same(rule, held) ? rule : null;
    this.known = false;
    setText(this.outcome, this.draft ? text("rule.asking") : "");
    this.askIn(SETTLE_MS);
    this.draw();
  }

  /** @param {number} delay (ms) */
  askIn(delay) {
    window.clearTimeout(this.timer);
    this.timer = 0;
    if (this.draft) this.timer = window.setTimeout(() => void this.ask(), delay);
  }

  /** Ask what the draft would change. */
  async ask() {
    this.timer = 0;
    const asked = this.draft;
    if (asked === null || this.asking) return;
    this.asking = true;
    const answer = await tryRule(asked);
    this.asking = false;
    if (this.draft !== asked) {
      if (!this.timer) this.askIn(0);
      return;
    }
    this.known = answer.ok;
    setText(this.outcome, text(answer.ok ? "rule.effect" : "rule.unknown", { told: reasonText(answer.why) }));
    if (!answer.ok) this.askIn(AGAIN_MS);
    this.draw();
  }

  /** Put the draft in force. */
  async hold() {
    const rule = this.draft;
    if (rule === null) return;
    this.known = false;
    this.draw();
    if (!(await applyRule(rule))) {
      this.askIn(0);
      return;
    }
    this.applied = rule;
    this.draft = null;
    setText(this.outcome, text("rule.applied"));
    window.setTimeout(() => {
      if (this.applied === rule) this.applied = null;
      this.draw();
    }, APPLIED_TIMEOUT_MS);
    this.draw();
  }

  draw() {
    const page = points.get();
    const held = page?.rule ?? null;
    if (this.applied && held && same(this.applied, held)) this.applied = null;
    if (this.draft && held && same(this.draft, held)) this.want(held);
    // New images may change the effect.
    if (page !== this.page && this.draft && !this.timer && !this.asking) this.askIn(AGAIN_MS);
    this.page = page;
    const rule = this.draft ?? this.applied ?? held;
    this.hidden = rule === null;
    if (rule === null) return;
    const why = whyNothingOf("perception");
    const words = ruleWords(this.applied ?? held ?? rule);
    setText(this.summary, text(this.draft ? "rule.tried" : "rule.held", { rule: words }));
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
    this.apply.hidden = this.discard.hidden = this.draft === null;
    setEnabled(
      this.apply,
      why ?? (this.known ? null : reason("rule_effect_unknown")),
      text("rule.apply_hint"),
    );
  }
}

/**
 * @param {PruningRule} one
 * @param {PruningRule} other
 */
function same(one, other) {
  return rounded(one) === rounded(other);
}

/** As the sliders show it. @param {PruningRule} rule */
function rounded({ system, nodes_kept, fruiting_nodes, preferred_diameter, offset }) {
  return [system, nodes_kept, fruiting_nodes, (1000 * preferred_diameter).toFixed(1), (1000 * offset).toFixed()].join();
}
customElements.define("rp-rule", RpRule);
