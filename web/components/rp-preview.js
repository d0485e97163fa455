// The preview: played as a ghost in the 3-D view, and approved.

import { whyNot } from "../js/control/allowed.js";
import { workOrder } from "../js/control/order.js";
import {
  approvePreview,
  askPreview,
  cutAt,
  hasPreview,
  hidePreview,
  moment,
  playing,
  requirePreview,
  showMoment,
  togglePlayback,
  whyNoApproval,
  whyNoPreview,
} from "../js/control/preview.js";
import { link, now, pageState, points, preview, selected } from "../js/state/page-state.js";
import { drawOn } from "../js/state/signals.js";
import { element, setEnabled, setText } from "../js/views/dom.js";
import { reason, reasonText } from "../js/state/reasons.js";

/** @typedef {import("../js/link/messages.js").PreviewState} PreviewState */

/** Step of the slider (s). */
const STEP = 0.05;

class RpPreview extends HTMLElement {
  connectedCallback() {
    const button = (/** @type {string} */ id, /** @type {string} */ text, /** @type {() => void} */ onclick) =>
      element("button", { id, text, onclick });
    const all = button("preview", "Preview", () => void askPreview(""));
    const one = button("preview-one", "Chosen", () => void askPreview(selected.get()));
    const run = button("preview-play", "Play", togglePlayback);
    const close = button("preview-hide", "Hide", hidePreview);
    const yes = button("approve-preview", "Approve", () => void approvePreview());
    const slider = element("input", {
      id: "preview-time",
      attributes: { type: "range", min: "0", step: String(STEP), "aria-label": "Moment of the preview" },
    });
    const time = element("span", { class: "number preview-time" });
    const words = element("p", { class: "preview-words number", attributes: { role: "status" } });
    const required = element("input", { id: "require-preview", attributes: { type: "checkbox" } });
    const label = element(
      "label",
      { class: "preview-required", attributes: { for: "require-preview" } },
      required,
      "Before each cut",
    );
    const player = element("div", { class: "preview-player" }, run, slider, time, close, yes);
    this.replaceChildren(element("div", { class: "preview-tools" }, all, one, label, words), player);
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
      const accepted = workOrder();
      const chosen = accepted.some((row) => row.point.point_id === selected.get());
      setEnabled(all, whyNoPreview(accepted.length), "Show what the robot would do with the accepted points");
      setEnabled(
        one,
        whyNoPreview(accepted.length) ?? (chosen ? null : reason("none_chosen")),
        "Show the cut of the chosen point alone",
      );
      setEnabled(yes, whyNoApproval(), "This is what shall be done; it begins with Start");
      setText(run, playing.get() ? "Stop" : "Play");
      setEnabled(close, moment.get() === null ? reason("ghost_hidden") : null, "Take the ghost out of the 3-D view");
      required.checked = state?.required ?? false;
      setEnabled(required, whyNot("RequirePreview"), "No cut begins before its preview has been approved");
      label.title = required.title;
      player.hidden = !hasPreview();
      this.dataset.phase = state?.phase ?? "none";
      const at = moment.get() ?? 0;
      slider.max = String(state?.duration_s ?? 0);
      slider.value = String(at);
      slider.setAttribute("aria-valuetext", `${at.toFixed(1)} s`);
      setText(time, `${at.toFixed(1)} / ${(state?.duration_s ?? 0).toFixed(1)} s`);
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
  if (state.phase === "waiting") return state.reason ? `Waiting: ${reasonText(state.reason)}…` : "Waiting…";
  if (state.phase === "rolling") return "Working it out…";
  if (state.phase === "expired") return `Expired: ${reasonText(state.reason)}`;
  const cut = at === null ? undefined : cutAt(at);
  const approved = state.phase === "approved" ? `Approved by ${state.approved_by}. ` : "";
  if (cut) return `${approved}${cut.point_id}: ${cut.reason ? `not cut: ${reasonText(cut.reason)}` : "cut"} · ${least([cut])}`;
  const left = state.remaining > 0 ? ` of ${state.cuts.length + state.remaining}` : "";
  const done = state.cuts.filter((each) => each.cut_s !== null).length;
  return `${approved}${done}${left} ${done === 1 ? "cut" : "cuts"} in ${state.duration_s.toFixed(1)} s · ${least(state.cuts)}`;
}

/** @param {readonly import("../js/link/messages.js").PreviewedCut[]} cuts */
function least(cuts) {
  const nearest = cuts.reduce(
    (a, b) => (b.clearance < a.clearance ? b : a),
    cuts[0] ?? { clearance: 0, between: ["", ""] },
  );
  const omega = Math.min(...cuts.map((cut) => cut.manipulability));
  const margin = Math.min(...cuts.map((cut) => cut.joint_margin));
  return `least ${Math.round(1000 * nearest.clearance)} mm ${nearest.between.join("–")} · ω ${omega.toFixed(3)} · joints ${((180 / Math.PI) * margin).toFixed(0)}°`;
}
customElements.define("rp-preview", RpPreview);
