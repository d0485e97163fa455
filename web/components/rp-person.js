// Who is signed in, and behind that name: inviting somebody, settings, help, and signing out.

import { holder } from "../js/control/lease.js";
import { post } from "../js/link/api.js";
import { pageState, say } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { counted, labelOf, text } from "../js/state/texts.js";
import { element, setAttribute, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";
import { menu } from "../js/views/menu.js";
import { fetched, openHelp, openSettings } from "../js/views/sheets.js";

class RpPerson extends HTMLElement {
  connectedCallback() {
    const name = element("span", { class: "user-name" });
    const open = element("button", { id: "person", class: "quiet" }, icon("person"), name);
    const role = element("p", { class: "user-role" });
    const leave = element("button", { id: "sign-out", text: text("person.leave"), onclick: () => void signOut() });
    const settings = element("button", { id: "open-settings", text: text("settings.title") });
    const help = element("button", { id: "open-help", text: text("help.title"), attributes: { "aria-keyshortcuts": "?" } });
    const invite = document.createElement("rp-invite");
    const list = element("div", { id: "person-menu", class: "menu" }, role, invite, settings, help, leave);
    this.append(open, list);
    const show = menu(open, list);
    open.addEventListener("click", () => void fetched(import("./rp-invite.js"), () => {}));
    for (const [button, opens] of /** @type {const} */ ([[settings, openSettings], [help, openHelp]])) {
      button.addEventListener("click", () => {
        show(false);
        open.focus();
        void opens();
      });
    }
    drawOn([pageState], () => {
      const state = pageState.get();
      setText(name, state?.user ?? "");
      setAttribute(open, "aria-label", text("person.open", { user: state?.user ?? "" }));
      const pages = state && counted("person.pages", state.viewers);
      const control = holder().mine ? ` · ${text("control.yours")}` : "";
      setText(role, state ? `${state.user} · ${labelOf(state.role)} · ${pages}${control}` : "");
    });
  }
}

async function signOut() {
  const answer = await post("api/sign-out");
  if (answer.ok) location.replace("/");
  else say("error", text("refused", { what: text("person.leave"), why: reasonText(answer.why) }));
}
customElements.define("rp-person", RpPerson);
