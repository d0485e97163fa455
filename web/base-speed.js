// Speed of the base over the ground, from how far it went between two states.

/** Shortest time (s) to measure over: shorter is noise, longer is late. */
const SPAN_S = 0.4;

export class BaseSpeed {
  constructor() {
    /** @type {{ stamp: number, x: number, y: number }[]} */
    this.track = [];
  }

  /**
   * @param {import("./messages.js").PlanarPose|null} base
   * @param {import("./messages.js").JointState|null} joints Its stamp is the bridge's clock.
   * @returns {number|null} m/s; null before there are two poses.
   */
  take(base, joints) {
    if (base === null || joints === null) return null;
    const stamp = joints.header.stamp;
    const newest = this.track.at(-1);
    // A bridge that started again counts from elsewhere.
    if (newest && stamp < newest.stamp) this.track = [];
    if (!newest || stamp > newest.stamp) this.track.push({ stamp, x: base.x, y: base.y });
    while (this.track.length > 2 && stamp - (this.track[1]?.stamp ?? stamp) >= SPAN_S) this.track.shift();
    const first = this.track[0];
    if (!first || stamp <= first.stamp) return null;
    return Math.hypot(base.x - first.x, base.y - first.y) / (stamp - first.stamp);
  }
}
