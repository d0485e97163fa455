// Help: the keys, the operator's short guide, and the hints once more.

import { openScreen } from "../state/screens.js";
import { LANGUAGE, text } from "../state/texts.js";
import { element } from "./dom.js";
import { showHints } from "./hints.js";
import { openSheet, sheet } from "./sheet.js";

/** What each key does; a name in lower case is that of a key that has no letter. */
const KEYS = Object.freeze([
  { does: "stop", keys: ["space"] },
  { does: "decide", keys: ["A", "R"] },
  { does: "undo", keys: ["Z"] },
  { does: "step", keys: ["←", "→"] },
  { does: "vine", keys: ["V"] },
  { does: "add", keys: ["N"] },
  { does: "look", keys: ["L"] },
  { does: "zoom", keys: ["+", "−"] },
  { does: "camera", keys: ["1", "2", "3", "4"] },
  { does: "measure", keys: ["M"] },
  { does: "hold", keys: ["H"] },
  { does: "drive", keys: ["W", "A", "S", "D"] },
  { does: "close", keys: ["Esc"] },
  { does: "help", keys: ["?"] },
]);

/** @type {HTMLDialogElement|null} */
let box = null;

export function openHelp() {
  box ??= built();
  openSheet(box);
}

function built() {
  const rows = KEYS.map(({ does, keys }) =>
    element(
      "tr",
      {},
      element("th", { attributes: { scope: "row" } }, ...keys.map((key) => element("kbd", { text: key === "space" ? text("keys.space") : key }))),
      element("td", { text: text(`keys.${does}`) }),
    ),
  );
  const again = element("button", { text: text("help.hints") });
  const guide = element("a", {
    class: "button",
    text: text("help.guide"),
    attributes: { href: `guide/${LANGUAGE}.html`, target: "_blank", rel: "noopener" },
  });
  const made = sheet(
    "help",
    text("help.title"),
    element("table", { class: "keys keyboard" }, element("tbody", {}, ...rows)),
    element("div", { class: "help-more" }, guide, again),
  );
  again.addEventListener("click", () => {
    made.close();
    openScreen("work");
    showHints();
  });
  return made;
}
