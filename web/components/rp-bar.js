// The bar at the bottom: the next step as one large button, rare commands under More, and what waits for a person.

import { countOf } from "../js/control/allowed.js";
import { COMMANDS, isCommand, surveyDistance, take, whyNotStep } from "../js/control/commands.js";
import { nextStep, waitingForPerson } from "../js/control/next-step.js";
import { closePreview, hasPreview, openPreview, previewOpen, whyNoPreview } from "../js/control/preview.js";
import { timeLeft } from "../js/control/progress.js";
import { stopProgress } from "../js/control/stop.js";
import { durationWords } from "../js/state/format.js";
import { link, now, pageState, points, preview, say } from "../js/state/page-state.js";
import { reasonText } from "../js/state/reasons.js";
import { screen } from "../js/state/screens.js";
import { drawOn } from "../js/state/signals.js";
import { counted, text } from "../js/state/texts.js";
import { dropDown, element, setAttribute, setEnabled, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";
import { menu } from "../js/views/menu.js";

/** @typedef {import("../js/control/commands.js").Step} Step */
/** @typedef {{ box: HTMLElement, button: HTMLButtonElement, label: HTMLElement, duration: HTMLElement }} StepButton */

/** @type {readonly Step[]} */
const STEPS = Object.freeze([...COMMANDS, "continue", "review", "preview", "approve", "reset"]);
/** The icon of each step; of another one, its own name. @type {Readonly<Partial<Record<Step, string>>>} */
const ICONS = Object.freeze({ Arm: "READY", Start: "AUTO", Resume: "AUTO", continue: "AUTO", Pause: "PAUSED", Acknowledge: "present", approve: "present", preview: "AUTO", reset: "present" });
/** Lengths of a survey (m). */
const DISTANCES = Object.freeze([1, 2, 4, 8, 15, 30, 60, 120]);

class RpBar extends HTMLElement {
  /** Each step has a button of its own, so that no press is taken for another one. @type {Map<Step, StepButton>} */
  steps = new Map();
  next = element("div", { class: "next" });
  more = element("div", { id: "more-menu", class: "menu" });
  none = element("p", { class: "hint", text: text("bar.nothing_more") });

  connectedCallback() {
    this.setAttribute("role", "region");
    this.setAttribute("aria-label", text("command.label"));
    for (const name of STEPS) this.add(name);
    this.steps.get("Survey")?.box.append(distanceChoice());
    // A key that is held on one step must not take the next one, too. For presses: bar.css.
    this.next.addEventListener("keydown", (event) => event.repeat && event.preventDefault());

    const why = element("p", { class: "next-why", attributes: { role: "status" } });
    const show = element("button", { id: "show-preview", text: text("preview.title") });
    show.addEventListener("click", () => (previewOpen.get() ? closePreview() : openPreview()));
    const open = element("button", { id: "more", text: text("bar.more") });
    const waiting = element("a", { id: "needs-you", class: "button", attributes: { href: "#review" } });
    this.more.append(this.none);
    this.append(this.next, why, show, element("div", { class: "more" }, open, this.more), waiting);
    const showMore = menu(open, this.more);
    this.more.addEventListener("click", (event) => {
      if (event.target instanceof Element && event.target.closest("button")) showMore(false);
    });
    previewOpen.subscribe((isOpen) => {
      if (isOpen) void fetchPreview();
    });

    drawOn([pageState, points, preview, previewOpen, screen, link, now, stopProgress], () => {
      this.draw();
      const step = nextStep();
      const refused = step && whyNotStep(step);
      setText(why, reasonText(refused || modeReason()));
      why.title = why.textContent ?? "";
      show.hidden = whyNoPreview() !== null && !hasPreview();
      show.setAttribute("aria-expanded", String(previewOpen.get()));
      const count = waitingForPerson();
      waiting.hidden = count === 0 || screen.get() === "review";
      setText(waiting, counted("bar.needs_you", count));
    });
  }

  /** @param {Step} name */
  add(name) {
    const label = element("span");
    const duration = element("span", { class: "duration" });
    const id = isCommand(name) ? name.toLowerCase() : `to-${name}`;
    const button = element("button", { id, onclick: () => void busyWhile(button, take(name)) }, icon(ICONS[name] ?? name), element("span", {}, label, duration));
    const box = element("div", { class: "step" }, button);
    this.steps.set(name, { box, button, label, duration });
    this.more.append(box);
  }

  /** Put the next step into the bar, and what else is possible under More. */
  draw() {
    const next = nextStep();
    const wanted = next ? this.steps.get(next) : undefined;
    const shown = this.next.firstElementChild;
    if (shown !== (wanted?.box ?? null)) {
      const focused = this.next.contains(document.activeElement);
      if (shown) this.more.prepend(shown);
      this.next.replaceChildren(...(wanted ? [wanted.box] : []));
      if (focused) wanted?.button.focus();
    }
    let left = 0;
    for (const [name, { box, button, label, duration }] of this.steps) {
      const why = whyNotStep(name);
      const isNext = name === next;
      setEnabled(button, why, isCommand(name) ? text(`command.${name}.hint`) : "");
      setText(label, isNext ? labelOf(name) : isCommand(name) ? text(`command.${name}`) : "");
      setText(duration, isNext && (name === "Start" || (name === "continue" && !surveying())) ? howLong() : "");
      button.classList.toggle("primary", isNext);
      box.hidden = !isNext && (!isCommand(name) || why !== null);
      left += Number(!isNext && !box.hidden);
    }
    this.none.hidden = left > 0;
  }
}

/**
 * Until the robot has answered, the button shows that it was pressed.
 *
 * @param {Element} button
 * @param {Promise<void>} taken
 */
async function busyWhile(button, taken) {
  setAttribute(button, "aria-busy", "true");
  await taken;
  setAttribute(button, "aria-busy", "");
}

async function fetchPreview() {
  try {
    await import("./rp-preview.js");
  } catch {
    previewOpen.set(false);
    say("error", text("preview.failed"));
  }
}

/** Label of a step on the large button. @param {Step} step */
function labelOf(step) {
  switch (step) {
    case "Start":
      return countOf("ACCEPTED") > 0 ? counted("bar.start", countOf("ACCEPTED")) : text("command.Start");
    case "continue":
      return surveying() ? text("bar.resume_survey") : counted("bar.resume", countOf("ACCEPTED"));
    case "review":
      return counted("bar.review", countOf("PROPOSED"));
    case "preview":
    case "approve":
    case "reset":
      return text(`bar.${step}`);
    default:
      return text(`command.${step}`);
  }
}

/** Why the robot is as it is; not what ended the work before, once there is more to cut. */
function modeReason() {
  const controller = pageState.get()?.controller;
  return controller?.mode === "READY" && countOf("ACCEPTED") > 0 ? null : controller?.reason;
}

/** Was a survey interrupted? */
function surveying() {
  return pageState.get()?.controller?.interrupted === "survey";
}

/** How long the accepted cuts take; empty where that is not known, or there is none. */
function howLong() {
  const seconds = countOf("ACCEPTED") > 0 ? timeLeft() : 0;
  // A line may end after the dot alone.
  return seconds ? `\u00a0· ${`~${durationWords(seconds)}`.replaceAll(" ", "\u00a0")}` : "";
}

function distanceChoice() {
  const attributes = { "aria-label": text("command.distance"), title: text("command.distance_hint") };
  const options = DISTANCES.map((metres) => /** @type {const} */ ([String(metres), `${metres} m`]));
  const select = dropDown({ id: "survey-distance", attributes }, options);
  select.value = String(surveyDistance.get());
  select.addEventListener("change", () => surveyDistance.set(Number(select.value)));
  return select;
}
customElements.define("rp-bar", RpBar);
