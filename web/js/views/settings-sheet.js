// Settings of this browser: language, colours, gloves mode, sound and vibration.

import { LANGUAGES } from "../state/languages.js";
import { gloves, language, scheme, sound, vibration } from "../state/settings.js";
import { LANGUAGE, text } from "../state/texts.js";
import { play } from "./cues.js";
import { dropDown, element } from "./dom.js";
import { openSheet, sheet } from "./sheet.js";

/** @typedef {import("../state/signals.js").Signal<string>} Setting */

/** @type {HTMLDialogElement|null} */
let box = null;

export function openSettings() {
  box ??= built();
  openSheet(box);
}

function built() {
  const languages = LANGUAGES.map((each) => /** @type {const} */ ([each, nameOf(each)]));
  const spoken = choice("language", text("settings.language"), language, [["", text("settings.of_browser")], ...languages]);
  // Every word on the page changes.
  language.subscribe((chosen) => chosen !== LANGUAGE && location.reload());
  const colours = choice("scheme", text("settings.colours"), scheme, [
    ["", text("settings.of_device")],
    ["light", text("settings.light")],
    ["dark", text("settings.dark")],
  ]);
  const heard = toggle("sound", text("settings.sound"), text("settings.sound_hint"), sound);
  const felt = toggle("vibration", text("settings.vibration"), text("settings.vibration_hint"), vibration);
  for (const each of [sound, vibration]) each.subscribe((chosen) => chosen === "on" && play("finished"));
  const large = toggle("gloves", text("settings.gloves"), text("settings.gloves_hint"), gloves);
  return sheet("settings", text("settings.title"), spoken, colours, large, heard, felt);
}

/** Its own name for itself. @param {string} code */
function nameOf(code) {
  return new Intl.DisplayNames(code, { type: "language" }).of(code) ?? code;
}

/**
 * @param {string} name
 * @param {string} words
 * @param {Setting} setting
 * @param {readonly (readonly [string, string])[]} options
 */
function choice(name, words, setting, options) {
  const id = `setting-${name}`;
  const select = dropDown({ id }, options);
  select.value = setting.get();
  select.addEventListener("change", () => setting.set(select.value));
  return element("div", { class: "setting" }, element("label", { text: words, attributes: { for: id } }), select);
}

/**
 * A switch is a button, since the space bar, which would press a box, stops the robot.
 *
 * @param {string} name
 * @param {string} words
 * @param {string} hint
 * @param {Setting} setting
 */
function toggle(name, words, hint, setting) {
  const id = `setting-${name}`;
  const attributes = { role: "switch", "aria-labelledby": `${id}-label`, "aria-describedby": `${id}-hint` };
  const button = element("button", { id, class: "switch", attributes });
  const draw = () => button.setAttribute("aria-checked", String(setting.get() === "on"));
  button.addEventListener("click", () => setting.set(setting.get() === "on" ? "off" : "on"));
  setting.subscribe(draw);
  draw();
  const label = element("span", { id: `${id}-label`, text: words });
  const more = element("span", { id: `${id}-hint`, class: "hint", text: hint });
  const said = element("div", { class: "setting-words", onclick: () => button.click() }, label, more);
  return element("div", { class: "setting" }, said, button);
}
