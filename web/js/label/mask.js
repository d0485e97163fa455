// A mask that is painted, with undo and redo. Coordinates are in pixels of the picture, from its upper left corner.

/**
 * Changed pixels of one step: their indices, and their values before and after it.
 *
 * @typedef {{ indices: Uint32Array, before: Uint8Array, after: Uint8Array }} Step
 */

/** Pixels that are drawn anew: left, top, right and bottom, the last two exclusive. @typedef {[number, number, number, number]} Box */

/** Pixels in all steps that can be undone; beyond it the oldest are forgotten. */
const REMEMBERED = 40_000_000;

export class Mask {
  /**
   * @param {number} width
   * @param {number} height
   * @param {Uint8Array} labels Values in rows.
   */
  constructor(width, height, labels) {
    this.width = width;
    this.height = height;
    this.labels = labels;
    /** @type {Step[]} */
    this.done = [];
    /** @type {Step[]} */
    this.undone = [];
    /** @type {number[]} */
    this.indices = [];
    /** @type {number[]} */
    this.before = [];
  }

  /**
   * Paint a straight piece of a stroke.
   *
   * @param {readonly [number, number]} from
   * @param {readonly [number, number]} to
   * @param {number} size Diameter.
   * @param {(index: number) => number} value Of a pixel; the value it has keeps it.
   * @returns {Box}
   */
  line([x0, y0], [x1, y1], size, value) {
    const reach = size / 2;
    /** @type {Box} */
    const box = [
      Math.max(0, Math.floor(Math.min(x0, x1) - reach)),
      Math.max(0, Math.floor(Math.min(y0, y1) - reach)),
      Math.min(this.width, Math.ceil(Math.max(x0, x1) + reach)),
      Math.min(this.height, Math.ceil(Math.max(y0, y1) + reach)),
    ];
    const [dx, dy] = [x1 - x0, y1 - y0];
    const length = dx * dx + dy * dy;
    const within = Math.max(reach * reach, 0.25);
    for (let y = box[1]; y < box[3]; y++) {
      for (let x = box[0]; x < box[2]; x++) {
        const [px, py] = [x + 0.5 - x0, y + 0.5 - y0];
        const along = length === 0 ? 0 : Math.max(0, Math.min(1, (px * dx + py * dy) / length));
        const [ex, ey] = [px - along * dx, py - along * dy];
        if (ex * ex + ey * ey <= within) this.set(y * this.width + x, value);
      }
    }
    for (const [x, y] of [[x0, y0], [x1, y1]]) {
      if (x >= 0 && y >= 0 && x < this.width && y < this.height) {
        this.set(Math.floor(y) * this.width + Math.floor(x), value);
      }
    }
    return box;
  }

  /**
   * Give every pixel a value, as one step.
   *
   * @param {(index: number) => number} value
   */
  fill(value) {
    for (let index = 0; index < this.labels.length; index++) this.set(index, value);
    return this.end();
  }

  /**
   * @param {number} index
   * @param {(index: number) => number} value
   */
  set(index, value) {
    const [old, next] = [this.labels[index] ?? 0, value(index)];
    if (old === next) return;
    // A pixel is painted once a stroke, since all of a stroke gives it the same value.
    this.indices.push(index);
    this.before.push(old);
    this.labels[index] = next;
  }

  /** End a step; false if it has changed nothing. */
  end() {
    if (this.indices.length === 0) return false;
    const indices = Uint32Array.from(this.indices);
    const after = Uint8Array.from(this.indices, (index) => this.labels[index] ?? 0);
    this.done.push({ indices, before: Uint8Array.from(this.before), after });
    this.undone = [];
    this.indices = [];
    this.before = [];
    let remembered = 0;
    let first = this.done.length;
    while (first > 0 && (remembered += this.done[first - 1]?.indices.length ?? 0) <= REMEMBERED) first--;
    if (first < this.done.length) this.done.splice(0, first);
    return true;
  }

  /** Take back the last step; false if there is none. */
  undo() {
    const step = this.done.pop();
    if (!step) return false;
    step.indices.forEach((index, at) => (this.labels[index] = step.before[at] ?? 0));
    this.undone.push(step);
    return true;
  }

  /** Do again what was taken back; false if there is nothing. */
  redo() {
    const step = this.undone.pop();
    if (!step) return false;
    step.indices.forEach((index, at) => (this.labels[index] = step.after[at] ?? 0));
    this.done.push(step);
    return true;
  }
}
