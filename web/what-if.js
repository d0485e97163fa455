// What has become of the points since a moment ago, for somebody who tries another rule.

import { counted } from "./words.js";

/** @typedef {import("./messages.js").PagePoint} PagePoint */
/** @typedef {{ changed: number, gone: number, added: number, voided: number, all: number }} Changes */

/**
 * @param {readonly PagePoint[]} before
 * @param {readonly PagePoint[]} after
 * @returns {Changes}
 */
export function changesSince(before, after) {
  const now = new Map(after.map((row) => [row.point.point_id, row]));
  const changes = { changed: 0, gone: 0, added: 0, voided: 0, all: after.length };
  for (const row of before) {
    const later = now.get(row.point.point_id);
    now.delete(row.point.point_id);
    if (!later) changes.gone += 1;
    else if (later.point.digest !== row.point.digest) changes.changed += 1;
    if (row.entry.state === "ACCEPTED" && later?.entry.state === "PROPOSED") changes.voided += 1;
  }
  changes.added = now.size;
  return changes;
}

/** @param {Changes} changes */
export function changeWords({ changed, gone, added, voided, all }) {
  const parts = [];
  if (changed) parts.push(`${changed} moved`);
  if (added) parts.push(`${added} new`);
  if (gone) parts.push(`${gone} gone`);
  if (voided) parts.push(`${counted(voided, "acceptance")} void`);
  return `${counted(all, "point")}: ${parts.length > 0 ? parts.join(", ") : "no change"}`;
}
