// The preview: played as a ghost in the 3-D view, and approved.

import { whyNot } from "../js/control/allowed.js";
import { workOrder } from "../js/control/order.js";
import {
  approvePreview,
  askPreview,
  closePreview,
  cutAt,
  hasPreview,
  hidePreview,
  moment,
  playing,
  previewOpen,
  requirePreview,
  showMoment,
  togglePlayback,
  whyNoApproval,
  whyNoPreview,
} from "../js/control/preview.js";
import { decimal } from "../js/state/format.js";
import { link, now, pageState, points, preview, selected } from "../js/state/page-state.js";
import { pointNames } from "../js/state/point-names.js";
import { drawOn } from "../js/state/signals.js";
import { counted, labelOf, text } from "../js/state/texts.js";
import { element, setEnabled, setText } from "../js/views/dom.js";
import { capital, reason, reasonText } from "../js/state/reasons.js";

/** @typedef {import("../js/link/messages.js").PreviewState} PreviewState */

/** Step of the slider (s). */
const STEP = 0.05;

class RpPreview extends HTMLElement {
  connectedCallback() {
    const button = (/** @type {string} */ id, /** @type {string} */ words, /** @type {() => void} */ onclick) =>
      element("button", { id, text: words, onclick });
    const all = button("preview", text("preview.all"), () => void askPreview(""));
    const one = button("preview-one", text("preview.one"), () => void askPreview(selected.get()));
    const run = button("preview-play", text("preview.play"), togglePlayback);
    const close = button("preview-hide", text("preview.hide"), hidePreview);
    const leave = button("close-preview", "×", closePreview);
    leave.setAttribute("aria-label", text("preview.close"));
    const yes = button("approve-preview", text("preview.approve"), () => void approvePreview());
    const slider = element("input", {
      id: "preview-time",
      attributes: { type: "range", min: "0", step: String(STEP), "aria-label": text("preview.moment") },
    });
    const time = element("span", { class: "number preview-time" });
    const words = element("p", { class: "preview-words number", attributes: { role: "status" } });
    const required = element("input", { id: "require-preview", attributes: { type: "checkbox" } });
    const label = element(
      "label",
      { class: "preview-required", attributes: { for: "require-preview" } },
      required,
      text("preview.required"),
    );
    const player = element("div", { class: "preview-player" }, run, slider, time, close, yes);
    this.replaceChildren(element("div", { class: "preview-tools" }, all, one, label, leave, words), player);
    drawOn([previewOpen], () => {
      this.hidden = !previewOpen.get();
    });
    slider.addEventListener("input", () => {
      playing.set(false);
      showMoment(Number(slider.value));
    });
    required.addEventListener("change", () => {
      const wanted = required.checked;
      required.checked = preview.get()?.required ?? false;
      if (!whyNot("RequirePreview")) void requirePreview(wanted);
    });
    let hash = "";
    let working = false;
    drawOn([preview, moment, playing, points, pageState, link, now, selected], () => {
      const state = preview.get();
      if ((state?.preview_hash ?? "") !== hash) {
        hash = state?.preview_hash ?? "";
        hidePreview();
      }
      // At work the ghost would hide the robot.
      const works = pageState.get()?.controller?.mode === "AUTO";
      if (works && !working) hidePreview();
      working = works;
      const chosen = workOrder().some((row) => row.point.point_id === selected.get());
      setEnabled(all, whyNoPreview(), text("preview.all_hint"));
      setEnabled(
        one,
        whyNoPreview() ?? (chosen ? null : reason("none_chosen")),
        text("preview.one_hint"),
      );
      setEnabled(yes, whyNoApproval(), text("preview.approve_hint"));
      setText(run, text(playing.get() ? "preview.stop" : "preview.play"));
      setEnabled(close, moment.get() === null ? reason("ghost_hidden") : null, text("preview.hide_hint"));
      required.checked = state?.required ?? false;
      setEnabled(required, whyNot("RequirePreview"), text("preview.required_hint"));
      label.title = required.title;
      player.hidden = !hasPreview();
      this.dataset.phase = state?.phase ?? "none";
      const at = moment.get() ?? 0;
      slider.max = String(state?.duration_s ?? 0);
      slider.value = String(at);
      slider.setAttribute("aria-valuetext", `${decimal(at, 1)} s`);
      setText(time, `${decimal(at, 1)} / ${decimal(state?.duration_s ?? 0, 1)} s`);
      setText(words, wordsOf(state, moment.get()));
      this.classList.toggle("wide", words.textContent !== "");
      words.title = words.textContent ?? "";
    });
  }
}

/**
 * @param {PreviewState|null} state
 * @param {number|null} at
 */
function wordsOf(state, at) {
  if (state === null || state.phase === "none") return reasonText(state?.reason);
  const why = reasonText(state.reason);
  if (state.phase === "waiting") return why ? text("preview.waiting_for", { why }) : text("preview.waiting");
  if (state.phase === "rolling") return text("preview.rolling");
  if (state.phase === "expired") return text("preview.expired", { why });
  const cut = at === null ? undefined : cutAt(at);
  const approved = state.phase === "approved" ? `${text("preview.approved", { user: state.approved_by })} ` : "";
  if (cut) {
    const end = cut.reason ? text("preview.not_cut", { why: reasonText(cut.reason) }) : text("preview.cut");
    return `${approved}${text("advice", { text: capital(pointNames(cut.point_id)), act: end })} · ${least([cut])}`;
  }
  const seconds = decimal(state.duration_s, 1);
  const done = state.cuts.filter((each) => each.cut_s !== null).length;
  const all = state.cuts.length + state.remaining;
  const cuts =
    state.remaining > 0 ? counted("preview.some_cuts", done, { all, seconds }) : counted("preview.cuts", done, { seconds });
  return `${approved}${cuts} · ${least(state.cuts)}`;
}

/** @param {readonly import("../js/link/messages.js").PreviewedCut[]} cuts */
function least(cuts) {
  const nearest = cuts.reduce(
    (a, b) => (b.clearance < a.clearance ? b : a),
    cuts[0] ?? { clearance: 0, between: ["", ""] },
  );
  const omega = Math.min(...cuts.map((cut) => cut.manipulability));
  const margin = Math.min(...cuts.map((cut) => cut.joint_margin));
  return text("preview.least", {
    clearance: Math.round(1000 * nearest.clearance),
    between: nearest.between.map(labelOf).join("–"),
    omega: decimal(omega, 3),
    margin: ((180 / Math.PI) * margin).toFixed(0),
  });
}
customElements.define("rp-preview", RpPreview);
