// The 3-D view in an iframe of the same origin. Its key and pointer events are observed, since they do not reach this
// page.

import { listenForDriveKeys } from "../js/control/driving.js";
import { listenForSpace } from "../js/control/stop.js";
import { listenForDrag, listenForHoldKey } from "../js/control/teleoperation.js";
import { listenForViewKeys } from "../js/control/view-tools.js";
import { link } from "../js/state/page-state.js";
import { text } from "../js/state/texts.js";
import { element } from "../js/views/dom.js";

/** Below this width (px) the 3-D client puts its own panel over the view. */
const LEAST_WIDTH = 600;
/** After this time without a picture the probable cause is shown (ms). */
const LOAD_TIMEOUT_MS = 20_000;

class RpScene extends HTMLElement {
  connectedCallback() {
    const words = element("p", { text: text("scene.loading") });
    const retry = element("button", { text: text("scene.again") });
    retry.hidden = true;
    const frame = element("iframe", { attributes: { title: text("scene.label"), tabindex: "0" } });
    const waiting = element("div", { class: "empty", attributes: { role: "status" } }, words, retry);
    this.append(waiting, frame);

    let timeout = 0;
    /** @param {string} why */
    const fail = (why) => {
      words.textContent = why;
      retry.hidden = false;
    };
    const load = () => {
      words.textContent = text("scene.loading");
      retry.hidden = true;
      waiting.hidden = false;
      window.clearTimeout(timeout);
      timeout = window.setTimeout(
        () => fail(text("scene.late")),
        LOAD_TIMEOUT_MS,
      );
      frame.classList.remove("loaded");
      frame.src = "viser/";
    };
    frame.addEventListener("load", () => {
      const view = frame.contentWindow;
      if (!view || !frame.getAttribute("src")) return;
      const there = frame.contentDocument?.querySelector("#root, canvas") ?? null;
      if (there === null) {
        window.clearTimeout(timeout);
        fail(text("scene.failed"));
        return;
      }
      listenForSpace(view);
      listenForHoldKey(view);
      listenForDriveKeys(view);
      listenForViewKeys(view);
      listenForDrag(view);
      frame.classList.add("loaded");
      const root = view.document.documentElement;
      // frame.js did not load: nothing will report the first drawing.
      if (!root.dataset.view) root.dataset.view = "untold";
      const look = () => {
        if (root.dataset.view === "loading") return;
        window.clearTimeout(timeout);
        waiting.hidden = true;
      };
      new MutationObserver(look).observe(root, { attributeFilter: ["data-view"] });
      look();
    });
    retry.addEventListener("click", load);
    // In less space the view is laid out at LEAST_WIDTH and scaled down.
    new ResizeObserver(() => {
      const shrink = Math.min(1, Math.max(0.2, this.clientWidth / LEAST_WIDTH));
      frame.style.setProperty("width", `${100 / shrink}%`);
      frame.style.setProperty("height", `${100 / shrink}%`);
      frame.style.setProperty("transform", `scale(${shrink})`);
    }).observe(this);
    // The 3-D client reconnects only while focused, so each new link of the page reloads it.
    let open = false;
    const follow = () => {
      const isOpen = link.get().status === "open";
      if (isOpen && !open) load();
      open = isOpen;
    };
    link.subscribe(follow);
    follow();
  }
}
customElements.define("rp-scene", RpScene);
