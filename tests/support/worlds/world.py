"""Bridge and controller in one thread on one simulated clock, without sockets or sleeping."""

from collections.abc import Callable

from bridge.core.bridge import TICK_S, BridgeCore, BridgeOutputs
from controller.core import Controller
from controller.ledger.journal import LedgerState, Records
from rolling_panda import messages as m
from rolling_panda.messages.perception import CloseUpRequest
from rolling_panda.transport.inbox import Inbox
from tests.support.sent import every


class World:
    """Steps both at their rates and hands over what they send; the same seed and operator give the same trace.

    Attributes:
        bridge: What moves the robot.
        controller: What commands it.
        inbox: What the controller hears.
        now: Simulated time (s).
        ticks: Milliseconds since the start.
    """

    def __init__(self, bridge: BridgeCore, controller: Controller, rate_hz: float) -> None:
        """Nothing is said yet; the controller steps at `rate_hz`."""
        self.bridge, self.controller = bridge, controller
        self.inbox = new_inbox()
        self.now, self.ticks = 0.0, 0
        self._control_ticks = max(1, round(1.0 / (rate_hz * TICK_S)))

    def tick(self) -> None:
        """Advance one millisecond."""
        self.ticks += 1
        self.now = self.ticks * TICK_S
        self.receive(self.bridge.step(self.now))
        if self.ticks % self._control_ticks == 0:
            self.control()

    def run(self, seconds: float) -> None:
        """Advance by simulated seconds."""
        for _ in range(round(seconds / TICK_S)):
            self.tick()

    def run_until(self, condition: Callable[[], bool], limit_s: float) -> bool:
        """Advance until `condition()` holds; False when it does not within `limit_s` simulated seconds."""
        end = self.now + limit_s
        while self.now < end:
            self.run(10 * TICK_S)
            if condition():
                return True
        return False

    def stop(self, reason: str = "trial") -> None:
        """Press the software stop: a message to both."""
        request = m.StopRequest(stop_id=f"stop-{self.ticks}", source="server", user="operator", reason=reason)
        self.bridge.on_stop(request, self.now)
        self.hear(request)

    def hear(self, *messages: object) -> None:
        """Messages arrive at the controller."""
        for message in messages:
            self.inbox.put(message, self.now)

    def control(self) -> None:
        """One control period."""
        self.send(self.controller.step(self.inbox, self.now))

    def receive(self, out: BridgeOutputs) -> None:
        """What the bridge sends."""
        self.hear(*out.messages)

    def send(self, out: list[object]) -> None:
        """What the controller sends."""
        self.to_bridge(*out)
        for records in every(out, Records):
            self.hear(LedgerState(records.rows[-1].number))

    def to_bridge(self, *messages: object) -> None:
        """Messages arrive at the bridge."""
        for message in messages:
            match message:
                case m.MotionCommand():
                    self.bridge.on_motion(message, self.now)
                case m.TokenRequest():
                    self.bridge.on_token(message, self.now)
                case m.StopRequest():
                    self.bridge.on_stop(message, self.now)
                case m.CutCommand():
                    self.bridge.on_cut(message, self.now)
                case CloseUpRequest():
                    self.bridge.on_picture(message)
                case m.ReleaseStop():
                    self.bridge.on_release(message, self.now)


def new_inbox() -> Inbox:
    """An inbox of a controller that has just started, beside all other processes."""
    inbox = Inbox()
    inbox.present = frozenset(m.PROCESSES)
    return inbox
