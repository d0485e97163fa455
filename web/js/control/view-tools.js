// The 3-D view of this page: camera presets, layers, measuring.

import { socket } from "../link/socket.js";
import { link, selected } from "../state/page-state.js";
import { signal } from "../state/signals.js";
import { placing, setPlacing } from "./placing.js";
import { isTyping } from "./stop.js";

/** @typedef {import("../link/messages.js").CameraPreset} CameraPreset */
/** @typedef {import("../link/messages.js").Layer} Layer */

/**
 * The keys 1 to 4 do the same.
 *
 * @type {readonly CameraPreset[]}
 */
export const PRESETS = Object.freeze(["follow", "row", "tool", "top"]);
/** @type {readonly Layer[]} */
export const LAYERS = Object.freeze(["plant", "points", "trail", "camera", "cloud", "simulated"]);
const STORAGE_KEY = "layers";

/** @type {import("../state/signals.js").Signal<ReadonlySet<Layer>>} */
export const layers = signal(storedLayers());
/** Which of the two views is the large one. */
export const large = signal(/** @type {"scene"|"camera"} */ ("scene"));
export const measuring = signal(false);
/** The last measurement. */
export const measured = signal(/** @type {import("../link/messages.js").Measured|null} */ (null));

/** @returns {ReadonlySet<Layer>} */
function storedLayers() {
  const known = new Set(LAYERS);
  const kept = /** @type {Layer[]} */ (
    (localStorage.getItem(STORAGE_KEY) ?? "plant,points,trail").split(",")
  );
  return new Set(kept.filter((layer) => known.has(layer)));
}

/**
 * @param {Layer} layer
 * @param {boolean} shown
 */
export function showLayer(layer, shown) {
  const chosen = new Set(layers.get());
  if (shown) chosen.add(layer);
  else chosen.delete(layer);
  layers.set(chosen);
  localStorage.setItem(STORAGE_KEY, [...chosen].join(","));
  sendLayers();
}

function sendLayers() {
  socket.send({ type: "ShowLayers", layers: [...layers.get()] });
}

/** Has the camera flown to a point since it was last placed? */
let atPoint = false;
selected.subscribe((point) => {
  atPoint = point !== "";
});

/** @param {CameraPreset} preset */
export function placeCamera(preset) {
  atPoint = false;
  socket.send({ type: "PlaceCamera", preset });
}

/** Whoever moves the robot sees it, though the camera was at a point. */
export function showRobot() {
  if (atPoint) placeCamera("follow");
}

/** @param {boolean} on */
export function setMeasuring(on) {
  if (on === measuring.get()) return;
  if (on) setPlacing(false);
  measuring.set(on);
  measured.set(null);
  socket.send({ type: "Measure", active: on });
}

/** Send the layers on each new link; receive measurements. */
export function initViewTools() {
  socket.onmeasured = (message) => measured.set(message);
  link.subscribe(({ status }) => {
    if (status === "open") sendLayers();
    else measuring.set(false);
  });
  placing.subscribe((on) => on && setMeasuring(false));
  listenForViewKeys(window);
}

/**
 * @param {Window} target
 */
export function listenForViewKeys(target) {
  target.addEventListener("keydown", (event) => {
    if (event.repeat || event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
    const preset = PRESETS[Number(event.key) - 1];
    if (preset) placeCamera(preset);
    else if (event.code === "KeyM") setMeasuring(!measuring.get());
    else if (event.key === "Escape") setMeasuring(false);
  });
}
