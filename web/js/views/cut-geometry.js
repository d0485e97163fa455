// Places along the wood on a picture: its axis is a line of [column, row, arc length from the cut (m)].

/** @typedef {import("../link/messages.js").AxisPixel} AxisPixel */
/** @typedef {import("../link/messages.js").Pixel} Pixel */
/** @typedef {{ x: number, y: number, angle: number }} Place Angle of the wood there (rad, from right to down). */

/**
 * Where an arc length is, and how the wood runs there.
 *
 * @param {readonly AxisPixel[]} axis At least one.
 * @param {number} arc (m)
 * @returns {Place}
 */
export function placeAt(axis, arc) {
  const last = Math.max(1, axis.length - 1);
  let k = 1;
  while (k < last && (axis[k]?.[2] ?? 0) < arc) k += 1;
  const [from, to] = [axis[k - 1] ?? [0, 0, 0], axis[k] ?? axis[k - 1] ?? [0, 0, 0]];
  const length = to[2] - from[2];
  const share = length > 0 ? Math.max(0, Math.min(1, (arc - from[2]) / length)) : 0;
  const [x, y] = [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])];
  return { x, y, angle: Math.atan2(to[1] - from[1], to[0] - from[0]) };
}

/**
 * The arc length (m) nearest to a place in the picture.
 *
 * @param {readonly AxisPixel[]} axis
 * @param {Pixel} place
 */
export function nearestArc(axis, [x, y]) {
  let [best, found] = [Infinity, 0];
  for (let k = 1; k < axis.length; k++) {
    const [from, to] = [/** @type {AxisPixel} */ (axis[k - 1]), /** @type {AxisPixel} */ (axis[k])];
    const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    const share = Math.max(0, Math.min(1, ((x - from[0]) * dx + (y - from[1]) * dy) / Math.max(dx * dx + dy * dy, 1e-9)));
    const away = Math.hypot(from[0] + share * dx - x, from[1] + share * dy - y);
    if (away < best) [best, found] = [away, from[2] + share * (to[2] - from[2])];
  }
  return found;
}

/**
 * The wood on one side of an arc length, as the data of an SVG path; empty where there is none.
 *
 * @param {readonly AxisPixel[]} axis
 * @param {number} arc (m)
 * @param {"stays"|"falls"} side
 */
export function woodPath(axis, arc, side) {
  const at = placeAt(axis, arc);
  const rest = axis.filter(([, , s]) => (side === "stays" ? s < arc : s > arc)).map(([x, y]) => /** @type {Pixel} */ ([x, y]));
  if (rest.length === 0) return "";
  return linePath(side === "stays" ? [...rest, [at.x, at.y]] : [[at.x, at.y], ...rest]);
}

/** @param {readonly Pixel[]} line */
export function linePath(line) {
  return line.length < 2 ? "" : `M${line.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}`;
}
