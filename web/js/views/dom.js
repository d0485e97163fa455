// Building the page's elements without markup in strings, so that no text can become markup.

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
  if (traits.text !== undefined) node.textContent = traits.text;
  for (const [name, value] of Object.entries(traits.data ?? {})) node.dataset[name] = value;
  for (const [name, value] of Object.entries(traits.attributes ?? {})) node.setAttribute(name, value);
  if (traits.onclick) node.addEventListener("click", /** @type {EventListener} */ (traits.onclick));
  node.append(...children);
  return node;
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
 * Change the text only when it differs, so that selections and screen readers are not disturbed.
 *
 * @param {Element} node
 * @param {string} text
 */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/**
 * Enable a control, or grey it and say why. Not the `disabled` attribute: a control that has it swallows the press and
 * takes no focus, so that neither a finger nor a keyboard would learn the reason (`disabled-reasons.js`).
 *
 * @param {HTMLButtonElement|HTMLInputElement} button
 * @param {string} why Empty when it may be pressed.
 * @param {string} [hint] What it does, shown while it may be pressed.
 */
export function setEnabled(button, why, hint = "") {
  const words = why || hint;
  setAttribute(button, "aria-disabled", String(why !== ""));
  setAttribute(button, "title", words);
  setAttribute(button, "aria-description", words);
}

/**
 * Change an attribute only when it differs: states come twenty times a second, and each change is work for the browser.
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
 * A heading bar of a panel, with a place for the note that its content is old.
 *
 * @param {string} title
 * @param {...Node} extra
 */
export function panelHead(title, ...extra) {
  const note = element("span", { class: "stale-note", attributes: { role: "status" } });
  return { head: element("div", { class: "panel-head" }, element("h2", { text: title }), note, ...extra), note };
}
