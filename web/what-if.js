// Another pruning rule: what it would change is asked first, and changes nothing; applied, it can be taken back.

import { ask, post } from "./api.js";
import { remember } from "./decisions.js";

/** @typedef {import("./messages.js").PruningRule} PruningRule */

/**
 * What a rule would change, in words; or why nobody knows.
 *
 * @param {PruningRule} rule
 */
export function tryRule(rule) {
  return post("api/rule/what-if", rule);
}

/** @param {PruningRule} rule */
export async function applyRule(rule) {
  const done = await ask("The rule", "api/rule", rule);
  // Taken back while it is still in force, or refused: somebody else's rule is not undone from here.
  if (done) remember(`the rule ${ruleWords(rule)}`, () => ask("Taking the rule back", "api/rule/undo", rule));
  return done;
}

/** @param {PruningRule} rule */
export function ruleWords(rule) {
  const nodes = rule.system === "guyot" ? `${rule.nodes_kept} + ${rule.fruiting_nodes}` : `${rule.nodes_kept}`;
  const word = rule.system === "guyot" ? "Guyot" : "Spur";
  const thick = Number((1000 * rule.keeper_diameter).toFixed(1));
  return `${word} · ${nodes} nodes · ≥ ${thick} mm · ${Math.round(1000 * rule.offset)} mm past`;
}
