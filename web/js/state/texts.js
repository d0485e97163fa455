// Words of the page, from `text/page.LANGUAGE.json` and `text/reasons.LANGUAGE.json`.

import { LANGUAGES } from "./languages.js";
import { dress, language } from "./settings.js";

/** The language chosen on this page, or the first of the browser's that there are texts in. */
export const LANGUAGE =
  [language.get(), ...navigator.languages.flatMap((each) => [each, each.split("-")[0] ?? ""])].find((each) =>
    LANGUAGES.includes(each),
  ) ?? "en";
document.documentElement.lang = LANGUAGE;
// Before the first words are shown.
dress(document.documentElement);

/**
 * A catalogue of texts. Without it the page shows the keys, since it has to stop the robot all the same.
 *
 * @param {"page"|"reasons"} name
 * @returns {Promise<any>}
 */
async function loaded(name) {
  try {
    return await (await fetch(new URL(`../../text/${name}.${LANGUAGE}.json`, import.meta.url))).json();
  } catch {
    return {};
  }
}

const [words, reasons] = await Promise.all([loaded("page"), loaded("reasons")]);
/** @type {Readonly<Record<string, string>>} */
const TEXTS = words;
/**
 * Severity, text and advice of each reason, by its code.
 *
 * @type {Readonly<Record<string, readonly [import("../link/messages.js").Severity, string, string]>>}
 */
export const REASONS = reasons;
const PLURALS = new Intl.PluralRules(LANGUAGE);

/**
 * @param {string} key
 * @param {Readonly<Record<string, string|number>>} [values] By their names in the text.
 */
export function text(key, values = {}) {
  return (TEXTS[key] ?? key).replace(/\{(\w+)\}/g, (_, name) => String(values[name] ?? "?"));
}

/** Words in which no line ends between a number and its unit, or begins with a dot. @param {string} words */
export function joined(words) {
  return words.replace(/(?<=\d) (?=(?:mm|m|ms|s|min|h|%|Hz)(?![\p{L}\d]))|(?<=[ω≥]) | (?=· )/gu, "\u00a0");
}

/**
 * Text with a count, in the singular or plural.
 *
 * @param {string} key Of the texts `key.one`, `key.other` and what else the language has.
 * @param {number} count
 * @param {Readonly<Record<string, string|number>>} [values]
 */
export function counted(key, count, values = {}) {
  return text(`${key}.${PLURALS.select(count)}`, { ...values, count });
}

/**
 * Does a number take the singular?
 *
 * @param {number} count
 */
export function isOne(count) {
  return PLURALS.select(count) === "one";
}

/** What a name in a message may be of. */
const FAMILIES = Object.freeze(["mode", "point", "command", "process", "role", "name"]);

/**
 * The labels of modes, states of points, commands, parts or kinds of wood, also with a number; others as they are.
 *
 * @param {string} names With commas or dashes between them.
 */
export function labelOf(names) {
  return names
    .split(/(, | – )/)
    .map((part, at) => (at % 2 ? part : label(part)))
    .join("");
}

/** @param {string} name */
function label(name) {
  const [, kind = name, number = ""] = /^(.*?) ?(\d+)$/.exec(name) ?? [];
  const family = FAMILIES.find((each) => `${each}.${kind}` in TEXTS);
  return family ? `${TEXTS[`${family}.${kind}`]}${number && "\u00a0"}${number}` : name;
}
