// Over the 3-D view: camera presets, layers, measuring; and the hint while clicks place points.

import { whyNothing } from "../js/control/allowed.js";
import { placing, setPlacing } from "../js/control/placing.js";
import {
  LAYERS,
  PRESETS,
  large,
  layers,
  measured,
  measuring,
  placeCamera,
  setMeasuring,
  showLayer,
} from "../js/control/view-tools.js";
import { decimal } from "../js/state/format.js";
import { link, now, pageState } from "../js/state/page-state.js";
import { reason } from "../js/state/reasons.js";
import { drawOn } from "../js/state/signals.js";
import { labelOf, text } from "../js/state/texts.js";
import { element, setEnabled, setText } from "../js/views/dom.js";
import { icon } from "../js/views/icons.js";
import { menu } from "../js/views/menu.js";

/** Camera and 3-D view change places by a press of the smaller one. */
class RpSwap extends HTMLElement {
  connectedCallback() {
    const button = element("button", { id: "swap", onclick: () => large.set(large.get() === "scene" ? "camera" : "scene") }, icon("swap"));
    this.append(button);
    drawOn([large], () => {
      if (this.parentElement) this.parentElement.dataset.large = large.get();
      const words = text(large.get() === "scene" ? "stage.camera_large" : "stage.scene_large");
      button.title = words;
      button.setAttribute("aria-label", words);
    });
  }
}
customElements.define("rp-swap", RpSwap);

class RpPlacing extends HTMLElement {
  connectedCallback() {
    const done = element("button", { id: "placing-done", text: text("placing.done"), attributes: { "aria-keyshortcuts": "Escape" } });
    done.addEventListener("click", () => setPlacing(false));
    this.append(
      element("p", {
        text: text("placing.how"),
        attributes: { role: "status" },
      }),
      done,
    );
    drawOn([placing], () => {
      this.hidden = !placing.get();
      document.body.classList.toggle("placing", placing.get());
    });
  }
}
customElements.define("rp-placing", RpPlacing);

class RpViewTools extends HTMLElement {
  connectedCallback() {
    const presets = PRESETS.map((preset, index) => {
      const key = String(index + 1);
      const traits = { text: text(`preset.${preset}`), data: { preset }, attributes: { "aria-keyshortcuts": key } };
      const button = element("button", traits);
      button.addEventListener("click", () => placeCamera(preset));
      drawOn([link, pageState], () => setEnabled(button, whyNoLooking(), text("preset.hint", { what: text(`preset.${preset}.hint`), key })));
      return button;
    });
    const measure = element("button", { id: "measure", text: text("measure.begin"), attributes: { "aria-keyshortcuts": "M" } });
    measure.addEventListener("click", () => setMeasuring(!measuring.get()));

    const list = element("div", { id: "layers", class: "menu" });
    const open = element("button", { id: "show-layers", text: text("layers.title"), attributes: { title: text("layers.hint") } });
    // Where there is little room, the others are behind a button, too.
    const places = element("div", { id: "view-places", class: "places" }, ...presets, measure);
    const more = element("button", { id: "show-view", text: text("layers.view") });
    for (const layer of LAYERS) {
      const box = element("input", { data: { layer }, attributes: { type: "checkbox" } });
      box.addEventListener("change", () => showLayer(layer, box.checked));
      list.append(element("label", {}, box, text(`layer.${layer}`)));
      drawOn([layers], () => {
        box.checked = layers.get().has(layer);
      });
    }
    const words = element("p", { class: "measured", attributes: { role: "status" } });
    this.append(
      element(
        "div",
        { class: "tools", attributes: { role: "toolbar", "aria-label": text("layers.tools") } },
        element("div", { class: "folded" }, more, places),
        element("div", { class: "layers" }, open, list),
      ),
      words,
    );
    menu(open, list);
    menu(more, places);

    drawOn([measuring, measured, placing, link, pageState, now], () => {
      const on = measuring.get();
      this.hidden = placing.get();
      setEnabled(measure, whyNoMeasuring(), text(on ? "measure.end_hint" : "measure.hint"));
      measure.setAttribute("aria-pressed", String(on));
      words.hidden = !on;
      setText(words, distanceWords());
    });
  }
}

function whyNoLooking() {
  if (link.get().status !== "open") return reason("no_link");
  return pageState.get()?.base ? null : reason("posture_unknown");
}

function whyNoMeasuring() {
  return whyNoLooking() ?? whyNothing();
}

function distanceWords() {
  const told = measured.get();
  if (told === null) return text("measure.click");
  const [along, across, up] = told.offset;
  const far = Math.hypot(along, across, up);
  return text("measure.told", {
    far: metres(far),
    from: labelOf(told.between[0]),
    to: labelOf(told.between[1]),
    along: metres(along),
    across: metres(across),
    up: metres(up),
  });
}

/** @param {number} value */
function metres(value) {
  return decimal(value, 3).replace("-", "−");
}
customElements.define("rp-view-tools", RpViewTools);
