// A button that opens a list: a press elsewhere, Escape or a choice closes it.

/**
 * @param {HTMLButtonElement} button
 * @param {HTMLElement} list With an id, beside the button.
 */
export function menu(button, list) {
  const show = (/** @type {boolean} */ open) => {
    list.hidden = !open;
    button.setAttribute("aria-expanded", String(open));
  };
  button.setAttribute("aria-controls", list.id);
  show(false);
  button.addEventListener("click", () => show(list.hidden === true));
  const around = button.parentElement;
  around?.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || list.hidden) return;
    show(false);
    button.focus();
  });
  window.addEventListener("pointerdown", (event) => {
    if (event.target instanceof Node && !around?.contains(event.target)) show(false);
  });
  // The 3-D view's presses do not reach this page, but take the focus.
  window.addEventListener("blur", () => show(false));
  return show;
}
