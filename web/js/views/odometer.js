// The way of the base as its odometry tells it: what the commissioning compares with a tape on the ground.

/** @typedef {import("../link/messages.js").PlanarPose} PlanarPose */

export class Odometer {
  /** Driven along its own axis (m); back counts against ahead. */
  distance = 0;
  /** Turned to the left (rad); past a whole turn it goes on. */
  turned = 0;
  /** @type {{ stamp: number, pose: PlanarPose }|null} */
  last = null;

  /**
   * @param {PlanarPose} pose
   * @param {number} stamp Of the bridge's clock (s).
   */
  update(pose, stamp) {
    const { last } = this;
    if (last && stamp === last.stamp) return;
    this.last = { stamp, pose };
    // The clock of a restarted bridge begins again, and so does its odometry.
    if (!last || stamp < last.stamp) return;
    const turn = Math.atan2(Math.sin(pose.phi - last.pose.phi), Math.cos(pose.phi - last.pose.phi));
    const along = last.pose.phi + turn / 2;
    this.distance += (pose.x - last.pose.x) * Math.cos(along) + (pose.y - last.pose.y) * Math.sin(along);
    this.turned += turn;
  }

  reset() {
    this.distance = this.turned = 0;
  }
}
