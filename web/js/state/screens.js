// The screens of the page, one for each job. The hash of the address names the open one.

import { pageState } from "./page-state.js";
import { drawOn, signal } from "./signals.js";

/** @typedef {"work"|"review"|"drive"|"report"|"engineer"} ScreenName */

/** @type {readonly ScreenName[]} */
export const SCREENS = Object.freeze(["work", "review", "drive", "report", "engineer"]);
/** The open screen. */
export const screen = signal(named() ?? "work");

/** Is there a view beside this screen, or a picture on it? @param {ScreenName} name */
export function hasView(name) {
  return name !== "report" && name !== "engineer";
}

/** @returns {ScreenName|undefined} The screen that the address names. */
function named() {
  return SCREENS.find((each) => `#${each}` === location.hash);
}

/** @param {ScreenName} name */
export function openScreen(name) {
  if (name !== screen.get()) location.hash = name;
  screen.set(name);
}

/**
 * Fetch at once and again in each period, for as long as a screen is open.
 *
 * @param {ScreenName} name
 * @param {number} period In ms.
 * @param {() => unknown} fetchAll
 */
export function whileOpen(name, period, fetchAll) {
  let timer = 0;
  drawOn([screen], () => {
    window.clearInterval(timer);
    if (screen.get() !== name) return;
    fetchAll();
    timer = window.setInterval(fetchAll, period);
  });
}

/** Follow the address. Where it names no screen, the robot's first state says which opens. */
export function initScreens() {
  window.addEventListener("hashchange", () => screen.set(named() ?? "work"));
  if (named()) return;
  const wait = pageState.subscribe((state) => {
    if (!state?.controller) return;
    wait();
    if (state.controller.mode === "TELEOP" && !named()) location.replace("#drive");
  });
}
