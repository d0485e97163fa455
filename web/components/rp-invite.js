// A supervisor creates a single-use sign-in link for another person or a script.

import { post } from "../js/link/api.js";
import { link as serverLink, pageState } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { dropDown, element, setText } from "../js/views/dom.js";

/** @type {readonly (readonly [role: import("../js/link/messages.js").Role, words: string])[]} */
const ROLES = Object.freeze([
  ["viewer", "viewer: looks, and may stop the robot"],
  ["operator", "operator: moves the robot"],
  ["supervisor", "supervisor: also resets a stop, and invites"],
]);

class RpInvite extends HTMLElement {
  connectedCallback() {
    this.hidden = true;
    const toggle = element("button", {
      id: "invite",
      class: "quiet",
      text: "Invite",
      attributes: { "aria-expanded": "false", "aria-controls": "invitation" },
    });
    const user = element("input", {
      id: "invite-user",
      attributes: {
        type: "text",
        required: "",
        maxlength: "40",
        pattern: "[A-Za-z0-9_.\\- ]+",
        value: "guest",
        autocomplete: "off",
      },
    });
    const role = dropDown({ id: "invite-role" }, ROLES);
    const words = element("p", { class: "hint", attributes: { role: "status" } });
    const link = element("input", {
      id: "invite-link",
      attributes: { type: "text", readonly: "", "aria-label": "Sign-in link" },
    });
    const copy = element("button", { id: "invite-copy", text: "Copy" });
    const made = element("div", { class: "invite-made" }, link, copy);
    const form = element(
      "form",
      { id: "invitation", class: "invitation" },
      element("label", { text: "Name", attributes: { for: "invite-user" } }),
      user,
      element("label", { text: "Role", attributes: { for: "invite-role" } }),
      role,
      element("button", { id: "invite-make", class: "primary", text: "Make a link", attributes: { type: "submit" } }),
      words,
      made,
    );
    this.append(toggle, form);

    const show = (/** @type {boolean} */ open) => {
      form.hidden = !open;
      toggle.setAttribute("aria-expanded", String(open));
      // A link must not stay on the screen.
      link.value = "";
      made.hidden = true;
      setText(words, "A person or a script signs in with it once, within ten minutes.");
    };
    show(false);
    toggle.addEventListener("click", () => {
      show(form.hidden);
      if (!form.hidden) user.focus();
    });
    this.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || form.hidden) return;
      show(false);
      toggle.focus();
    });
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      const answer = await post("api/invite", { user: user.value.trim(), role: role.value });
      if (!answer.ok || !answer.link) {
        setText(words, `No link was made: ${answer.reason}`);
        return;
      }
      // The server knows its local address; this page knows the one in use.
      const path = new URL(answer.link);
      link.value = `${location.origin}${path.pathname}${path.search}`;
      made.hidden = false;
      setText(words, `For ${user.value.trim()}, ${role.value}: signs in once, within ten minutes.`);
      link.select();
    });
    copy.addEventListener("click", async () => {
      link.select();
      try {
        await navigator.clipboard.writeText(link.value);
        setText(words, "Copied.");
      } catch {
        setText(words, "The browser does not let a page copy here: press Ctrl+C.");
      }
    });
    drawOn([pageState, serverLink], () => {
      const may = pageState.get()?.role === "supervisor" && serverLink.get().status === "open";
      if (this.hidden === may) this.hidden = !may;
      if (!may && !form.hidden) show(false);
    });
  }
}
customElements.define("rp-invite", RpInvite);
