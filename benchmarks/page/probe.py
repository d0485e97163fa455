"""What is noted inside the browser: when input came, when the page heard of a state and had drawn it, and answers.

The script runs before the page's own. It looks on: what the page hears, draws and asks is the same with it.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from benchmarks.page.browser import clock_ahead

if TYPE_CHECKING:
    from playwright.sync_api import Frame, Page

SCRIPT = """(() => {
  const kept = (window.rpProbe = { states: [], stops: [], presses: [], moves: [], sent: [] });
  const Plain = window.WebSocket;
  window.WebSocket = class extends Plain {
    constructor(url, protocols) {
      super(url, protocols);
      if (!new URL(url, location.href).pathname.endsWith("/ws")) return;
      this.addEventListener("message", (event) => {
        const heard = performance.now();
        if (!event.data.startsWith('{"type":"PageState"')) return;
        const { joints } = JSON.parse(event.data);
        if (joints === null) return;
        // A message posted from a frame's callback is taken once this frame has been laid out and painted.
        requestAnimationFrame(() => {
          const channel = new MessageChannel();
          channel.port1.onmessage = () => kept.states.push([joints.header.stamp, heard, performance.now()]);
          channel.port2.postMessage(0);
        });
      });
    }
  };
  // The 3-D view's client keeps its socket in a worker, which it hands each message.
  const postPlain = Worker.prototype.postMessage;
  Worker.prototype.postMessage = function (data, ...more) {
    if (data?.message?.type === "TransformControlsUpdateMessage") kept.sent.push(performance.now());
    postPlain.call(this, data, ...more);
  };
  const fetchPlain = window.fetch;
  window.fetch = async (...words) => {
    const answer = await fetchPlain(...words);
    if (String(words[0]).endsWith("api/stop")) kept.stops.push([performance.now(), answer.status]);
    return answer;
  };
  const note = (kind, list) => window.addEventListener(kind, (event) => {
    if (event.isTrusted) list.push([event.timeStamp, performance.now()]);
  }, { capture: true });
  note("pointerdown", kept.presses);
  note("pointermove", kept.moves);
})()"""


@dataclass(frozen=True)
class Noted:
    """What the probe of one frame holds, on the machine's monotonic clock (s).

    Attributes:
        states: Of each `PageState`: stamp of its joint state (the robot's time), heard, painted.
        stops: Of each answer to the software stop: when, and its HTTP status.
        presses: Of each press: when the browser had it, when the frame was told.
        moves: Of each movement of the pointer, likewise.
        sent: When the 3-D view had sent where its gizmo is.
    """

    states: list[tuple[float, float, float]]
    stops: list[tuple[float, int]]
    presses: list[tuple[float, float]]
    moves: list[tuple[float, float]]
    sent: list[float]


class Probe:
    """Of one frame. Its clock is read once, as that costs the browser twenty answers."""

    def __init__(self, frame: "Page | Frame") -> None:
        """Find out what its clock says."""
        self._frame, self._ahead = frame, clock_ahead(frame)

    def take(self) -> Noted:
        """Everything that was noted since the last time."""
        kept: dict[str, Any] = self._frame.evaluate(
            "() => Object.fromEntries(Object.entries(rpProbe).map(([name, list]) => [name, list.splice(0)]))"
        )
        return Noted(
            [(stamp, self._at(heard), self._at(painted)) for stamp, heard, painted in kept["states"]],
            [(self._at(when), int(status)) for when, status in kept["stops"]],
            [(self._at(when), self._at(told)) for when, told in kept["presses"]],
            [(self._at(when), self._at(told)) for when, told in kept["moves"]],
            [self._at(when) for when in kept["sent"]],
        )

    def _at(self, milliseconds: float) -> float:
        return milliseconds / 1000 + self._ahead
