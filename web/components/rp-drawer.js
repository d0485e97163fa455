// The drawer over the 3-D view, with the charts or the report. Queue, log and stop stay in view.

import { drawOn, signal } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setText } from "../js/views/dom.js";

/** @typedef {"charts"|"report"} SheetName */

/** The open sheet; empty if none. */
const drawer = signal(/** @type {SheetName|""} */ (""));

/**
 * A button that toggles a sheet.
 *
 * @param {SheetName} sheet
 * @param {string} words
 */
export function drawerButton(sheet, words) {
  const button = element("button", {
    class: "quiet opens",
    text: words,
    attributes: { "aria-controls": "drawer" },
    data: { opens: sheet },
    onclick: () => drawer.set(drawer.get() === sheet ? "" : sheet),
  });
  drawOn([drawer], () => button.setAttribute("aria-expanded", String(drawer.get() === sheet)));
  return button;
}

/** @typedef {HTMLElement & { tools: Node[], open: (open: boolean) => void }} Sheet */

/** Fetched when first opened. @type {Readonly<Record<string, () => Promise<Sheet>>>} */
const SHEETS = Object.freeze({
  charts: async () => new (await import("./rp-charts.js")).RpCharts(),
  report: async () => new (await import("./rp-report.js")).RpReport(),
});

class RpDrawer extends HTMLElement {
  constructor() {
    super();
    this.heading = element("h2", { id: "drawer-title" });
    this.tools = element("div", { class: "drawer-tools" });
    this.waiting = element("p", { class: "empty", attributes: { role: "status" } });
    /** @type {Map<string, Sheet>} */
    this.sheets = new Map();
    /** Gets the focus back. @type {Element|null} */
    this.opener = null;
  }

  connectedCallback() {
    this.id = "drawer";
    this.tabIndex = -1;
    this.setAttribute("role", "region");
    this.setAttribute("aria-labelledby", "drawer-title");
    const close = element("button", {
      id: "close-drawer",
      class: "quiet",
      text: text("drawer.close"),
      onclick: () => drawer.set(""),
    });
    this.append(element("div", { class: "panel-head" }, this.heading, this.tools, close), this.waiting);
    this.addEventListener("keydown", (event) => {
      if (event.key === "Escape") drawer.set("");
    });
    drawer.subscribe((name) => void this.show(name));
  }

  /** @param {string} name */
  async show(name) {
    const wasHidden = this.hidden;
    if (wasHidden && name) this.opener = document.activeElement;
    this.hidden = name === "";
    this.lay("");
    setText(this.heading, name && text(`${name}.title`));
    if (wasHidden && name) this.focus();
    if (!wasHidden && !name && this.opener instanceof HTMLElement) this.opener.focus();
    const load = SHEETS[name];
    if (!load) return;
    setText(this.waiting, text("drawer.loading"));
    try {
      const sheet = this.sheets.get(name) ?? (await load());
      if (!this.sheets.has(name)) this.append(sheet);
      this.sheets.set(name, sheet);
    } catch {
      setText(this.waiting, text("drawer.failed"));
    }
    // Another sheet may have been opened meanwhile.
    if (drawer.get() === name) this.lay(name);
  }

  /** Show this sheet only. @param {string} name */
  lay(name) {
    this.tools.replaceChildren(...(this.sheets.get(name)?.tools ?? []));
    for (const [each, sheet] of this.sheets) {
      sheet.hidden = each !== name;
      sheet.open(each === name);
    }
    this.waiting.hidden = this.sheets.has(name);
  }
}
customElements.define("rp-drawer", RpDrawer);
