// The page's WebSocket: states in, messages out, a ping ten times a second, reconnection.

import { link, points, preview, receiveEvents, receiveState, roundTrip, say } from "../state/page-state.js";
import { text } from "../state/texts.js";
import { isSignedIn } from "./api.js";

/** @typedef {import("./messages.js").FromPage} FromPage */
/** @typedef {import("./messages.js").FromServer} FromServer */
/** @typedef {import("./messages.js").PickRay} PickRay */

const PING_MS = 100;
/**
 * Without a message for this many timer turns the link is dead. Turns instead of milliseconds: while the 3-D view
 * blocks this thread, messages wait unread.
 */
const SILENT_TURNS = 25;
const RETRY_MS = [250, 500, 1000, 2000, 3000];

class PageSocket {
  /** @param {string} url */
  constructor(url) {
    this.url = url;
    /** @type {WebSocket|null} */
    this.socket = null;
    /** The link is lost; holds have to end. */
    this.onclose = () => {};
    /** The server has ended or refused a hold. @type {(reason: import("./messages.js").Reason) => void} */
    this.onholdended = () => {};
    /** A click in the 3-D view, to place a point. @type {(line: PickRay) => void} */
    this.onpickray = () => {};
    /** The distance of two clicked places. @type {(told: import("./messages.js").Measured) => void} */
    this.onmeasured = () => {};
    /** A point was clicked in the 3-D view. @type {(pointId: string) => void} */
    this.onselected = () => {};
    this.attempts = 0;
    this.silentTurns = 0;
    this.number = 0;
    /** Number of the last state that was drawn. */
    this.rendered = 0;
    this.firstEvents = true;
    /** @type {Map<number, number>} */
    this.pings = new Map();
    window.setInterval(() => this.turn(), PING_MS);
  }

  open() {
    const socket = new WebSocket(this.url);
    this.socket = socket;
    this.silentTurns = 0;
    this.firstEvents = true;
    this.pings.clear();
    socket.addEventListener("open", () => {
      this.attempts = 0;
      this.silentTurns = 0;
      link.set({ status: "open", attempts: 0 });
    });
    socket.addEventListener("message", (event) => {
      if (socket === this.socket) this.receive(event.data);
    });
    socket.addEventListener("close", () => {
      if (socket === this.socket) void this.lost();
    });
  }

  /**
   * Send if the link is open; otherwise the message is dropped, never queued.
   *
   * @param {FromPage} message
   */
  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  turn() {
    this.silentTurns += 1;
    if (this.socket !== null && this.silentTurns > SILENT_TURNS) {
      const silent = this.socket;
      void this.lost();
      silent.close();
      return;
    }
    if (this.socket?.readyState !== WebSocket.OPEN) return;
    this.number += 1;
    this.pings.set(this.number, performance.now());
    if (this.pings.size > 50) this.pings.delete(this.number - 50);
    this.send({ type: "Ping", number: this.number, rendered: this.rendered });
  }

  async lost() {
    this.socket = null;
    this.attempts += 1;
    link.set({ status: "closed", attempts: this.attempts });
    roundTrip.set(null);
    this.onclose();
    const wait = RETRY_MS[Math.min(this.attempts - 1, RETRY_MS.length - 1)];
    // A refused socket gives no reason. An ended session needs a new sign-in.
    if ((await isSignedIn()) === false) link.set({ status: "signed-out", attempts: this.attempts });
    window.setTimeout(() => this.open(), link.get().status === "signed-out" ? 3000 : wait);
  }

  /** @param {string} received */
  receive(received) {
    this.silentTurns = 0;
    /** @type {FromServer} */
    let message;
    try {
      message = JSON.parse(received);
    } catch {
      say("error", text("link.not_json"));
      return;
    }
    switch (message.type) {
      case "PageState": {
        const { number } = message;
        receiveState(message);
        // Runs after the draws that this state has requested. A hidden tab draws nothing and reports nothing.
        requestAnimationFrame(() => {
          this.rendered = number;
        });
        break;
      }
      case "PagePoints":
        points.set(message);
        break;
      case "PagePreview":
        preview.set(message.preview);
        break;
      case "PageEvents":
        receiveEvents(message.events, this.firstEvents);
        this.firstEvents = false;
        break;
      case "Selected":
        this.onselected(message.point_id);
        break;
      case "PickRay":
        this.onpickray(message);
        break;
      case "Measured":
        this.onmeasured(message);
        break;
      case "HoldEnded":
        this.onholdended(message.reason);
        break;
      case "Pong":
        this.measure(message.number);
        break;
    }
  }

  /** @param {number} number */
  measure(number) {
    const sent = this.pings.get(number);
    if (sent === undefined) return;
    this.pings.delete(number);
    const last = performance.now() - sent;
    const smooth = roundTrip.get();
    roundTrip.set(smooth === null ? last : smooth + 0.2 * (last - smooth));
  }
}

// Relative to the page, since each of several robots has its own.
export const socket = new PageSocket(new URL("ws", location.href.replace(/^http/, "ws")).href);
