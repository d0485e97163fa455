// Who holds control, and asking for, granting and taking it. Hidden while nobody else is there. That it is the person at
// this page is said for a moment; later the menu with their name says it.

import { holder } from "../js/control/lease.js";
import { ask } from "../js/link/api.js";
import { now, pageState, showToast } from "../js/state/page-state.js";
import { reason, reasonText } from "../js/state/reasons.js";
import { hasView, screen } from "../js/state/screens.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setEnabled, setText } from "../js/views/dom.js";

/** A second press within this time confirms taking control from another person (ms). */
const CONFIRM_MS = 4000;
/** For this time it is said that nothing is to be done (ms). */
const SAID_MS = 6000;

class RpLease extends HTMLElement {
  give = button("grant-control", () => void ask(text("control.granting"), "api/control/grant"));
  request = button("request-control", () => void ask(text("control.asking"), "api/control/request"));
  take = button("take-control", () => this.confirmTake());
  /** End of that time (ms). */
  armed = 0;
  /** @type {number | null} */
  told = null;
  mine = false;
  /** When these words came (ms). */
  saidAt = 0;

  connectedCallback() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", text("control.label"));
    const words = element("span", { class: "control-words", attributes: { role: "status" } });
    this.append(words, element("div", { class: "lease-buttons" }, this.give, this.request, this.take));
    drawOn([pageState, screen, now], () => this.draw(words));
  }

  /** @param {HTMLElement} words */
  draw(words) {
    const state = pageState.get();
    const control = state?.control ?? null;
    const operates = state !== null && state.role !== "viewer";
    const { held, mine, user } = holder();
    const asked = control?.requested_by ?? "";
    const mineAsked = asked !== "" && control?.requested_key === state?.client;
    const coming = control?.next_user ?? "";
    const who = mine ? text("control.yours") : held ? text("control.theirs", { user }) : text("control.nobody");
    const waiting = mine && asked ? text("control.asked", { user: asked }) : who;
    const told = coming ? text("control.goes", { user: coming }) : waiting;
    if (told !== words.textContent) this.saidAt = performance.now();
    setText(words, told);
    words.title = words.textContent ?? "";
    this.give.hidden = !(mine && asked !== "" && !coming);
    setText(this.give, text("control.give", { user: asked }));
    this.give.title = text("control.give_hint", { user: asked });
    this.request.hidden = !(operates && held && !mine && !coming);
    setText(this.request, text(mineAsked ? "control.asked_already" : "control.ask"));
    const theirs = asked ? reason("control_requested", { user: asked }) : null;
    const waits = mineAsked ? reason("control_asked_by_you", { user }) : theirs;
    setEnabled(this.request, waits, text("control.ask_hint", { user }));
    this.take.hidden = !operates || mine || coming !== "";
    const sure = performance.now() < this.armed;
    setText(this.take, text(!held ? "control.take_free" : sure ? "control.take_sure" : "control.take"));
    this.take.title = held ? text("control.take_hint", { user }) : "";
    const alone = control === null || !((held && !mine) || asked || coming || (state?.viewers ?? 0) > 1);
    const idle = this.give.hidden && this.request.hidden && this.take.hidden;
    const known = mine && !coming && performance.now() - this.saidAt > SAID_MS;
    this.hidden = alone || (idle && (known || !hasView(screen.get())));
    this.announceLoss(mine, control?.notice_number ?? 0, reasonText(control?.notice));
  }

  /** Taking control from another person needs a second press. */
  confirmTake() {
    const { held } = holder();
    if (held && performance.now() >= this.armed) {
      this.armed = performance.now() + CONFIRM_MS;
      setText(this.take, text("control.take_sure"));
      return;
    }
    this.armed = 0;
    void ask(text("control.taking"), "api/control/take", { confirm: held });
  }

  /**
   * Notify a person who has lost control.
   *
   * @param {boolean} mine
   * @param {number} number
   * @param {string} told
   */
  announceLoss(mine, number, told) {
    if (this.told !== null && number !== this.told && this.mine && !mine)
      showToast("warning", text("control.lost", { why: told }));
    this.told = number;
    this.mine = mine;
  }
}

/**
 * @param {string} id
 * @param {() => void} press
 */
function button(id, press) {
  return element("button", { id, onclick: press });
}

customElements.define("rp-lease", RpLease);
