// Hold to move: the robot follows a hand only while somebody holds, and stops at once when nobody does.

import { signal } from "./store.js";

/** @typedef {"button"|"key"|"gizmo"|"drive"|"pad"|"gamepad"|"joint"} HoldSource */
/** @typedef {{ base?: import("./messages.js").BaseVelocity, joints?: import("./messages.js").ArmVelocities }} Wanted */

const PERIOD_MS = 50;
/** What leads the tool to its gizmo. Any other source moves the robot in its own way, and alone. */
const TOOL = new Set(["button", "key", "gizmo"]);
const TWO_AT_ONCE = "Two at once: it stopped. Let go, then hold one of them";

export class HoldToMove {
  /**
   * @param {(hold: import("./messages.js").Hold) => void} send
   * @param {() => string} whyNot Why holding is not possible now; empty when it is.
   */
  constructor(send, whyNot) {
    this.send = send;
    this.whyNot = whyNot;
    /** Is somebody holding now? */
    this.holding = signal(false);
    /** Share of the usual speed. */
    this.share = signal(1);
    /** @type {Set<HoldSource>} */
    this.sources = new Set();
    /** @type {() => Wanted} */
    this.wanted = () => ({});
    this.sequence = 0;
    this.timer = 0;
  }

  /**
   * Somebody begins to hold. Where holding is not possible this does nothing, so that a hold that began too early never
   * starts to move the robot later.
   *
   * @param {HoldSource} source
   * @param {() => Wanted} [wanted] What the base or the joints shall do; without it the tool follows the gizmo.
   * @returns {string} Why it was refused; empty when it was taken.
   */
  press(source, wanted = () => ({})) {
    const why = this.whyNot();
    if (why) return why;
    if (this.sources.size > 0 && [...this.sources, source].some((each) => !TOOL.has(each))) {
      this.releaseAll();
      return TWO_AT_ONCE;
    }
    this.sources.add(source);
    this.wanted = wanted;
    if (this.holding.get()) return "";
    this.holding.set(true);
    this.tell(true);
    this.timer = window.setInterval(() => this.turn(), PERIOD_MS);
    return "";
  }

  /** @param {HoldSource} source */
  release(source) {
    if (this.sources.delete(source) && this.sources.size === 0) this.end();
  }

  releaseAll() {
    this.sources.clear();
    this.end();
  }

  turn() {
    if (this.whyNot()) this.releaseAll();
    else this.tell(true);
  }

  end() {
    if (!this.holding.get()) return;
    clearInterval(this.timer);
    this.tell(false);
    this.holding.set(false);
  }

  /** @param {boolean} hold */
  tell(hold) {
    this.sequence += 1;
    const { base = null, joints = null } = hold ? this.wanted() : {};
    this.send({ type: "Hold", sequence: this.sequence, hold, base, joints, share: this.share.get() });
  }
}
