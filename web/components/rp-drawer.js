// A sheet over the view, with a way back: the queue, the log and the stop stay where they are.

import { drawer } from "../drawer.js";
import { element, setText } from "../element.js";
import { drawOn } from "../store.js";
import { RpCharts } from "./rp-charts.js";

/** @type {Readonly<Record<string, string>>} */
const TITLES = Object.freeze({ charts: "The last five minutes" });

class RpDrawer extends HTMLElement {
  connectedCallback() {
    this.id = "drawer";
    this.tabIndex = -1;
    this.setAttribute("role", "region");
    const title = element("h2", { id: "drawer-title" });
    this.setAttribute("aria-labelledby", "drawer-title");
    const tools = element("div", { class: "drawer-tools" });
    const close = element("button", {
      id: "close-drawer",
      class: "quiet",
      text: "Close",
      attributes: { type: "button" },
      onclick: () => drawer.set(""),
    });
    this.append(element("div", { class: "panel-head" }, title, tools, close));
    /** @type {Record<string, HTMLElement & { tools: Node[], open: (open: boolean) => void }>} */
    const sheets = { charts: new RpCharts() };
    this.append(...Object.values(sheets));
    let opener = /** @type {Element|null} */ (null);
    drawOn([drawer], () => {
      const name = drawer.get();
      const wasHidden = this.hidden;
      if (wasHidden && name) opener = document.activeElement;
      this.hidden = name === "";
      for (const [each, sheet] of Object.entries(sheets)) {
        sheet.hidden = each !== name;
        sheet.open(each === name);
      }
      setText(title, TITLES[name] ?? "");
      tools.replaceChildren(...(sheets[name]?.tools ?? []));
      if (wasHidden && name) this.focus();
      if (!wasHidden && !name && opener instanceof HTMLElement) opener.focus();
    });
    this.addEventListener("keydown", (event) => {
      if (event.key === "Escape") drawer.set("");
    });
  }
}
customElements.define("rp-drawer", RpDrawer);
