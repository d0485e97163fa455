// Tools of the labelling page: classes, brush, the network's proposal, undo.

import { CLASSES } from "../js/label/classes.js";
import { changeSize } from "../js/label/keys.js";
import {
  changes,
  labelsShown,
  listed,
  open,
  proposalShown,
  redo,
  SIZES,
  sizeStep,
  strength,
  takeProposal,
  takeRest,
  tool,
  undo,
} from "../js/label/session.js";
import { drawOn } from "../js/state/signals.js";
import { text } from "../js/state/texts.js";
import { element, setAttribute, setText } from "../js/views/dom.js";

class RpLabelTools extends HTMLElement {
  connectedCallback() {
    const tools = element("div", { class: "label-classes", attributes: { role: "group", "aria-label": text("label.classes") } });
    for (const each of CLASSES) tools.append(choice(each.name, text(`label.class.${each.name}`), each.key, each.colour));
    tools.append(choice("unlabelled", text("label.eraser"), "0", null), choice("proposal", text("label.proposal_brush"), "P", null));
    const size = element("input", {
      id: "label-size",
      attributes: { type: "range", min: "0", max: String(SIZES.length - 1), "aria-label": text("label.size") },
    });
    const pixels = element("output", { class: "number" });
    const smaller = small("−", text("label.smaller"), "[", () => changeSize(-1));
    const larger = small("+", text("label.larger"), "]", () => changeSize(1));
    const shown = toggle("label-proposal", text("label.show_proposal"), "␣", proposalShown);
    const own = toggle("label-own", text("label.show_labels"), "", labelsShown);
    const opacity = element("input", {
      id: "label-strength",
      attributes: { type: "range", min: "10", max: "100", "aria-label": text("label.strength") },
    });
    const model = element("p", { class: "hint label-model" });
    const take = wide("label-take", text("label.take"), "T", takeProposal);
    const rest = wide("label-rest", text("label.rest"), "R", takeRest);
    const back = wide("label-undo", text("label.undo"), "Z", undo);
    const again = wide("label-redo", text("label.redo"), "Y", redo);
    this.append(
      element("h2", { text: text("label.classes") }),
      tools,
      element("h2", { text: text("label.size") }),
      element("div", { class: "label-row" }, smaller, size, larger, pixels),
      element("div", { class: "label-pair" }, back, again),
      element("h2", { text: text("label.proposal") }),
      model,
      shown,
      take,
      rest,
      element("h2", { text: text("label.view") }),
      own,
      element("label", { class: "label-row" }, element("span", { text: text("label.strength") }), opacity),
    );

    size.addEventListener("input", () => sizeStep.set(Number(size.value)));
    opacity.addEventListener("input", () => strength.set(Number(opacity.value) / 100));
    drawOn([tool], () => {
      for (const each of tools.children) {
        const chosen = each instanceof HTMLElement && each.dataset.tool === tool.get();
        each.setAttribute("aria-pressed", String(chosen));
      }
    });
    drawOn([sizeStep], () => {
      size.value = String(sizeStep.get());
      setText(pixels, text("label.pixels", { count: SIZES[sizeStep.get()] ?? 1 }));
    });
    drawOn([strength], () => {
      opacity.value = String(Math.round(100 * strength.get()));
    });
    drawOn([open, changes, listed], () => {
      const now = open.get();
      setAttribute(take, "aria-disabled", String(!now?.proposal));
      setAttribute(rest, "aria-disabled", String(!now));
      setAttribute(back, "aria-disabled", String(!now?.mask.done.length));
      setAttribute(again, "aria-disabled", String(!now?.mask.undone.length));
      const title = listed.get()?.model ?? "";
      setText(model, !now || now.proposal ? text("label.model", { model: title }) : text("label.model_waits"));
    });
  }
}

/**
 * @param {string} name
 * @param {string} words
 * @param {string} key
 * @param {readonly number[]|null} colour
 */
function choice(name, words, key, colour) {
  const swatch = element("span", { class: "label-swatch" });
  if (colour) swatch.style.background = `rgb(${colour.join(" ")})`;
  const button = element(
    "button",
    { data: { tool: name }, onclick: () => tool.set(name) },
    swatch,
    element("span", { class: "label-word", text: words }),
  );
  if (key) button.append(element("kbd", { text: key }));
  return button;
}

/**
 * @param {string} sign
 * @param {string} words
 * @param {string} key
 * @param {() => void} act
 */
function small(sign, words, key, act) {
  return element("button", { text: sign, attributes: { "aria-label": words, title: `${words} (${key})` }, onclick: act });
}

/**
 * @param {string} id
 * @param {string} words
 * @param {string} key
 * @param {() => void} act
 */
function wide(id, words, key, act) {
  return element("button", { id, class: "label-wide", onclick: act }, element("span", { text: words }), element("kbd", { text: key }));
}

/**
 * @param {string} id
 * @param {string} words
 * @param {string} key
 * @param {import("../js/state/signals.js").Signal<boolean>} shown
 */
function toggle(id, words, key, shown) {
  const box = element("input", { id, attributes: { type: "checkbox" } });
  box.addEventListener("change", () => shown.set(box.checked));
  drawOn([shown], () => {
    box.checked = shown.get();
  });
  const line = element("label", { class: "label-toggle" }, box, element("span", { text: words }));
  if (key) line.append(element("kbd", { text: key }));
  return line;
}
customElements.define("rp-label-tools", RpLabelTools);
