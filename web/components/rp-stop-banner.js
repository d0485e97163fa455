// Banner after a stop: who pressed it, which processes have latched it, and Reset with a reason.

import { whyNot } from "../js/control/allowed.js";
import { earlierWords, hardwareStopPressed, sinceWords, stopProgress } from "../js/control/stop.js";
import { ask } from "../js/link/api.js";
import { TEXT_MAX_LENGTH } from "../js/link/messages.js";
import { isLive, link, now, pageState, staleWords } from "../js/state/page-state.js";
import { reason, reasonText, sentence } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { alarms } from "../js/views/alarms.js";
import { element, setEnabled, setText } from "../js/views/dom.js";
import { icon, setIcon } from "../js/views/icons.js";

class RpStopBanner extends HTMLElement {
  connectedCallback() {
    this.hidden = true;
    const title = element("h2");
    const who = element("p", { class: "who" });
    const earlier = element("p", { class: "hint earlier" });
    const bridge = acknowledgement("bridge");
    const controller = acknowledgement("controller");
    const words = element("input", {
      id: "reset-reason",
      attributes: {
        type: "text",
        maxlength: String(TEXT_MAX_LENGTH),
        placeholder: text("stop.why_safe"),
        "aria-label": text("stop.reset_reason"),
        autocomplete: "off",
      },
    });
    const reset = element("button", { id: "reset", text: text("stop.reset"), attributes: { type: "submit" } });
    const form = element("form", {}, words, reset);
    const hint = element("p", { class: "hint", text: text("stop.reset_moves_nothing") });
    const act = element("p", { class: "act" });
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      // With the id of the stop shown: a newer one must not be reset unseen.
      const body = { reason: words.value.trim(), stop_id: pageState.get()?.bridge?.stop_id ?? "" };
      if (await ask(text("stop.reset"), "api/reset", body)) words.value = "";
    });
    this.append(
      element("div", { class: "banner-head" }, icon("ESTOP_LATCHED"), title, who),
      element("ul", { class: "acknowledgements" }, bridge.row, controller.row),
      earlier,
      act,
      form,
      hint,
    );
    const draw = () => {
      const state = pageState.get();
      const byBridge = (state?.bridge?.stop_id ?? "") !== "";
      const byController = state?.controller?.mode === "ESTOP_LATCHED";
      const asked = stopProgress.get() === "sending" || stopProgress.get() === "sent";
      const shown = byBridge || byController || asked;
      if (this.hidden !== !shown) {
        this.hidden = !shown;
        this.setAttribute("role", shown ? "alert" : "none");
      }
      if (!shown) return;
      // Without a link no reset is possible, and two banners leave little of the view. A viewer never resets.
      form.hidden = hint.hidden = link.get().status !== "open" || state?.role === "viewer";
      const told = state?.bridge?.stopped_by ?? (byController ? state?.controller?.reason : null);
      // The reason names the kind of stop.
      setText(title, text(told ? "mode.ESTOP_LATCHED" : "stop.idle"));
      setText(who, told ? reasonText(told) : text("stop.pressed_here"));
      const newest = state?.bridge?.stop_id ?? "";
      bridge.show(byBridge, sinceWords(state, "bridge", newest));
      controller.show(byController, sinceWords(state, "controller", newest));
      const before = earlierWords(state);
      earlier.hidden = before === "";
      setText(earlier, before);
      const steps = alarms().find((alarm) => alarm.reason.code === "mode_stopped")?.steps ?? [];
      setText(act, steps.map((step) => sentence(reasonText(step))).join(" "));
      act.dataset.steps = steps.map((step) => step.code).join(" ");
      const pressed = hardwareStopPressed(state) ? reason("emergency_stop_pressed") : null;
      const why = pressed ?? whyNot("Reset") ?? (words.value.trim() === "" ? reason("reset_unexplained") : null);
      setEnabled(reset, why, text("stop.reset_hint"));
    };
    words.addEventListener("input", draw);
    drawOn([pageState, link, now, stopProgress], draw);
    // The robot's own state takes over from "sent".
    pageState.subscribe((state) => {
      const latched = state?.controller?.mode === "ESTOP_LATCHED" || (state?.bridge?.stop_id ?? "") !== "";
      if (latched && stopProgress.get() !== "idle") stopProgress.set("idle");
    });
  }
}

/** @param {"bridge"|"controller"} process */
function acknowledgement(process) {
  const shape = element("span", { class: "shape" });
  const words = element("span");
  const row = element("li", { data: { acknowledged: "false", by: process } }, shape, words);
  return {
    row,
    /**
     * @param {boolean} latched
     * @param {string} since
     */
    show(latched, since) {
      row.dataset.acknowledged = String(latched);
      setIcon(shape, latched ? "present" : "warning");
      const old = isLive(process) ? "" : ` (${staleWords(process)})`;
      const name = text(`process.${process}`);
      const told = latched ? text("stop.latched", { process: name, since }) : text("stop.unconfirmed", { process: name });
      setText(words, told + old);
    },
  };
}
customElements.define("rp-stop-banner", RpStopBanner);
