// Words of the page, from `text/page.LANGUAGE.json`: another language is another file.

const LANGUAGE = document.documentElement.lang;

/**
 * A catalogue of texts. Without it the page shows the keys, since it has to stop the robot all the same.
 *
 * @param {"page"|"reasons"} name
 * @returns {Promise<any>}
 */
export async function loaded(name) {
  try {
    return await (await fetch(new URL(`../../text/${name}.${LANGUAGE}.json`, import.meta.url))).json();
  } catch {
    return {};
  }
}

/** @type {Readonly<Record<string, string>>} */
const TEXTS = await loaded("page");
const PLURALS = new Intl.PluralRules(LANGUAGE);

/**
 * @param {string} key
 * @param {Readonly<Record<string, string|number>>} [values] By their names in the text.
 */
export function text(key, values = {}) {
  return (TEXTS[key] ?? key).replace(/\{(\w+)\}/g, (_, name) => String(values[name] ?? "?"));
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
 * The label of a mode or of a point's state; other names as they are.
 *
 * @param {string} name
 */
export function labelOf(name) {
  return TEXTS[`mode.${name}`] ?? TEXTS[`point.${name}`] ?? name;
}
