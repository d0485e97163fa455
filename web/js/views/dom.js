// Building DOM elements without markup strings, so that no text can become markup.

import { reasonText } from "../state/reasons.js";
import { joined, text } from "../state/texts.js";

const SVG = "http://www.w3.org/2000/svg";

/**
 * @typedef {object} Traits
 * @property {string} [id]
 * @property {string} [class]
 * @property {string} [text]
 * @property {Record<string, string>} [data] `data-` attributes.
 * @property {Record<string, string>} [attributes] All others.
 * @property {(event: MouseEvent) => void} [onclick]
 */

/**
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Traits} [traits]
 * @param {...(Node|string)} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function element(tag, traits = {}, ...children) {
  const node = document.createElement(tag);
  if (traits.id) node.id = traits.id;
  if (traits.class) node.className = traits.class;
  if (traits.text !== undefined) node.textContent = joined(traits.text);
  // A button submits its form only where it says so.
  if (node instanceof HTMLButtonElement) node.type = "button";
  for (const [name, value] of Object.entries(traits.data ?? {})) node.dataset[name] = value;
  for (const [name, value] of Object.entries(traits.attributes ?? {})) node.setAttribute(name, value);
  if (traits.onclick) node.addEventListener("click", /** @type {EventListener} */ (traits.onclick));
  node.append(...children);
  return node;
}

/**
 * @param {Traits} traits
 * @param {readonly (readonly [value: string, words: string])[]} options
 */
export function dropDown(traits, options) {
  return element(
    "select",
    traits,
    ...options.map(([value, words]) => element("option", { text: words, attributes: { value } })),
  );
}

/**
 * @template {keyof SVGElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, string|number>} [attributes]
 * @param {...Node} children
 * @returns {SVGElementTagNameMap[K]}
 */
export function svg(tag, attributes = {}, ...children) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, String(value));
  node.append(...children);
  return node;
}

/**
 * Fill in the texts of a page's own markup: of elements with `data-text` and `data-label`.
 *
 * @param {Document} page
 */
export function fillTexts(page) {
  for (const each of page.querySelectorAll("[data-text]")) setText(each, text(String(each.getAttribute("data-text"))));
  for (const each of page.querySelectorAll("[data-label]")) each.ariaLabel = text(String(each.getAttribute("data-label")));
}

/**
 * Set the text only if it differs, to keep selections and screen readers undisturbed.
 *
 * @param {Element} node
 * @param {string} words
 */
export function setText(node, words) {
  const shown = joined(words);
  if (node.textContent !== shown) node.textContent = shown;
}

/**
 * Enable a control, or disable it with a reason. Uses `aria-disabled`: a control with the `disabled` attribute takes
 * neither press nor focus and could not show its reason (`disabled-reasons.js`).
 *
 * @param {HTMLButtonElement|HTMLInputElement} button
 * @param {import("../state/reasons.js").Reason|null} why Reason; null to enable.
 * @param {string} [hint] What it does; shown while enabled.
 */
export function setEnabled(button, why, hint = "") {
  const words = why ? reasonText(why) : hint;
  setAttribute(button, "aria-disabled", String(why !== null));
  setAttribute(button, "title", words);
  setAttribute(button, "aria-description", words);
}

/**
 * Set an attribute only if it differs, since states arrive many times a second.
 *
 * @param {Element} node
 * @param {string} name
 * @param {string} value Empty removes it.
 */
export function setAttribute(node, name, value) {
  if ((node.getAttribute(name) ?? "") === value) return;
  if (value) node.setAttribute(name, value);
  else node.removeAttribute(name);
}

/**
 * Head of a panel, with a place for the stale note.
 *
 * @param {string} title
 * @param {...Node} extra
 */
export function panelHead(title, ...extra) {
  const note = element("span", { class: "stale-note", attributes: { role: "status" } });
  return { head: element("div", { class: "panel-head" }, element("h2", { text: title }), note, ...extra), note };
}

/**
 * Keep the children of a list up to date by their names, moving as few as possible, so that focus and scroll position
 * stay.
 *
 * @template T
 * @param {Element} list Has no other children.
 * @param {(name: string) => { item: Element, show: (value: T) => void }} create Makes a child.
 * @returns {(wanted: readonly (readonly [name: string, value: T])[]) => void} Shows these, in this order.
 */
export function keepRows(list, create) {
  /** @type {Map<string, { item: Element, show: (value: T) => void }>} */
  const rows = new Map();
  return (wanted) => {
    const kept = new Set(wanted.map(([name]) => name));
    for (const [name, { item }] of rows) {
      if (kept.has(name)) continue;
      item.remove();
      rows.delete(name);
    }
    wanted.forEach(([name, value], at) => {
      const row = rows.get(name) ?? create(name);
      rows.set(name, row);
      if (list.children[at] !== row.item) list.insertBefore(row.item, list.children[at] ?? null);
      row.show(value);
    });
  };
}
