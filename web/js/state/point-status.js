// What a point or a place is to a person: one of six statuses.

/** @typedef {import("../link/messages.js").PointState} PointState */
/** @typedef {"proposed"|"accepted"|"unreachable"|"done"|"decide"|"left"} Status */

/** @type {Readonly<Record<PointState, Status>>} */
const STATUS_OF = Object.freeze({
  PROPOSED: "proposed",
  ACCEPTED: "accepted",
  CUTTING: "accepted",
  UNREACHABLE: "unreachable",
  DONE: "done",
  FAILED_NOT_CUT: "decide",
  UNKNOWN: "decide",
  REJECTED: "left",
});

/** @param {PointState} state */
export function statusOf(state) {
  return STATUS_OF[state];
}
