// Classes of a mask in the order of the page, with their colours on the picture and their keys.

/** Value of pixels that nobody has labelled. */
export const UNLABELLED = 255;

/**
 * @typedef {object} LabelClass
 * @property {string} name As in `dataset.json`.
 * @property {readonly [number, number, number]} colour
 * @property {string} key Empty without one.
 */

/** @type {readonly LabelClass[]} */
export const CLASSES = Object.freeze([
  { name: "cane", colour: [255, 140, 26], key: "1" },
  { name: "node", colour: [255, 230, 0], key: "2" },
  { name: "spur", colour: [255, 61, 184], key: "3" },
  { name: "cordon", colour: [240, 51, 60], key: "4" },
  { name: "trunk", colour: [155, 92, 255], key: "5" },
  { name: "post", colour: [25, 211, 230], key: "6" },
  { name: "wire", colour: [59, 130, 255], key: "7" },
  { name: "hose", colour: [18, 196, 139], key: "8" },
  { name: "far", colour: [120, 140, 160], key: "9" },
  { name: "old cut", colour: [250, 250, 245], key: "" },
  { name: "background", colour: [84, 130, 180], key: "" },
  { name: "ground", colour: [150, 105, 70], key: "" },
]);

/** Classes that need no brush where the network proposes them: the rest of a picture. */
export const REST = Object.freeze(["far", "background", "ground"]);
