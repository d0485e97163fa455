// A supervisor creates a single-use sign-in link for another person or a script.

import { post } from "../js/link/api.js";
import { link as serverLink, pageState } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { labelOf, text } from "../js/state/texts.js";
import { dropDown, element, setText, svg } from "../js/views/dom.js";

/** @type {readonly import("../js/link/messages.js").Role[]} */
const ROLES = Object.freeze(["viewer", "operator", "supervisor"]);

/** White around a QR code, without which cameras do not find it (modules). */
const QUIET = 4;
/** Hosts that are each machine's name for itself. */
const LOCAL = Object.freeze(["localhost", "127.0.0.1", "[::1]"]);

class RpInvite extends HTMLElement {
  connectedCallback() {
    this.hidden = true;
    const toggle = element("button", {
      id: "invite",
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
    const role = dropDown({ id: "invite-role" }, ROLES.map((each) => [each, labelOf(each)]));
    const may = element("p", { class: "hint", attributes: { role: "status" } });
    const tell = () => setText(may, text(`invite.role.${role.value}`));
    role.addEventListener("change", tell);
    tell();
    const words = element("p", { class: "hint", attributes: { role: "status" } });
    const link = element("input", {
      id: "invite-link",
      attributes: { type: "text", readonly: "", "aria-label": text("invite.link") },
    });
    const copy = element("button", { id: "invite-copy", text: text("invite.copy") });
    const code = element("div", { class: "invite-code" });
    const made = element("div", { class: "invite-made" }, code, link, copy);
    const form = element(
      "form",
      { id: "invitation", class: "invitation" },
      element("label", { text: text("sign_in.name"), attributes: { for: "invite-user" } }),
      user,
      element("label", { text: text("invite.role"), attributes: { for: "invite-role" } }),
      role,
      may,
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
      code.replaceChildren();
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
      link.value = answer.link;
      made.hidden = false;
      const name = user.value.trim();
      const local = LOCAL.includes(location.hostname) ? ` ${text("invite.local")}` : "";
      setText(words, text("invite.made", { user: name, role: labelOf(role.value) }) + local);
      code.replaceChildren(qrCode(answer.qr ?? [], text("invite.qr", { user: name })));
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
      const invites = pageState.get()?.role === "supervisor" && serverLink.get().status === "open";
      if (this.hidden === invites) this.hidden = !invites;
      if (!invites && !form.hidden) show(false);
    });
  }
}
/**
 * @param {readonly string[]} rows 1 is dark.
 * @param {string} label
 */
function qrCode(rows, label) {
  const side = rows.length + 2 * QUIET;
  const dark = rows.flatMap((row, y) => [...row].map((module, x) => (module === "1" ? `M${x + QUIET} ${y + QUIET}h1v1h-1z` : "")));
  const attributes = { class: "qr", viewBox: `0 0 ${side} ${side}`, role: "img", "aria-label": label };
  return svg("svg", attributes, svg("path", { d: dark.join("") }));
}
customElements.define("rp-invite", RpInvite);
