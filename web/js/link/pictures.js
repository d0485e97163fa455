// Pictures of points and of undecided places, with what is drawn on them. A picture is fetched once.

import { fetchJson } from "./api.js";

/** @typedef {import("./messages.js").SpurDrawing} SpurDrawing */
/** @typedef {{ drawing: SpurDrawing, image: HTMLImageElement }} CutPicture */

/** Images that are kept, about 20 kB each. */
const MOST = 60;
/** @type {Map<string, Promise<HTMLImageElement|null>>} */
const images = new Map();

/**
 * The newest picture; null without one.
 *
 * @param {string} of Path of the point or the spur.
 * @returns {Promise<CutPicture|null>}
 */
export async function fetchPicture(of) {
  /** @type {SpurDrawing|null} */
  const drawing = await fetchJson(`${of}/drawing`);
  if (drawing === null) return null;
  const image = await imageAt(`${of}/picture?image=${drawing.image}`, drawing.image);
  return image && { drawing, image };
}

/**
 * The cut of a point on a picture, if the picture shows this cut and not an older one, or none.
 *
 * @param {CutPicture|null} picture
 * @param {import("./messages.js").PagePoint|null} row Null for a place without a point.
 * @returns {{ cut: import("./messages.js").DrawnCut|null, pictured: "shown"|"older"|"none" }}
 */
export function cutOn(picture, row) {
  const cut = picture?.drawing.cuts.find((each) => each.point_id === row?.point.point_id) ?? null;
  if (!picture || (row && !cut)) return { cut: null, pictured: "none" };
  const newest = !row || !cut || cut.revision >= row.point.revision;
  return newest ? { cut, pictured: "shown" } : { cut: null, pictured: "older" };
}

/**
 * The points of a spur share an image.
 *
 * @param {string} path
 * @param {string} hash
 */
function imageAt(path, hash) {
  let loading = images.get(hash);
  if (!loading) {
    loading = loaded(path);
    images.set(hash, loading);
    const oldest = images.keys().next().value;
    if (images.size > MOST && oldest !== undefined) images.delete(oldest);
    // A failed one is fetched again.
    void loading.then((image) => image === null && images.delete(hash));
  }
  return loading;
}

/** @param {string} path */
async function loaded(path) {
  const image = new Image();
  image.src = path;
  try {
    await image.decode();
    return image;
  } catch {
    return null;
  }
}
