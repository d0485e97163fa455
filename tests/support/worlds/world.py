"""Bridge and controller in one thread on one simulated clock, without sockets or sleeping."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from bridge.core.bridge import TICK_S, BridgeCore, BridgeOutputs
from controller.core import Controller
from controller.inputs import Sample
from controller.interface import Outputs, StepInputs
from controller.ledger.journal import LedgerState
from rolling_panda import messages as m
from rolling_panda.messages.perception import CloseUpRequest


class World:
    """Steps both at their rates and hands over what they send; the same seed and operator give the same trace.

    Attributes:
        bridge: What moves the robot.
        controller: What commands it.
        inputs: What the controller hears next.
        now: Simulated time (s).
        ticks: Milliseconds since the start.
    """

    def __init__(self, bridge: BridgeCore, controller: Controller, rate_hz: float) -> None:
        """Nothing is said yet; the controller steps at `rate_hz`."""
        self.bridge, self.controller = bridge, controller
        self.inputs = StepInputs(present=frozenset(m.PROCESSES))
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
        self.inputs = replace(self.inputs, stops=(request,))

    def control(self, **heard: Any) -> None:
        """One control period, with these inputs anew."""
        self.inputs = replace(self.inputs, **heard)
        self.send(self.controller.step(self.inputs, self.now))
        self.inputs = replace(self.inputs, stops=(), ledger=LedgerState(self.controller.recorded))

    def receive(self, out: BridgeOutputs) -> None:
        """What the bridge sends."""
        self.to_controller(out.joints, out.odometry, out.state)

    def send(self, out: Outputs) -> None:
        """What the controller sends."""
        self.to_bridge(out.motion, out.token, out.stop, out.cut, out.picture, out.release)

    def to_controller(self, *messages: m.JointState | m.Odometry | m.BridgeState | None) -> None:
        """Messages arrive at the controller."""
        names = {m.JointState: "joints", m.Odometry: "odometry", m.BridgeState: "bridge"}
        heard = {names[type(message)]: Sample(message, self.now) for message in messages if message is not None}
        self.inputs = replace(self.inputs, **heard)  # type: ignore[arg-type]

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
