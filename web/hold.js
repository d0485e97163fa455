// Hold to move: the tool follows the gizmo only while somebody holds, and stops at once when nobody does.

import { signal } from "./store.js";

/** @typedef {"button"|"key"|"gizmo"} HoldSource */

const PERIOD_MS = 50;

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
    /** @type {Set<HoldSource>} */
    this.sources = new Set();
    this.sequence = 0;
    this.timer = 0;
  }

  /**
   * Somebody begins to hold. Where holding is not possible this does nothing, so that a hold that began too early never
   * starts to move the robot later.
   *
   * @param {HoldSource} source
   * @returns {string} Why it was refused; empty when it was taken.
   */
  press(source) {
    const why = this.whyNot();
    if (why) return why;
    this.sources.add(source);
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
    this.send({ type: "Hold", sequence: this.sequence, hold });
  }
}
