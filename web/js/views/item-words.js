// What a cut or an undecided place is called, and what is told of it, in words.

import { nameOf } from "../control/decisions.js";
import { SURE } from "../link/messages.js";
import { counted, text } from "../state/texts.js";

/** @typedef {import("../control/review.js").Item} Item */
/** @typedef {import("../link/messages.js").PagePoint} PagePoint */

/** From this confidence on a point is "fairly sure". */
const FAIRLY = 0.6;

/** @param {Item} item */
export function placeName({ vine, spur }) {
  return text("queue.group", { vine, spur });
}

/** @param {PagePoint} row */
export function keepsWords({ point }) {
  return cutWords(point, text(`review.${point.confidence >= SURE ? "sure" : point.confidence >= FAIRLY ? "fairly" : "unsure"}`));
}

/**
 * @param {PagePoint["point"]} point
 * @param {...string} more
 */
export function cutWords(point, ...more) {
  // Of last year's cane nothing stays.
  const keeps = point.kind === "removal" ? text("review.old_cane") : counted("review.keeps", point.nodes_kept);
  const parts = [text(`details.kind.${point.kind}`), keeps, ...more];
  // A line ends between two of them alone.
  return parts.map((each) => each.replaceAll(" ", "\u00a0")).join("\u00a0· ");
}

/** What a picture of it shows, for who does not see it. @param {Item} item */
export function pictureWords(item) {
  return item.row ? text("picture.of", { point: nameOf(item.row) }) : placeName(item);
}
