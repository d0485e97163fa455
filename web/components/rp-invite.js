// A supervisor creates a single-use sign-in link for another person or a script.

import { post } from "../js/link/api.js";
import { link as serverLink, pageState } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { labelOf, text } from "../js/state/texts.js";
import { dropDown, element, setText } from "../js/views/dom.js";

/** @type {readonly import("../js/link/messages.js").Role[]} */
const ROLES = Object.freeze(["viewer", "operator", "supervisor"]);

class RpInvite extends HTMLElement {
  connectedCallback() {
    this.hidden = true;
    const toggle = element("button", {
      id: "invite",
      class: "quiet",
      text: text("invite.open"),
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
    const role = dropDown({ id: "invite-role" }, ROLES.map((each) => [each, text(`invite.role.${each}`)]));
    const words = element("p", { class: "hint", attributes: { role: "status" } });
    const link = element("input", {
      id: "invite-link",
      attributes: { type: "text", readonly: "", "aria-label": text("invite.link") },
    });
    const copy = element("button", { id: "invite-copy", text: text("invite.copy") });
    const made = element("div", { class: "invite-made" }, link, copy);
    const form = element(
      "form",
      { id: "invitation", class: "invitation" },
      element("label", { text: text("sign_in.name"), attributes: { for: "invite-user" } }),
      user,
      element("label", { text: text("invite.role"), attributes: { for: "invite-role" } }),
      role,
      element("button", { id: "invite-make", class: "primary", text: text("invite.make"), attributes: { type: "submit" } }),
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
      setText(words, text("invite.how"));
    };
    show(false);
    toggle.addEventListener("click", () => {
      show(form.hidden);
      if (!form.hidden) user.focus();
    });
    this.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || form.hidden) return;
      event.stopPropagation();
      show(false);
      toggle.focus();
    });
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      const answer = await post("api/invite", { user: user.value.trim(), role: role.value });
      if (!answer.ok || !answer.link) {
        setText(words, text("invite.refused", { why: reasonText(answer.why) }));
        return;
      }
      // The server knows its local address; this page knows the one in use.
      const path = new URL(answer.link);
      link.value = `${location.origin}${path.pathname}${path.search}`;
      made.hidden = false;
      setText(words, text("invite.made", { user: user.value.trim(), role: labelOf(role.value) }));
      link.select();
    });
    copy.addEventListener("click", async () => {
      link.select();
      try {
        await navigator.clipboard.writeText(link.value);
        setText(words, text("invite.copied"));
      } catch {
        setText(words, text("invite.copy_by_hand"));
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
