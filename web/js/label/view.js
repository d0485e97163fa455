// What part of the picture is in view: the scale (screen pixels for one of the picture) and where its corner is.

import { signal } from "../state/signals.js";

/** @typedef {{ scale: number, x: number, y: number }} View */

export const view = signal(/** @type {View} */ ({ scale: 1, x: 0, y: 0 }));
/** Sizes of the window on the picture (CSS pixels), and of the picture. */
const size = { width: 1, height: 1, pictureWidth: 1, pictureHeight: 1 };
const MARGIN = 12;
const LARGEST = 40;

/**
 * @param {number} width
 * @param {number} height
 */
export function setWindow(width, height) {
  const fitted = isFitted();
  Object.assign(size, { width, height });
  if (fitted) fitView();
  else move(0, 0);
}

/**
 * @param {number} width
 * @param {number} height
 */
export function setPicture(width, height) {
  Object.assign(size, { pictureWidth: width, pictureHeight: height });
  fitView();
}

function fitScale() {
  const room = [(size.width - 2 * MARGIN) / size.pictureWidth, (size.height - 2 * MARGIN) / size.pictureHeight];
  return Math.max(0.01, Math.min(...room));
}

function isFitted() {
  return Math.abs(view.get().scale / fitScale() - 1) < 1e-6;
}

export function fitView() {
  const scale = fitScale();
  view.set({
    scale,
    x: (size.width - scale * size.pictureWidth) / 2,
    y: (size.height - scale * size.pictureHeight) / 2,
  });
}

/**
 * @param {number} factor
 * @param {number} [x] Point that stays where it is (CSS pixels in the window).
 * @param {number} [y]
 */
export function zoomView(factor, x = size.width / 2, y = size.height / 2) {
  const old = view.get();
  const scale = Math.max(fitScale() / 2, Math.min(LARGEST, old.scale * factor));
  const by = scale / old.scale;
  view.set({ scale, x: x - (x - old.x) * by, y: y - (y - old.y) * by });
  move(0, 0);
}

/**
 * Move the picture, of which some always stays in view.
 *
 * @param {number} dx
 * @param {number} dy
 */
export function move(dx, dy) {
  const { scale, x, y } = view.get();
  const keep = 60;
  view.set({
    scale,
    x: Math.max(keep - scale * size.pictureWidth, Math.min(size.width - keep, x + dx)),
    y: Math.max(keep - scale * size.pictureHeight, Math.min(size.height - keep, y + dy)),
  });
}
