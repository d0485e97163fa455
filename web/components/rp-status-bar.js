// The status bar: processes, quality of the link, the person signed in.

import { post } from "../js/link/api.js";
import { PROCESSES } from "../js/link/messages.js";
import { ageWords } from "../js/state/format.js";
import {
  isLive,
  isOpening,
  link,
  now,
  pageState,
  processAge,
  roundTrip,
  say,
  stateAge,
} from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { counted, labelOf, text } from "../js/state/texts.js";
import { element, setText } from "../js/views/dom.js";
import { icon, setIcon } from "../js/views/icons.js";

class RpStatusBar extends HTMLElement {
  connectedCallback() {
    this.append(
      element(
        "h1",
        { class: "product" },
        element("img", { attributes: { src: "icon.svg", alt: "" } }),
        element("span", { class: "product-name", text: "Rolling Panda" }),
      ),
      document.createElement("rp-lease"),
      this.presence(),
      this.linkChip(),
      this.person(),
    );
  }

  presence() {
    const box = element("div", { class: "presences", attributes: { role: "group", "aria-label": text("presence.label") } });
    for (const process of PROCESSES) {
      const name = text(`process.${process}`);
      const shape = element("span", { class: "shape" });
      const age = element("span", { class: "age" });
      const chip = element(
        "span",
        { class: "presence", data: { process, present: "false" } },
        shape,
        element("span", { class: "process-name", text: name }),
        age,
      );
      box.append(chip);
      drawOn([pageState, link, now], () => {
        const live = isLive(process);
        // A silent server says nothing about the others.
        const unknown = process === "server" ? isOpening() : !isLive("server");
        const seconds = processAge(process);
        const since = seconds === null ? text("presence.unseen") : text("presence.gone", { age: ageWords(seconds) });
        chip.dataset.present = unknown ? "unknown" : String(live);
        setIcon(shape, unknown ? "UNKNOWN" : live ? "present" : "gone");
        setText(age, live || unknown ? "" : since);
        chip.title = unknown
          ? text(isOpening() ? "presence.not_heard" : "presence.unknown", { process: name })
          : live
            ? text("presence.there", { process: name })
            : text("presence.told", { process: name, words: since });
      });
    }
    return box;
  }

  linkChip() {
    const words = element("span", { class: "number" });
    const chip = element("span", { id: "link", class: "link" }, icon("link"), words);
    drawOn([roundTrip, now, link, pageState], () => {
      const age = stateAge();
      const trip = roundTrip.get();
      const open = link.get().status === "open";
      const opening = isOpening();
      chip.dataset.quality = opening
        ? ""
        : !open || age === null || age > 1
          ? "bad"
          : (trip ?? 0) > 200 || age > 0.5
            ? "poor"
            : "good";
      setText(
        words,
        open && trip !== null ? `${trip.toFixed(0)} ms · ${ageWords(age ?? 0)}` : text(opening ? "link.connecting" : "link.none"),
      );
      chip.title = text("link.hint");
    });
    return chip;
  }

  person() {
    const name = element("span", { class: "user-name" });
    const role = element("span", { class: "user-role" });
    const leave = element("button", { id: "sign-out", class: "quiet", text: text("person.leave") });
    leave.addEventListener("click", async () => {
      const answer = await post("api/sign-out");
      if (answer.ok) location.replace("/");
      else say("error", text("refused", { what: text("person.leave"), why: reasonText(answer.why) }));
    });
    drawOn([pageState], () => {
      const state = pageState.get();
      setText(name, state?.user ?? "");
      setText(role, state && state.role !== state.user ? `· ${labelOf(state.role)}` : "");
      name.title = state ? counted("person.pages", state.viewers) : "";
    });
    return element("div", { class: "person" }, name, role, document.createElement("rp-invite"), leave);
  }
}
customElements.define("rp-status-bar", RpStatusBar);
