// Made by `python -m rolling_panda.generate --write` from the files in `web/text/`.

/** Languages of the page; the first is the one without a preference. @type {readonly string[]} */
export const LANGUAGES = Object.freeze(["en", "de", "es", "fr", "it"]);
