// Entry point of the labelling page: defines its components, opens the first picture, listens for keys.

import "../components/rp-label-bar.js";
import "../components/rp-label-canvas.js";
import "../components/rp-label-list.js";
import "../components/rp-label-tools.js";
import { listenForLabelKeys } from "./label/keys.js";
import { begin } from "./label/session.js";
import { text } from "./state/texts.js";

document.title = `${text("label.title")} · Rolling Panda`;
listenForLabelKeys(window);
void begin();
